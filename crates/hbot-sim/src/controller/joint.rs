//! One joint as its motor controller sees it: the counts of its encoder, the limits of its motor.

use core::f64::consts::TAU;

use hbot_core::rig::{Joint, Zero};
use hbot_link::JointFlags;

use super::disc::Disc;

/// The kind of an encoder: which angle its count zero stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoder {
    /// Count zero is the angle at power-up. At the start of the simulation this is the angle zero.
    #[default]
    Incremental,
    /// Starts as [`Encoder::Incremental`]. When the joint first passes a whole turn, count zero
    /// moves to that index mark, and [`JointFlags::INDEX_SEEN`] is set.
    Indexed,
    /// Count zero is always the angle zero.
    Absolute,
}

/// Encoder and motor of one simulated joint, as its motor controller knows them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedJoint {
    /// Counts in one turn of the encoder, before the gear.
    pub counts_per_turn: u32,
    /// Turns of the encoder for one turn of the joint.
    pub gear: f64,
    /// Whether counts and torques of the motor controller have the opposite sign of the joint's.
    pub reversed: bool,
    /// Largest torque at the joint, N m. 0 for a joint without a motor.
    pub peak: f64,
    /// Torque that the motor can hold for ever, N m. Used only if motors heat up
    /// ([`Motor`](crate::phenomena::Motor)).
    pub continuous: f64,
    /// Kind of the encoder.
    pub encoder: Encoder,
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
                Zero::Absolute => Encoder::Absolute,
                Zero::Index => Encoder::Indexed,
                Zero::Assume | Zero::Calibrate => Encoder::Incremental,
            },
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) joint: SimulatedJoint,
    /// Peak torque of the joint as a command carries it, N m, never negative.
    pub(super) peak: f32,
    /// Counts per radian of the joint, with the motor controller's sign.
    counts_per_rad: f64,
    /// Angle that the encoder read when count zero was set, rad of the joint.
    origin: f64,
    /// Number of the turn in which the joint is. `None` after its index has been seen, or if it has
    /// no index.
    turn: Option<f64>,
    pub(super) slipped: f64,
    pub(super) flags: JointFlags,
}

impl Axis {
    /// Creates a joint that powered up at the angle zero and now stands at `angle`, rad.
    pub(super) fn new(joint: SimulatedJoint, angle: f64, disc: Option<&Disc>) -> Self {
        let sign = if joint.reversed { -1.0 } else { 1.0 };
        let mut axis = Self {
            joint,
            peak: (joint.peak as f32).max(0.0),
            counts_per_rad: sign * joint.gear * f64::from(joint.counts_per_turn) / TAU,
            origin: 0.0,
            turn: None,
            slipped: 0.0,
            flags: JointFlags::empty(),
        };
        axis.power_up(0.0, disc);
        axis.turn = (joint.encoder == Encoder::Indexed).then(|| turn_of(angle));
        axis
    }

    /// Simulates a loss of power and a restart at `angle`, rad.
    pub(super) fn reboot(&mut self, angle: f64, disc: Option<&Disc>) {
        self.flags.set(JointFlags::INDEX_SEEN | JointFlags::OVERCURRENT, false);
        self.power_up(angle, disc);
        self.turn = (self.joint.encoder == Encoder::Indexed).then(|| turn_of(angle));
    }

    fn power_up(&mut self, angle: f64, disc: Option<&Disc>) {
        self.origin = match self.joint.encoder {
            // The zero of an absolute encoder, and its error, are set when it is mounted.
            Encoder::Absolute => disc.map_or(0.0, |disc| disc.zero_off),
            Encoder::Incremental | Encoder::Indexed => self.marked(angle, disc),
        };
    }

    /// Returns the origin of the counts if the zero is taken at `angle`, rad.
    fn marked(&self, angle: f64, disc: Option<&Disc>) -> f64 {
        disc.map_or(angle, |disc| disc.reading(angle, self.joint.gear) + disc.zero_off)
    }

    /// Replaces the errors of the encoder at `angle`, rad. The count continues from its present
    /// value, and the zero is kept.
    pub(super) fn replace_disc(&mut self, angle: f64, old: Option<&Disc>, new: Option<&Disc>) {
        let reads =
            |disc: Option<&Disc>| disc.map_or(0.0, |disc| disc.error(angle + self.slipped, self.joint.gear));
        self.origin += reads(new) - reads(old);
    }

    /// Updates the encoder with a joint angle, rad, so that it notices its index mark.
    pub(super) fn sense(&mut self, angle: f64, disc: Option<&Disc>) {
        if let Some(before) = self.turn {
            let turn = turn_of(angle);
            if turn != before {
                // The mark that was passed is the upper end of the lower of the two turns.
                self.origin = self.marked(TAU * turn.max(before), disc);
                self.turn = None;
                self.flags.set(JointFlags::INDEX_SEEN, true);
            }
        }
    }

    /// Returns the count at a joint angle, rad. It is rounded down and wrapped to 32 bits.
    pub(super) fn count(&self, angle: f64, disc: Option<&Disc>) -> i32 {
        let turned = angle + self.slipped;
        let read = disc.map_or(turned, |disc| disc.reading(turned, self.joint.gear));
        let exact = (read - self.origin) * self.counts_per_rad;
        // The cast to 64 bits rounds towards zero. The cast to 32 bits keeps the low bits, which
        // wraps.
        let whole = exact as i64;
        let whole = whole - i64::from(whole as f64 > exact);
        disc.map_or(whole, |disc| disc.coarse(whole)) as i32
    }

    /// Returns the rate that the motor controller reports at a joint angle (rad) and rate, in its
    /// own sense, rad/s of the joint.
    pub(super) fn rate(&self, angle: f64, rate: f64, disc: Option<&Disc>) -> f32 {
        let rate = disc.map_or(rate, |disc| rate * disc.slope(angle + self.slipped, self.joint.gear));
        (if self.joint.reversed { -rate } else { rate }) as f32
    }
}

/// Returns the number of the turn in which an angle (rad) is.
fn turn_of(angle: f64) -> f64 {
    libm::floor(angle / TAU)
}
