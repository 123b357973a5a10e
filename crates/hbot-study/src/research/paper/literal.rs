//! The paper's equations taken literally, step by step with matrices and velocities. They are
//! independent of the core's closed forms.

use hbot_core::design::device::Wheel;
use hbot_core::{Device, Mat3, Vec3, WheelSpec};

/// Returns the rotation by `angle` (rad) about the unit vector `axis` (Rodrigues' formula).
pub(super) fn about(axis: Vec3, angle: f64) -> Mat3 {
    let (sin, cos) = libm::sincos(angle);
    let columns = [Vec3::X, Vec3::Y, Vec3::Z]
        .map(|v| v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos)));
    Mat3::from_cols(columns[0], columns[1], columns[2])
}

/// Returns the rotation A0: the smallest rotation that turns the axis n3 to `l`. If this is a half
/// turn, its axis is n1.
pub(super) fn least_rotation(l: Vec3) -> Mat3 {
    let axis = Vec3::Z.cross(l);
    let sine = axis.length();
    if sine < 1.0e-12 {
        return about(Vec3::X, if l.z > 0.0 { 0.0 } else { core::f64::consts::PI });
    }
    about(axis / sine, libm::atan2(sine, l.z))
}

/// Returns the contact frame C of a wheel: the rotation about the steering axis l by the angle
/// `th`, times `first`, Rx(cone) and Rz(toe). In equation 1 of the paper, taken literally, `first`
/// is the identity. In this project it is A0, the smallest rotation from n3 to l.
pub(super) fn frame(spec: &WheelSpec, first: Mat3, th: f64) -> Mat3 {
    about(spec.axis, th) * first * about(Vec3::X, spec.cone) * about(Vec3::Z, spec.toe)
}

/// Returns the joint rates (steer, drive) of a wheel while the sphere turns at `omega`, from
/// equations 4 to 7 of the paper: the velocities of the contact on the wheel and on the sphere are
/// equal along c1 and c2.
pub(super) fn rates(device: &Device, wheel: &Wheel, c: Mat3, omega: Vec3) -> [f64; 2] {
    let (big, small) = (device.sphere_radius(), wheel.spec().radius);
    let [c1, c2, c3] = [c.x_axis, c.y_axis, c.z_axis];
    // Equation 4 for the joint rates (steer, drive): the wheel's centre moves with frame C, and the
    // contact moves about the centre with frame W.
    let wheel_side = |steer: f64, drive: f64| {
        let frame = wheel.spec().axis * steer;
        frame.cross(c3 * (big + small)) + (frame + c1 * drive).cross(c3 * -small)
    };
    // Equation 5.
    let sphere_side = omega.cross(c3 * big);
    let along = |v: Vec3| [v.dot(c1), v.dot(c2)];
    let ([a, c], [b, d]) = (along(wheel_side(1.0, 0.0)), along(wheel_side(0.0, 1.0)));
    let [u, v] = along(sphere_side);
    let det = a * d - b * c;
    [(u * d - b * v) / det, (a * v - u * c) / det]
}

/// Returns the rows of the matrix G for a device with two wheels whose contact frames follow
/// equation 1 of the paper literally.
pub(super) fn rows(device: &Device, th: [f64; 2]) -> [Vec3; 4] {
    core::array::from_fn(|k| {
        let wheel = &device.wheels()[k / 2];
        let c = frame(wheel.spec(), Mat3::IDENTITY, th[k / 2]);
        let along = |axis| rates(device, wheel, c, axis)[k % 2];
        Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z))
    })
}
