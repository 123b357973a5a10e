//! The stages under study, in one floating-point width, f32 or f64. Their inputs and outputs are
//! f64, so that both widths are compared with one true value. The rounding of the inputs counts as
//! an error of the width.

pub(crate) mod allocation;
pub(crate) mod kinematics;
pub(crate) mod odometry;
pub(crate) mod spring;

use super::core as hbot;
use hbot::{Device, Quat, Real, Vec3, WheelSpec};

/// Name of this floating-point width, as used in the ids of figures.
pub(crate) const WIDTH: &str = if size_of::<Real>() == 8 { "f64" } else { "f32" };

/// Rounds `x` to the nearest number of this floating-point width.
#[allow(clippy::unnecessary_cast, reason = "one width of the two makes it one")]
pub(crate) fn real(x: f64) -> Real {
    x as Real
}

/// Converts `x` from this floating-point width to f64, without rounding.
#[allow(clippy::useless_conversion, reason = "one width of the two makes it one")]
pub(crate) fn wide(x: Real) -> f64 {
    f64::from(x)
}

pub(crate) fn vector(v: [f64; 3]) -> Vec3 {
    Vec3::from_array(v.map(real))
}

pub(crate) fn wide3(v: Vec3) -> [f64; 3] {
    v.to_array().map(wide)
}

pub(crate) fn quaternion([w, x, y, z]: [f64; 4]) -> Quat {
    Quat::from_xyzw(real(x), real(y), real(z), real(w))
}

pub(crate) fn wide4(q: Quat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z].map(wide)
}

/// Converts a device of the f64 core to this floating-point width.
pub(crate) fn device(of: &hbot_core::Device) -> Device {
    let wheel = |wheel: &hbot_core::design::device::Wheel| {
        let spec = wheel.spec();
        WheelSpec {
            axis: vector(spec.axis.to_array()),
            cone: real(spec.cone),
            toe: real(spec.toe),
            radius: real(spec.radius),
            steer_inertia: real(spec.steer_inertia),
            drive_inertia: real(spec.drive_inertia),
            axial_inertia: real(spec.axial_inertia),
        }
    };
    let wheels: Vec<WheelSpec> = of.wheels().iter().map(wheel).collect();
    let made = Device::new(real(of.sphere_radius()), real(of.sphere_mass()), &wheels);
    made.unwrap_or_else(|error| {
        unreachable!("a legal design stays one when its figures are rounded: {error}")
    })
}
