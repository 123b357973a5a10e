//! The encoders and motors of simulated joints, which the controllers of all protocols share.

use core::ops::Range;

use hbot_core::design::device::MAX_JOINTS;
use hbot_link::JointFlags;

use super::disc::Disc;
use super::filter::EncoderFilter;
use super::joint::{Axis, EncoderKind, SimulatedJoint};
use super::motors::Motors;
use crate::phenomena;
use crate::plant::JointTorques;

const NO_TORQUE: JointTorques = [0.0; MAX_JOINTS];

/// The true angles and rates of the joints, from which simulated encoders compute their counts.
#[derive(Debug, Clone, Copy)]
pub struct Truth<'a> {
    /// True angles of the joints, rad.
    pub angles: &'a [f64; MAX_JOINTS],
    /// True rates of the joints, rad/s.
    pub rates: &'a [f64; MAX_JOINTS],
}

/// Encoders and motors of all joints, in the order steer, drive of each wheel.
#[derive(Debug, Clone)]
pub(super) struct Joints {
    count: usize,
    pub(super) axes: [Axis; MAX_JOINTS],
    discs: Option<Box<[Disc; MAX_JOINTS]>>,
    motors: Option<Box<Motors>>,
    /// Torque that each motor must give, N m, positive in the joint's direction. It is within the
    /// motor's peak, and 0 if the motor is off.
    asked: JointTorques,
}

impl Joints {
    pub(super) fn new(
        specs: &[SimulatedJoint],
        angles: &[f64; MAX_JOINTS],
        encoder: Option<&phenomena::Encoder>,
    ) -> Self {
        let none = SimulatedJoint {
            counts_per_turn: 1,
            gear: 1.0,
            reversed: false,
            peak: 0.0,
            continuous: 0.0,
            encoder: EncoderKind::Incremental,
            zero: 0.0,
        };
        let discs = encoder.map(Disc::all);
        let axes = core::array::from_fn(|j| {
            Axis::new(specs.get(j).copied().unwrap_or(none), angles[j], disc(&discs, j))
        });
        Self { count: specs.len().min(MAX_JOINTS), axes, discs, motors: None, asked: NO_TORQUE }
    }

