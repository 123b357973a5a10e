//! Torques on the sphere other than those of the wheels.

use hbot_core::{Quat, Vec3, rotation};

/// A torque on the sphere that depends on time, orientation and angular velocity.
///
/// [`at`](Load::at) computes everything that depends on time alone. An integration method calls it
/// only once for each time of a step, and then calls [`torque`](Load::torque) with the result for
/// several states. A closure of time, orientation and angular velocity is a load too.
pub trait Load {
    /// Quantities of this load that depend on time alone.
    type Instant;

    /// Computes the quantities of this load that depend on time alone, at time `t`, s.
    fn at(&self, t: f64) -> Self::Instant;

    /// Returns the torque on the sphere in frame N, in N m.
    ///
    /// `now` is the result of [`at`](Load::at), `q` the orientation (sphere axes to N) and `omega`
    /// the angular velocity (in N, rad/s). Within a step the norm of `q` can differ from 1 by the
    /// square of the turn in a step.
    fn torque(&self, now: &Self::Instant, q: Quat, omega: Vec3) -> Vec3;
}

impl<F: Fn(f64, Quat, Vec3) -> Vec3> Load for F {
    type Instant = f64;

    #[inline]
    fn at(&self, t: f64) -> f64 {
        t
    }

    #[inline]
    fn torque(&self, now: &f64, q: Quat, omega: Vec3) -> Vec3 {
        self(*now, q, omega)
    }
}

/// A vector is a load: a constant torque on the sphere in frame N, in N m.
impl Load for Vec3 {
    type Instant = ();

    #[inline]
    fn at(&self, _: f64) {}

    #[inline]
    fn torque(&self, (): &(), _: Quat, _: Vec3) -> Vec3 {
        *self
    }
}

/// A load whose torque is the sum of the torques of two loads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sum<A, B>(pub A, pub B);

impl<A: Load, B: Load> Load for Sum<A, B> {
    type Instant = (A::Instant, B::Instant);

    #[inline]
    fn at(&self, t: f64) -> Self::Instant {
        (self.0.at(t), self.1.at(t))
    }

    #[inline]
    fn torque(&self, now: &Self::Instant, q: Quat, omega: Vec3) -> Vec3 {
        self.0.torque(&now.0, q, omega) + self.1.torque(&now.1, q, omega)
    }
}

/// An isotropic spring and damper that pull the sphere to a fixed orientation q_d along the
/// shortest turn: T = K log(q_d q⁻¹) - D w.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringDamper {
    /// Stiffness K, N m/rad.
    pub stiffness: f64,
    /// Damping D, N m s/rad.
    pub damping: f64,
    /// Orientation q_d to which the spring pulls, a unit quaternion from sphere axes to frame N.
    pub reference: Quat,
}

impl Load for SpringDamper {
    type Instant = ();

    #[inline]
    fn at(&self, _: f64) {}

    #[inline]
    fn torque(&self, (): &(), q: Quat, omega: Vec3) -> Vec3 {
        rotation::log(self.reference * q.conjugate()) * self.stiffness - omega * self.damping
    }
}

/// A sinusoidal torque about a fixed axis: `amplitude` sin(2 pi `hertz` t), with the time t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sine {
    /// Largest torque as a vector along the fixed axis, in frame N, in N m.
    pub amplitude: Vec3,
    /// Frequency of the torque, Hz.
    pub hertz: f64,
}

impl Load for Sine {
    type Instant = Vec3;

    #[inline]
    fn at(&self, t: f64) -> Vec3 {
        self.amplitude * libm::sin(core::f64::consts::TAU * self.hertz * t)
    }

    #[inline]
    fn torque(&self, now: &Vec3, _: Quat, _: Vec3) -> Vec3 {
        *now
    }
}
