//! One joint as its motor controller sees it: the counts of its encoder, the limits of its motor.

use core::f64::consts::TAU;

use hbot_core::design::rig::{Joint, Zero};
use hbot_link::JointFlags;

use super::disc::Disc;
use super::filter::EncoderFilter;

/// The kind of an encoder. It determines at which joint angle the encoder reads zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EncoderKind {
    /// The encoder reads zero at the angle at which it powered up. At the start of the simulation
    /// this is the angle zero.
    #[default]
    Incremental,
    /// The encoder has one index mark per turn of the joint. It starts as
    /// [`EncoderKind::Incremental`]. When the joint first passes an index mark, the zero moves to
    /// that mark, and [`JointFlags::INDEX_SEEN`] is set.
    Indexed,
    /// The encoder always reads zero at the joint angle zero.
    Absolute,
}

/// Properties of the encoder and the motor of one simulated joint, as its motor controller sees
/// them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedJoint {
    /// Encoder counts in one turn of the encoder's shaft. The joint turns slower by the gear ratio.
    pub counts_per_turn: u32,
    /// Gear ratio: turns of the encoder for one turn of the joint.
    pub gear: f64,
    /// Whether the motor controller measures angles and torques in the opposite direction to the
    /// joint.
    pub reversed: bool,
    /// Largest torque that the motor gives at the joint, N m. It is 0 for a joint without a motor.
    pub peak: f64,
    /// Torque that the motor can hold indefinitely without overheating, N m. It is used only if the
    /// phenomenon [`Motor`](crate::phenomena::Motor) makes motors heat up.
    pub continuous: f64,
    /// Kind of the encoder, which decides where it reads zero.
    pub encoder: EncoderKind,
    /// Joint angle at which the encoder reads zero, rad: of an absolute encoder, of an index mark,
    /// and of an incremental encoder at the start of the simulation.
    pub zero: f64,
}

impl From<&Joint> for SimulatedJoint {
    fn from(joint: &Joint) -> Self {
        Self {
            counts_per_turn: joint.counts_per_turn,
            gear: joint.gear,
            reversed: joint.reversed,
            peak: joint.peak,
            continuous: joint.continuous,
            encoder: match joint.zero {
                Zero::Absolute => EncoderKind::Absolute,
                Zero::Index => EncoderKind::Indexed,
                Zero::Assume | Zero::Calibrate => EncoderKind::Incremental,
            },
            zero: 0.0,
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) joint: SimulatedJoint,
    /// Peak torque of the joint, N m, in the single precision of the commands. It is never
    /// negative.
    pub(super) peak: f32,
    /// Encoder counts per radian of the joint. Negative if the motor controller counts up while the
    /// joint turns in its negative direction.
    counts_per_rad: f64,
    /// Angle that the encoder read when its zero was set, in rad of the joint.
    origin: f64,
    /// Number of the turn that the joint is in, used to detect the index mark between two turns.
    /// `None` after the mark has been passed, or if the encoder has no index.
    turn: Option<f64>,
    pub(super) slipped: f64,
    /// The filter of the motor controller, if it has one. Its angles are those of the joint.
    pub(super) filter: Option<EncoderFilter>,
    pub(super) flags: JointFlags,
}

impl Axis {
    /// Creates a joint with the true angle `angle`, rad. The encoder powered up while the joint was
    /// at the angle at which it reads zero.
    pub(super) fn new(joint: SimulatedJoint, angle: f64, disc: Option<&Disc>) -> Self {
        let sign = if joint.reversed { -1.0 } else { 1.0 };
        let mut axis = Self {
            joint,
            peak: (joint.peak as f32).max(0.0),
            counts_per_rad: sign * joint.gear * f64::from(joint.counts_per_turn) / TAU,
            origin: 0.0,
            turn: None,
            slipped: 0.0,
            filter: None,
            flags: JointFlags::empty(),
        };
        axis.power_up(joint.zero, disc);
        axis.turn = (joint.encoder == EncoderKind::Indexed).then(|| axis.turn_of(angle));
        axis
    }

