//! Weights and springs: their energies, their torques, and their mean torques over a whole step.
//!
//! The torques over a step are discrete gradients: their work over the step is exactly the loss of
//! potential energy. With phi the turn of the step and V the potential,
//! T . phi = V(before) - V(after) to rounding, for any length of step. The idea is from Gonzalez
//! 1996. Closed forms exist for these potentials: a turn by phi moves a vector u by 2 tan(|phi|/2)
//! / |phi| phi x (u + u')/2, and a quaternion likewise with half the angle.

use hbot_core::design::device::{Device, MAX_WHEELS};
use hbot_core::design::kinematics::ContactFrame;
use hbot_core::{Quat, Vec3, rotation};

use crate::phenomena::Phenomena;

/// Standard gravity, m/s². It acts along -n3.
pub(crate) const GRAVITY: f64 = 9.806_65;

/// The weight of the sphere, acting at a centre of mass that is not at the centre of the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Weight {
    /// Position of the centre of mass in sphere axes, m.
    pub(crate) offset: Vec3,
    /// Weight m g of the sphere, N.
    pub(crate) weight: f64,
}

impl Weight {
    /// Returns the weight of the sphere of `device`. Returns `None` if its centre of mass is at the
    /// centre of rotation, so that gravity does not turn it.
    pub(crate) fn of(device: &Device, phenomena: &Phenomena) -> Option<Self> {
        let weight = device.sphere_mass() * GRAVITY;
        let eccentric = phenomena.eccentric.map(|eccentric| Vec3::from_array(eccentric.offset));
        let offset = match phenomena.imbalance {
            None => eccentric?,
            Some(imbalance) => Vec3::from_array(imbalance.torque) / weight + eccentric.unwrap_or(Vec3::ZERO),
        };
        Some(Self { offset, weight })
    }

    /// Returns the potential energy of the weight at the orientation `q`, J.
    pub(crate) fn energy(&self, q: Quat) -> f64 {
        self.weight * (q * self.offset).z
    }

    /// Returns the torque of the weight on the sphere at the orientation `q`, in frame N, in N m.
    pub(crate) fn torque(&self, q: Quat) -> Vec3 {
        (q * self.offset).cross(Vec3::NEG_Z * self.weight)
    }

    /// Returns the largest second derivative of the potential energy along any turn, N m.
    pub(crate) fn curvature(&self) -> f64 {
        self.weight * self.offset.length()
    }

    /// Returns the mean torque of the weight over the turn by `phi` (rad, frame N) from the
    /// orientation `q`, in N m. It is a discrete gradient: its work is exactly the loss of
    /// potential energy.
    pub(crate) fn torque_over(&self, q: Quat, phi: Vec3) -> Vec3 {
        let before = q * self.offset;
        let after = rotation::exp(phi) * before;
        ((before + after) * 0.5).cross(Vec3::NEG_Z * self.weight) * tan_ratio(0.5 * phi.length())
    }
}

/// An isotropic spring that pulls the sphere to the orientation q_d, with the energy V = 2 K |e|²,
/// where (eta, e) = q q_d⁻¹.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spring {
    pub(crate) stiffness: f64,
    pub(crate) target: Quat,
}

impl Spring {
    pub(crate) fn torque_over(&self, q: Quat, phi: Vec3) -> Vec3 {
        let before = q * self.target.conjugate();
        let mean = (before + rotation::exp(phi) * before) * 0.5;
        rotation::vector_part(mean) * (-2.0 * self.stiffness * mean.w * tan_ratio(0.25 * phi.length()))
    }
}

/// The weight of one wheel module, which acts at the wheel's centre, off the steering axis. Its
/// energy is a cosine of the steer angle th, plus a constant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Module {
    /// Coefficients of cos th and sin th in the potential energy, J, with the steer angle th.
    cos: f64,
    sin: f64,
}

impl Module {
    /// Creates the module of wheel `index`. Its `mass` (kg) is at the wheel's centre, (R + r) c3.
    fn new(device: &Device, index: usize, mass: f64) -> Self {
        let wheel = &device.wheels()[index];
        let lever = mass * GRAVITY * (device.sphere_radius() + wheel.spec().radius);
        let lift = |th: f64| lever * ContactFrame::at(wheel, th).c3.z;
        let half = 0.5 * core::f64::consts::PI;
        Self { cos: 0.5 * (lift(0.0) - lift(2.0 * half)), sin: 0.5 * (lift(half) - lift(-half)) }
    }

