//! Forward kinematics: the sphere's angular velocity from joint rates.

use super::hbot::design::kinematics::Posture;
use super::hbot::{Device, Real};
use super::{real, wide3};

/// Returns the sphere's angular velocity (frame N, rad/s) for the joint rates `zd` (rad/s) at the
/// steer angles `th` (rad).
pub(crate) fn rate(device: &Device, th: &[f64], zd: &[f64]) -> [f64; 3] {
    let th: Vec<Real> = th.iter().map(|x| real(*x)).collect();
    let zd: Vec<Real> = zd.iter().map(|x| real(*x)).collect();
    wide3(Posture::new(device, &th).forward(device, &zd).omega)
}