    /// Simulates that the motor controller loses power and restarts while the joint is at `angle`,
    /// rad.
    pub(super) fn reboot(&mut self, angle: f64, disc: Option<&Disc>) {
        self.flags.set(JointFlags::INDEX_SEEN, false);
        if let Some(filter) = &mut self.filter {
            filter.settle();
        }
        self.power_up(angle, disc);
        self.turn = (self.joint.encoder == EncoderKind::Indexed).then(|| self.turn_of(angle));
    }

    /// Returns the number of the turn, counted from index mark to index mark, that contains `angle`
    /// (rad). Turn 0 begins at the angle zero of the encoder.
    fn turn_of(&self, angle: f64) -> f64 {
        libm::floor((angle - self.joint.zero) / TAU)
    }

    fn power_up(&mut self, angle: f64, disc: Option<&Disc>) {
        self.origin = match self.joint.encoder {
            // The zero of an absolute encoder, and its error, are set when it is mounted.
            EncoderKind::Absolute => self.joint.zero + disc.map_or(0.0, |disc| disc.zero_off),
            EncoderKind::Incremental | EncoderKind::Indexed => self.marked(angle, disc),
        };
    }

    /// Returns the value of `origin` with which the encoder reads zero while the joint is at
    /// `angle`, rad. The error of the encoder's zero is included.
    fn marked(&self, angle: f64, disc: Option<&Disc>) -> f64 {
        disc.map_or(angle, |disc| disc.reading(angle, self.joint.gear) + disc.zero_off)
    }

    /// Replaces the encoder's errors `old` by `new` while the joint is at `angle`, rad. The encoder
    /// count does not jump, and the zero is kept.
    pub(super) fn replace_disc(&mut self, angle: f64, old: Option<&Disc>, new: Option<&Disc>) {
        let reads =
            |disc: Option<&Disc>| disc.map_or(0.0, |disc| disc.error(angle + self.slipped, self.joint.gear));
        self.origin += reads(new) - reads(old);
    }

    /// Informs the encoder of the joint's present angle, rad, so that it detects when the joint
    /// passes an index mark.
    pub(super) fn sense(&mut self, angle: f64, disc: Option<&Disc>) {
        if let Some(before) = self.turn {
            let turn = self.turn_of(angle);
            if turn != before {
                // The mark that was passed is the upper end of the lower of the two turns.
                self.origin = self.marked(self.joint.zero + TAU * turn.max(before), disc);
                self.turn = None;
                self.flags.set(JointFlags::INDEX_SEEN, true);
            }
        }
    }

    /// Returns the encoder count at a joint angle, rad. It is rounded down and wrapped to 32 bits.
    pub(super) fn count(&self, angle: f64, disc: Option<&Disc>) -> i32 {
        self.whole_count(angle, disc) as i32
    }

    /// Returns the encoder count at a joint angle, rad, rounded down and not wrapped.
    pub(super) fn whole_count(&self, angle: f64, disc: Option<&Disc>) -> i64 {
        let turned = angle + self.slipped;
        let read = disc.map_or(turned, |disc| disc.reading(turned, self.joint.gear));
        let behind = self.filter.map_or(0.0, |filter| filter.angle_behind());
        let exact = (read - behind - self.origin) * self.counts_per_rad;
        // The cast to 64 bits rounds towards zero. The cast to 32 bits keeps the low bits, which
        // wraps.
        let whole = exact as i64;
        let whole = whole - i64::from(whole as f64 > exact);
        disc.map_or(whole, |disc| disc.coarse(whole))
    }

    /// Returns the rate of the angle that the encoder reads, rad/s of the joint.
    pub(super) fn read_rate(&self, angle: f64, rate: f64, disc: Option<&Disc>) -> f64 {
        disc.map_or(rate, |disc| rate * disc.slope(angle + self.slipped, self.joint.gear))
    }

    /// Returns the rate that the motor controller reports for a joint, in rad/s of the joint. It is
    /// positive in the direction in which the controller counts up. `angle` (rad) and `rate`
    /// (rad/s) are the joint's true values.
    pub(super) fn rate(&self, angle: f64, rate: f64, disc: Option<&Disc>) -> f32 {
        let rate = self.read_rate(angle, rate, disc) - self.filter.map_or(0.0, |filter| filter.rate_behind());
        (if self.joint.reversed { -rate } else { rate }) as f32
    }
}
