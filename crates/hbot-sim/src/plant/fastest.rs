//! An upper bound of the rates at which a smooth plant can change, which decides how it is stepped.
//!
//! An explicit method is stable only while h |lambda| is within its region of stability, where h is
//! the step and lambda an eigenvalue of the linearised equations. With the apparent inertia M =
//! I + Gᵀ J G >= I (I: inertia of sphere and hand), |lambda| is at most
//!
//! - D / I + sqrt(K / I) for a damping D and a stiffness K on the sphere, because
//!   lambda² I + lambda D + K = 0. Joint friction b gives D = b |G|², the weight of an eccentric
//!   sphere K = m g |d|. The weight of a wheel module with the potential V gives K = 2 V |g_th|²:
//!   once because its torque changes with the steer angle th, once because the row g_th of G does.
//! - |w| turn (1 + 2 x + sqrt(x)), x² = |J| |G|² / I, for the geometry, which turns with the
//!   wheels.
//!   `turn` bounds the rate of all rows of G, relative to their size, at |w| = 1 rad/s. The terms
//!   are the steering of the wheels itself, and the inertial torque Gᵀ J (dG/dt) w, which is
//!   quadratic in w and depends on th.
//!
//! Sums of norms replace norms everywhere, so the bound is larger than the eigenvalues.

use hbot_core::design::device::Device;

use super::weights::{Module, Weight};
use crate::hand::Grip;
use crate::phenomena::Phenomena;

/// Largest product of step and rate for which a smooth plant is stepped explicitly.
///
/// The region of stability of the classic Runge-Kutta rule contains all z with |z| <= 2.6 and a
/// negative real part.
const STABLE: f64 = 2.0;

/// Upper bounds of the rates at which a smooth plant can change, for each of their causes.
#[derive(Debug, Clone, Copy)]
pub(super) struct FastestRate {
    /// Damping by the joints, seen from the sphere, N m s/rad.
    damping: f64,
    /// Stiffness by weights, seen from the sphere, N m/rad.
    stiffness: f64,
    /// Inertia of the joints, seen from the sphere, kg m².
    joints: f64,
    /// Rate at which the rows of G change, relative to their size, divided by the angular speed of
    /// the sphere.
    turn: f64,
    /// The bound without a hand at rest, rad/s.
    at_rest: f64,
    /// Growth of the bound with the angular speed of the sphere.
    with_speed: f64,
}

impl FastestRate {
    /// Computes the bounds for a sphere of `inertia` (kg m²) on `device`, with those of `phenomena`
    /// that keep the plant smooth.
    pub(super) fn new(device: &Device, phenomena: &Phenomena, inertia: f64) -> Self {
        let offset = phenomena.eccentric.map_or(0.0, |eccentric| {
            let [x, y, z] = eccentric.offset;
            libm::sqrt(x * x + y * y + z * z)
        });
        let farthest = device.sphere_radius() + offset;
        let viscous = phenomena.joint_friction.map_or(0.0, |friction| friction.viscous);
        let modules = phenomena.wheel_modules.map(|modules| Module::all(device, modules.mass));
        let mut fastest = Self {
            damping: 0.0,
            stiffness: Weight::of(device, phenomena).map_or(0.0, |weight| weight.curvature()),
            joints: 0.0,
            turn: 0.0,
            at_rest: 0.0,
            with_speed: 0.0,
        };
        for (i, wheel) in device.wheels().iter().enumerate() {
            let (spec, l1, l2) = (wheel.spec(), wheel.axis_along_axle(), wheel.axis_along_roll());
            // The squares of the rows' lengths: |g_th| = 1 / |l2|, |g_ph|² = (1 + (l1 / l2)²) R² /
            // r².
            let steer2 = 1.0 / (l2 * l2);
            let drive2 = (1.0 + l1 * l1 * steer2) * (farthest / spec.radius) * (farthest / spec.radius);
            let coupling = (spec.axial_inertia * l1).abs();
            fastest.damping += viscous * (steer2 + drive2);
            fastest.joints += spec.steer_inertia * steer2 + spec.drive_inertia * drive2;
            fastest.joints += 2.0 * coupling * libm::sqrt(steer2 * drive2);
            if let Some(modules) = &modules {
                fastest.stiffness += 2.0 * modules[i].curvature() * steer2;
            }
            let steer = libm::sqrt(steer2);
            fastest.turn = fastest.turn.max(steer + (1.0 + steer) * offset / farthest);
        }
        fastest.set_inertia(inertia);
        fastest
    }

    /// Sets the inertia of the sphere and of anything attached to it, such as a hand, in kg m².
    pub(super) fn set_inertia(&mut self, inertia: f64) {
        let x = libm::sqrt(self.joints / inertia);
        self.at_rest = self.damping / inertia + libm::sqrt(self.stiffness / inertia);
        self.with_speed = self.turn * (1.0 + 2.0 * x + libm::sqrt(x));
    }

    /// Returns whether an explicit method is stable with steps of `h` seconds, for a sphere of
    /// `inertia` (kg m²) with the squared angular speed `speed2` (rad²/s²), which the hand `grip`
    /// holds, if it is given.
    #[inline]
    pub(super) fn allows(&self, h: f64, speed2: f64, grip: Option<&Grip>, inertia: f64) -> bool {
        let mut left = STABLE - h * self.at_rest;
        if let Some(hand) = grip.map(Grip::hand) {
            left -= h * (hand.damping / inertia + libm::sqrt(hand.stiffness / inertia));
        }
        let turning = h * self.with_speed;
        // False for a speed that is not a number.
        left > 0.0 && turning * turning * speed2 < left * left
    }
}
