//! Joint torques for a torque on the sphere.

use std::hint::black_box;

use super::hbot::allocation::{JointLimits, allocate, allocate_clipped};
use super::hbot::kinematics::Posture;
use super::hbot::{Device, MAX_JOINTS, Real, Vec3};
use super::{real, vector, wide3};
use crate::timing::Timed;

/// The ways to stay within the motors' limits, as rig files and ids have them.
///
/// `exact`: as much of the torque as the joints can make together. `clipped`: the torques of least cost, scaled as a whole.
/// `cut`: each of the torques of least cost cut at its own limit, which nothing in the project does: it turns the torque's
/// direction.
pub(crate) const METHODS: [&str; 3] = ["exact", "clipped", "cut"];

/// A posture of a device, and what its motors can give.
#[derive(Clone)]
pub(crate) struct Case {
    posture: Posture,
    limits: JointLimits,
    unlimited: JointLimits,
    wanted: Vec3,
}

impl Case {
    /// `device` at the steering angles `th` with these peaks of steering and drive, N m, asked for the torque `wanted`, N m.
    pub(crate) fn new(device: &Device, th: &[f64], peaks: [f64; 2], wanted: [f64; 3]) -> Self {
        let th: Vec<Real> = th.iter().map(|th| real(*th)).collect();
        let limits = JointLimits::of_device(device, |joint| real(peaks[joint % 2]));
        let mut unlimited = limits;
        unlimited.peak = limits.peak.map(|peak| peak * real(1.0e3));
        Self { posture: Posture::new(device, &th), limits, unlimited, wanted: vector(wanted) }
    }

    #[inline]
    fn joint_torques(&self, method: usize, wanted: Vec3) -> [Real; MAX_JOINTS] {
        match method {
            0 => allocate(self.posture.rows(), &self.limits, wanted).torque,
            1 => allocate_clipped(self.posture.rows(), &self.limits, wanted).torque,
            _ => {
                let mut torque = allocate(self.posture.rows(), &self.unlimited, wanted).torque;
                for (torque, peak) in torque.iter_mut().zip(&self.limits.peak) {
                    *torque = torque.max(-peak).min(*peak);
                }
                torque
            }
        }
    }

    /// The torque that it makes on the sphere, N m in N.
    pub(crate) fn made(&self, method: usize) -> [f64; 3] {
        let torque = self.joint_torques(method, self.wanted);
        wide3(self.posture.torque_on_sphere(&torque[..self.posture.rows().len()]))
    }
}

/// One allocation, timed over all of `cases` in turn.
pub(crate) fn timed(method: usize, cases: Vec<Case>) -> Timed<'static> {
    let mut k = 0;
    Timed::new(move || {
        k = (k + 1) % cases.len();
        let case = &cases[k];
        case.joint_torques(method, black_box(case.wanted))
    })
}
