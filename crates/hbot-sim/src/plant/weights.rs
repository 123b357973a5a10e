//! Weights and springs: their energies, torques, and torques over a whole step.
//!
//! The last are discrete gradients: their work over a step is exactly what the potential loses.
//! With phi the turn of the step and V a potential, T . phi = V(before) - V(after) to rounding, however long the step
//! (Gonzalez 1996 has the idea; for these potentials closed forms exist, since a turn by phi moves a vector u by
//! 2 tan(|phi|/2) / |phi| phi x (u + u')/2, and a quaternion likewise with half the angle).

use hbot_core::device::{Device, MAX_WHEELS};
use hbot_core::kinematics::ContactFrame;
use hbot_core::{Quat, Vec3, rotation};

/// Standard gravity, m/s², along -n3.
pub(crate) const GRAVITY: f64 = 9.806_65;

/// A weight off the sphere's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Weight {
    /// Where it is in the sphere, m.
    pub(crate) offset: Vec3,
    /// Its weight m g, N.
    pub(crate) weight: f64,
}

impl Weight {
    /// Potential energy, J.
    pub(crate) fn energy(&self, q: Quat) -> f64 {
        self.weight * (q * self.offset).z
    }

    /// The torque on the sphere in N at the orientation `q`, N m.
    pub(crate) fn torque(&self, q: Quat) -> Vec3 {
        (q * self.offset).cross(Vec3::NEG_Z * self.weight)
    }

    /// The most that the energy can curve along any turn, N m.
    pub(crate) fn curvature(&self) -> f64 {
        self.weight * self.offset.length()
    }

    /// The torque over a turn by `phi` (rad, N) from `q`.
    pub(crate) fn torque_over(&self, q: Quat, phi: Vec3) -> Vec3 {
        let before = q * self.offset;
        let after = rotation::exp(phi) * before;
        ((before + after) * 0.5).cross(Vec3::NEG_Z * self.weight) * tan_ratio(0.5 * phi.length())
    }
}

/// The isotropic quaternion spring: V = 2 K |e|², with (eta, e) = q q_d⁻¹.
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

/// A weight at the centre of one wheel, off its steering axis: V = height cos(th - lowest) and a constant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Module {
    /// Weight times lift: coefficients of cos th and sin th, J.
    cos: f64,
    sin: f64,
}

impl Module {
    /// The module of wheel `index`, of `mass` kg at the wheel's centre (R + r) c3.
    fn new(device: &Device, index: usize, mass: f64) -> Self {
        let wheel = &device.wheels()[index];
        let lever = mass * GRAVITY * (device.sphere_radius() + wheel.spec().radius);
        let lift = |th: f64| lever * ContactFrame::at(wheel, th).c3.z;
        let half = 0.5 * core::f64::consts::PI;
        Self { cos: 0.5 * (lift(0.0) - lift(2.0 * half)), sin: 0.5 * (lift(half) - lift(-half)) }
    }

    /// The modules of all wheels of `device`, each of `mass` kg.
    pub(crate) fn all(device: &Device, mass: f64) -> [Self; MAX_WHEELS] {
        let mut modules = [Self::default(); MAX_WHEELS];
        for (i, place) in modules[..device.wheels().len()].iter_mut().enumerate() {
            *place = Self::new(device, i, mass);
        }
        modules
    }

    /// Potential energy, J, but for a constant.
    pub(crate) fn energy(&self, th: f64) -> f64 {
        self.cos * libm::cos(th) + self.sin * libm::sin(th)
    }

    /// The torque on the steering joint, N m.
    pub(crate) fn torque(&self, th: f64) -> f64 {
        self.cos * libm::sin(th) - self.sin * libm::cos(th)
    }

    /// The most that the energy can curve, N m.
    pub(crate) fn curvature(&self) -> f64 {
        libm::sqrt(self.cos * self.cos + self.sin * self.sin)
    }

    /// The torque over a turn of the joint by `delta` rad from `th`.
    pub(crate) fn torque_over(&self, th: f64, delta: f64) -> f64 {
        self.torque(th + 0.5 * delta) * sin_ratio(0.5 * delta)
    }
}

/// tan x / x.
fn tan_ratio(x: f64) -> f64 {
    if x < 1.0e-4 { 1.0 + x * x / 3.0 } else { libm::tan(x) / x }
}

/// sin x / x.
fn sin_ratio(x: f64) -> f64 {
    if x.abs() < 1.0e-4 { 1.0 - x * x / 6.0 } else { libm::sin(x) / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_core::device::WheelSpec;

    /// What a discrete gradient is: its work is the potential's loss, to the rounding of energies of about 5 J.
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
            // The energy is the weight's height.
            let height = |th: f64| 0.05 * GRAVITY * 0.115 * ContactFrame::at(&device.wheels()[0], th).c3.z;
            assert!((height(th) - height(th + delta) - loss).abs() < 1e-15);
        }
    }
}
