//! What acts on the sphere besides the wheels.

use hbot_core::{Quat, Vec3, rotation};

/// A torque on the sphere that depends on time, orientation and angular velocity.
///
/// What depends on time alone is computed by [`at`](Load::at), once for every instant that a step looks at; a method
/// may look at one instant in several states. A closure of time, orientation and angular velocity is a load.
pub trait Load {
    /// What holds at one instant in every state.
    type Instant;

    /// What holds at the time `t`, s.
    fn at(&self, t: f64) -> Self::Instant;

    /// The torque on the sphere in N, N m, at that instant, for the orientation `q` (sphere axes to N) and the
    /// angular velocity `omega` (in N, rad/s). Within a step `q` may be off unit norm by the square of a step's turn.
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

/// A constant torque on the sphere, in N, N m.
impl Load for Vec3 {
    type Instant = ();

    #[inline]
    fn at(&self, _: f64) {}

    #[inline]
    fn torque(&self, (): &(), _: Quat, _: Vec3) -> Vec3 {
        *self
    }
}

/// Two loads together.
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

/// An isotropic geodesic spring and damper to a fixed orientation: T = K log(q_d q⁻¹) - D w.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringDamper {
    /// K, N m/rad.
    pub stiffness: f64,
    /// D, N m s/rad.
    pub damping: f64,
    /// The orientation q_d that it pulls to, sphere axes to N, unit.
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

/// A torque about a fixed axis that swings with time: `amplitude` sin(2 pi `hertz` t).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sine {
    /// Axis and largest torque in N, N m.
    pub amplitude: Vec3,
    /// Frequency, Hz.
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
