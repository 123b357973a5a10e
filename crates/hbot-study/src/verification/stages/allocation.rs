//! Allocation of joint torques for a torque on the sphere.

use std::hint::black_box;

use super::hbot::allocation::{JointLimits, allocate, allocate_clipped};
use super::hbot::design::kinematics::Posture;
use super::hbot::{Device, MAX_JOINTS, Real, Vec3};
use super::{real, vector, wide3};
use crate::timing::Timed;

/// The methods that keep joint torques within their limits, named as in rig files and in the ids of
/// figures.
///
/// `exact` makes the largest share of the wanted torque that the joints can make together.
/// `clipped` takes the joint torques of least cost and scales all by one factor. `cut` takes the
/// joint torques of least cost and cuts each at its own limit. `cut` changes the direction of the
/// torque on the sphere, and serves only for comparison.
pub(crate) const METHODS: [&str; 3] = ["exact", "clipped", "cut"];

/// A test case for the allocation of joint torques: a posture of a device, its joint torque limits,
/// and a wanted torque on the sphere.
#[derive(Clone)]
pub(crate) struct Case {
    posture: Posture,
    limits: JointLimits,
    unlimited: JointLimits,
    wanted: Vec3,
}

impl Case {
    /// Creates a test case for `device` at the steer angles `th` (rad). `peaks` are the torque
    /// limits of a steer and a drive joint, N m. `wanted` is the torque on the sphere in frame N, N
    /// m.
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

    /// Returns the torque on the sphere that results from the joint torques of a method, in frame
    /// N, in N m. `method` is an index into [`METHODS`].
    pub(crate) fn made(&self, method: usize) -> [f64; 3] {
        let torque = self.joint_torques(method, self.wanted);
        wide3(self.posture.torque_on_sphere(&torque[..self.posture.rows().len()]))
    }
}

/// Prepares to measure the time of one allocation by a method, which is an index into [`METHODS`].
/// Successive calls use the entries of `cases` in turn.
pub(crate) fn timed(method: usize, cases: Vec<Case>) -> Timed<'static> {
    let mut k = 0;
    Timed::new(move || {
        k = (k + 1) % cases.len();
        let case = &cases[k];
        case.joint_torques(method, black_box(case.wanted))
    })
}
