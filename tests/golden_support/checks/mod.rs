//! The checks in one floating-point width. This folder is compiled twice: `super::core` is
//! `hbot_core` or `hbot_core_f32`.
//!
//! # Tolerances
//!
//! Each tolerance is `scale * (GOLDEN + 16 EPS * condition)`: the accuracy of the vectors, and
//! sixteen roundings of this width, including those of the inputs, as amplified by the operation.
//! Comments at each figure explain its scale and condition.

mod allocation;
mod impedance;
mod kinematics;
mod odometry;

pub use allocation::allocation;
pub use impedance::{hopf, impedance};
pub use kinematics::kinematics;
pub use odometry::odometry;

use super::core::design::device::{Device, DeviceError, WheelSpec};
use super::core::design::kinematics::Posture;
use super::core::{Mat3, Quat, Real, Vec3};
use crate::golden_support::vectors;

/// Relative accuracy of the vectors for figures with a closed form (tests/golden/README.md).
pub const GOLDEN: f64 = 1e-12;
/// Relative rounding error of one operation in this floating-point width.
#[allow(clippy::unnecessary_cast, reason = "Real is f32 or f64")]
pub const EPS: f64 = Real::EPSILON as f64;

/// Returns the tolerance for a figure (see the documentation of this module).
pub fn tolerance(scale: f64, condition: f64) -> f64 {
    scale * (GOLDEN + 16.0 * EPS * condition)
}

#[allow(clippy::unnecessary_cast, reason = "Real is f32 or f64")]
pub fn real(x: f64) -> Real {
    x as Real
}

#[allow(clippy::unnecessary_cast, reason = "Real is f32 or f64")]
pub fn wide(x: Real) -> f64 {
    x as f64
}

pub fn reals(x: &[f64]) -> Vec<Real> {
    x.iter().copied().map(real).collect()
}

pub fn vector(x: vectors::Vector) -> Vec3 {
    Vec3::from_array(x.map(real))
}

pub fn array(v: Vec3) -> [f64; 3] {
    v.to_array().map(wide)
}

pub fn quaternion([w, x, y, z]: vectors::Quaternion) -> Quat {
    Quat::from_xyzw(real(x), real(y), real(z), real(w))
}

pub fn wxyz(q: Quat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z].map(wide)
}

/// Converts a matrix, given by its rows.
pub fn matrix(rows: &vectors::Matrix) -> Mat3 {
    let [x, y, z] = rows.map(vector);
    Mat3::from_cols(x, y, z).transpose()
}

pub fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub fn device(of: &vectors::Device) -> Result<Device, DeviceError> {
    let wheels: Vec<WheelSpec> = of
        .wheels
        .iter()
        .map(|w| WheelSpec {
            axis: vector(w.axis),
            cone: real(w.cone),
            toe: real(w.toe),
            radius: real(w.radius),
            steer_inertia: real(w.steer_inertia),
            drive_inertia: real(w.drive_inertia),
            axial_inertia: 0.0,
        })
        .collect();
    Device::new(real(of.sphere_radius), real(of.sphere_mass), &wheels)
}

pub fn posture(device: &Device, theta: &[f64]) -> Posture {
    Posture::new(device, &reals(theta))
}

/// Returns how much a relative rounding of axis, cone, toe and steer angle moves a wheel's contact
/// frame, in units of the rounding. A0 turns about a horizontal axis, which swings when l changes
/// near -n3. The amplification is 1 / sin of the angle from -n3, which is at most 1 / sqrt(1 + l3).
pub fn frame_condition(wheel: &vectors::Wheel, theta: f64) -> f64 {
    let from_below = (1.0 + wheel.axis[2]).max(1e-15).sqrt();
    1.0 + theta.abs() + 1.0 / from_below
}

/// Returns the relative amplification of rounding in the rows of G. The rows divide by l.c2 = sin a
/// cos b, which a rounding of a and b changes by a cot a and b tan b of itself.
pub fn row_condition(wheel: &vectors::Wheel, theta: f64) -> f64 {
    frame_condition(wheel, theta) + lever_condition(wheel)
}

/// Returns the relative amplification of rounding in l.c2 = sin a cos b.
pub fn lever_condition(wheel: &vectors::Wheel) -> f64 {
    1.0 + (wheel.cone / wheel.cone.tan()).abs() + (wheel.toe * wheel.toe.tan()).abs()
}

/// Returns the largest value of `of` over the wheels.
pub fn worst(device: &vectors::Device, theta: &[f64], of: impl Fn(&vectors::Wheel, f64) -> f64) -> f64 {
    device.wheels.iter().zip(theta).map(|(w, th)| of(w, *th)).fold(0.0, f64::max)
}