    /// Returns the number of joints.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    pub(super) fn set_encoder(&mut self, encoder: Option<&phenomena::Encoder>, angles: &[f64; MAX_JOINTS]) {
        let new = encoder.map(Disc::all);
        for (j, axis) in self.axes.iter_mut().enumerate() {
            axis.replace_disc(angles[j], disc(&self.discs, j), disc(&new, j));
        }
        self.discs = new;
    }

    pub(super) fn set_motor(&mut self, motor: Option<phenomena::Motor>) {
        self.motors = motor.map(|motor| match self.motors.take() {
            None => Box::new(Motors::new(motor, &self.asked)),
            Some(mut motors) => {
                motors.replace(motor);
                motors
            }
        });
    }

    /// Returns the torques that act at the joints now, N m. Each is positive in the joint's
    /// direction.
    pub(super) fn torque(&self) -> &JointTorques {
        self.motors.as_ref().map_or(&self.asked, |motors| &motors.acting)
    }

    pub(super) fn drive(&mut self, h: f64, rates: impl FnOnce() -> [f64; MAX_JOINTS]) -> JointTorques {
        match &mut self.motors {
            None => self.asked,
            Some(motors) => motors.drive(h, &self.axes[..self.count], &self.asked, &rates()),
        }
    }

    /// Sets the natural frequency of the filter through which the controller of joint `j` reads its
    /// encoder, rad/s. If it is not positive and finite, the controller has no filter.
    pub(super) fn set_filter(&mut self, j: usize, natural: f64) {
        let filter = &mut self.axes[j].filter;
        if !(natural > 0.0 && natural.is_finite()) {
            *filter = None;
        } else if let Some(filter) = filter {
            filter.tune(natural);
        } else {
            *filter = Some(EncoderFilter::new(natural));
        }
    }

    /// Returns whether any controller filters what its encoder reads.
    pub(super) fn filters(&self) -> bool {
        self.axes.iter().any(|axis| axis.filter.is_some())
    }

    /// Advances the filters by a step of `h` seconds, from the motion `before` it to the motion
    /// `after` it.
    pub(super) fn follow(&mut self, h: f64, before: &Truth<'_>, after: &Truth<'_>) {
        for (j, axis) in self.axes[..self.count].iter_mut().enumerate() {
            let disc = disc(&self.discs, j);
            let rate = |truth: &Truth<'_>| axis.read_rate(truth.angles[j], truth.rates[j], disc);
            let (from, to) = (rate(before), rate(after));
            if let Some(filter) = &mut axis.filter {
                filter.follow(h, from, to);
            }
        }
    }

    /// Informs the encoders of the present joint angles, rad, so that they detect when a joint
    /// passes an index mark.
    pub(super) fn sense(&mut self, angles: &[f64; MAX_JOINTS]) {
        for (j, (axis, angle)) in self.axes[..self.count].iter_mut().zip(angles).enumerate() {
            axis.sense(*angle, disc(&self.discs, j));
        }
    }

    /// Returns the torque that the motor of joint `j` gives if the controller is commanded to give
    /// `torque`, N m. It is limited to the motor's peak. `torque` is positive in the controller's
    /// direction, and the result in the joint's.
    pub(super) fn within_peak(&self, j: usize, torque: f32) -> f64 {
        let axis = &self.axes[j];
        let given = torque.clamp(-axis.peak, axis.peak);
        f64::from(if axis.joint.reversed { -given } else { given })
    }

    /// Returns the torque that the controller of joint `j` computes from the current of its motor,
    /// N m, positive in the controller's direction. [`torque`](Self::torque) is the true torque,
    /// which can differ.
    pub(super) fn measured_torque(&self, j: usize) -> f64 {
        let current = self.motors.as_ref().map_or(&self.asked, |motors| &motors.current)[j];
        if self.axes[j].joint.reversed { -current } else { current }
    }

    /// Sets the torque that the motor of joint `j` must give, N m. It is positive in the joint's
    /// direction and must be within the motor's peak.
    pub(super) fn ask(&mut self, j: usize, torque: f64) {
        self.asked[j] = torque;
    }

    /// Returns the encoder count of joint `j` at its true angle, which is in `truth`. The count is
    /// rounded down and wrapped to 32 bits.
    pub(super) fn count_at(&self, j: usize, truth: &Truth<'_>) -> i32 {
        self.axes[j].count(truth.angles[j], disc(&self.discs, j))
    }

    /// Returns the angle that the encoder of joint `j` reads, in turns of the encoder, rounded down
    /// to a whole encoder count. `angles` are the true joint angles, rad.
    pub(super) fn turns_at(&self, j: usize, angles: &[f64; MAX_JOINTS]) -> f64 {
        let axis = &self.axes[j];
        axis.whole_count(angles[j], disc(&self.discs, j)) as f64 / f64::from(axis.joint.counts_per_turn)
    }

    /// Returns the rate of joint `j` that its controller measures, in rad/s of the joint, positive
    /// in the controller's direction.
    pub(super) fn rate_at(&self, j: usize, truth: &Truth<'_>) -> f32 {
        self.axes[j].rate(truth.angles[j], truth.rates[j], disc(&self.discs, j))
    }

    /// Returns whether the motor of joint `j` gives less torque than commanded because it is hot.
    pub(super) fn derates(&self, j: usize) -> bool {
        self.motors.as_ref().is_some_and(|motors| motors.derates(j, &self.axes[j], self.asked[j]))
    }

    /// Returns whether a test has made joint `j` report that it is too hot.
    pub(super) fn is_hot(&self, j: usize) -> bool {
        self.axes[j].flags.contains(JointFlags::OVERTEMPERATURE)
    }

    pub(super) fn set_hot(&mut self, j: usize, on: bool) {
        if let Some(axis) = self.axes.get_mut(j) {
            axis.flags.set(JointFlags::OVERTEMPERATURE, on);
        }
    }

    pub(super) fn slip(&mut self, j: usize, angle: f64) {
        if let Some(axis) = self.axes.get_mut(j) {
            axis.slipped = angle;
        }
    }

    /// Simulates that the controllers of `joints` lose power and restart. Their torques become 0,
    /// and the encoder counts start again.
    pub(super) fn reboot(&mut self, joints: Range<usize>, angles: &[f64; MAX_JOINTS]) {
        self.asked[joints.clone()].fill(0.0);
        for j in joints.clone() {
            self.axes[j].reboot(angles[j], disc(&self.discs, j));
        }
        if let Some(motors) = &mut self.motors {
            motors.reboot(joints);
        }
    }
}

/// Returns the errors of joint `j`'s encoder, or `None` if encoders are exact.
fn disc(discs: &Option<Box<[Disc; MAX_JOINTS]>>, j: usize) -> Option<&Disc> {
    discs.as_deref().map(|discs| &discs[j])
}