    /// Creates the wheel modules of all wheels of `device`, with `mass` kg each.
    pub(crate) fn all(device: &Device, mass: f64) -> [Self; MAX_WHEELS] {
        let mut modules = [Self::default(); MAX_WHEELS];
        for (i, place) in modules[..device.wheels().len()].iter_mut().enumerate() {
            *place = Self::new(device, i, mass);
        }
        modules
    }

    /// Returns the potential energy of the module at the steer angle `th`, up to a constant, J.
    pub(crate) fn energy(&self, th: f64) -> f64 {
        self.cos * libm::cos(th) + self.sin * libm::sin(th)
    }

    /// Returns the torque of the module's weight on the steer joint at the steer angle `th`, N m.
    pub(crate) fn torque(&self, th: f64) -> f64 {
        self.cos * libm::sin(th) - self.sin * libm::cos(th)
    }

    /// Returns the largest second derivative of the potential energy with respect to the steer
    /// angle, N m.
    pub(crate) fn curvature(&self) -> f64 {
        libm::sqrt(self.cos * self.cos + self.sin * self.sin)
    }

    /// Returns the mean torque of the module's weight over a turn of the steer joint by `delta` rad
    /// from `th`, in N m. It is a discrete gradient: its work is exactly the loss of potential
    /// energy.
    pub(crate) fn torque_over(&self, th: f64, delta: f64) -> f64 {
        self.torque(th + 0.5 * delta) * sin_ratio(0.5 * delta)
    }
}

/// Returns tan x / x. Near 0 it uses a power series, so x can be 0.
fn tan_ratio(x: f64) -> f64 {
    if x < 1.0e-4 { 1.0 + x * x / 3.0 } else { libm::tan(x) / x }
}

/// Returns sin x / x. Near 0 it uses a power series, so x can be 0.
fn sin_ratio(x: f64) -> f64 {
    if x.abs() < 1.0e-4 { 1.0 - x * x / 6.0 } else { libm::sin(x) / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_core::design::device::WheelSpec;

    /// The work of a discrete-gradient torque over a turn equals the loss of potential energy, for
    /// the spring, the weight and the wheel module. The tolerance is the rounding of energies of
    /// about 5 J.
    #[test]
    fn the_work_over_a_turn_is_what_the_potential_loses() {
        let spring = Spring { stiffness: 3.0, target: rotation::exp(Vec3::new(0.4, -1.0, 0.3)) };
        let weight = Weight { offset: Vec3::new(0.01, -0.3, 0.2), weight: 4.6 };
        for (i, size) in [0.0, 1e-9, 1e-5, 3e-4, 0.01, 0.5, 2.0].into_iter().enumerate() {
            let q = rotation::exp(Vec3::new(0.1, 0.7, -0.2) * i as f64);
            let phi = Vec3::new(1.0, -2.0, 0.5) * size;
            let after = rotation::exp(phi) * q;
            let energy = |q: Quat| {
                2.0 * spring.stiffness * rotation::vector_part(q * spring.target.conjugate()).length_squared()
            };
            let loss = energy(q) - energy(after);
            assert!((spring.torque_over(q, phi).dot(phi) - loss).abs() < 1e-14, "{size}");
            let loss = weight.energy(q) - weight.energy(after);
            assert!((weight.torque_over(q, phi).dot(phi) - loss).abs() < 1e-14, "{size}");
        }
        let spec = WheelSpec {
            axis: Vec3::new(1.0, 0.3, -1.0),
            cone: 0.3,
            toe: 0.1,
            radius: 0.015,
            steer_inertia: 3e-5,
            drive_inertia: 4e-6,
            axial_inertia: 0.0,
        };
        let device =
            Device::new(0.1, 0.5, &[spec, WheelSpec { axis: Vec3::new(-1.0, 0.0, -1.0), ..spec }]).unwrap();
        let module = Module::new(&device, 0, 0.05);
        for (th, delta) in [(0.3, 1e-7), (-2.0, 0.02), (5.0, 1.5), (100.0, -3.0)] {
            let loss = module.energy(th) - module.energy(th + delta);
            assert!((module.torque_over(th, delta) * delta - loss).abs() < 1e-15);
            // The energy is the weight times its height.
            let height = |th: f64| 0.05 * GRAVITY * 0.115 * ContactFrame::at(&device.wheels()[0], th).c3.z;
            assert!((height(th) - height(th + delta) - loss).abs() < 1e-15);
        }
    }
}
