//! The checks of one width. This folder is compiled twice, with `super::core` once `hbot_core` and once `hbot_core_f32`.
//!
//! # Tolerances
//!
//! Each is `scale * (GOLDEN + 16 EPS * condition)`: what the vectors themselves are good to, and sixteen roundings of this
//! width, the inputs' among them, as far as the operation magnifies them. Scale and condition stand by each figure.

mod allocation;
mod impedance;
mod kinematics;
mod odometry;

pub use allocation::allocation;
pub use impedance::{hopf, impedance};
pub use kinematics::kinematics;
pub use odometry::odometry;

use super::core::device::{Device, DeviceError, WheelSpec};
use super::core::kinematics::Posture;
use super::core::{Mat3, Quat, Real, Vec3};
use crate::golden_support::vectors;

/// What the vectors are good to, relative, where a closed form exists (golden/README.md).
pub const GOLDEN: f64 = 1e-12;
/// One rounding of this width.
#[allow(clippy::unnecessary_cast, reason = "Real is f32 or f64")]
pub const EPS: f64 = Real::EPSILON as f64;

/// See the module's documentation.
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

/// From rows.
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

/// How far one rounding of axis, cone, toe and steering angle moves a wheel's contact frame. A0 turns about a
/// horizontal axis that a change of l near -n3 swings about: by 1 / sin of the angle from -n3, or 1 / sqrt(1 + l3) or less.
pub fn frame_condition(wheel: &vectors::Wheel, theta: f64) -> f64 {
    let from_below = (1.0 + wheel.axis[2]).max(1e-15).sqrt();
    1.0 + theta.abs() + 1.0 / from_below
}

/// The same, relative, of the rows of G: they divide by l.c2 = sin a cos b, which a rounding of a and b moves by
/// a cot a and b tan b of it.
pub fn row_condition(wheel: &vectors::Wheel, theta: f64) -> f64 {
    frame_condition(wheel, theta) + lever_condition(wheel)
}

/// Of l.c2 = sin a cos b, relative.
pub fn lever_condition(wheel: &vectors::Wheel) -> f64 {
    1.0 + (wheel.cone / wheel.cone.tan()).abs() + (wheel.toe * wheel.toe.tan()).abs()
}

/// The largest over the wheels.
pub fn worst(device: &vectors::Device, theta: &[f64], of: impl Fn(&vectors::Wheel, f64) -> f64) -> f64 {
    device.wheels.iter().zip(theta).map(|(w, th)| of(w, *th)).fold(0.0, f64::max)
}
