//! Legal devices at random.

use crate::prelude::*;
use proptest::prelude::*;

pub fn unit_vector() -> impl Strategy<Value = Vec3> {
    (-1.0..1.0_f64, 0.0..core::f64::consts::TAU).prop_map(|(z, phi)| {
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    })
}

pub fn vector(size: f64) -> impl Strategy<Value = Vec3> {
    (unit_vector(), 0.0..size).prop_map(|(axis, length)| axis * length)
}

/// Any orientation, over all of SO(3).
pub fn orientation() -> impl Strategy<Value = Quat> {
    vector(core::f64::consts::PI).prop_map(rotation::exp)
}

/// Symmetric positive definite matrices with eigenvalues from 0.1 to 10 times `size`.
pub fn impedance(size: f64) -> impl Strategy<Value = Mat3> {
    (orientation(), prop::array::uniform3(-1.0..1.0_f64)).prop_map(move |(q, e)| {
        let r = Mat3::from_quat(q);
        let diagonal = Mat3::from_diagonal(Vec3::from(e.map(|e| size * 10.0_f64.powf(e))));
        let m = r * diagonal * r.transpose();
        (m + m.transpose()) * 0.5
    })
}

pub fn wheel() -> impl Strategy<Value = WheelSpec> {
    (unit_vector(), 0.1..1.2_f64, -0.9..0.9_f64, 0.005..0.06_f64).prop_map(|(axis, cone, toe, radius)| {
        WheelSpec {
            axis,
            cone,
            toe,
            radius,
            steer_inertia: 2.7e-5,
            drive_inertia: 3.5e-6,
            axial_inertia: 0.0,
        }
    })
}

pub fn device_and_steering() -> impl Strategy<Value = (Device, Vec<f64>)> {
    let wheels = prop::collection::vec((wheel(), -3.2..3.2_f64), 2..=8);
    (wheels, 0.05..0.5_f64).prop_filter_map("not a legal device", |(wheels, radius)| {
        let (specs, theta): (Vec<_>, Vec<_>) = wheels.into_iter().unzip();
        Device::new(radius, 0.5, &specs).ok().map(|device| (device, theta))
    })
}
