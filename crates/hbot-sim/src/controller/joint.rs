//! One joint as its controller has it: its encoder's counts, its motor's limits.

use core::f64::consts::TAU;

use hbot_core::rig::{Joint, Zero};
use hbot_link::JointFlags;

use super::disc::Disc;

/// What the zero of a joint's counts is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EncoderKind {
    /// Where the joint stood when the controller powered up; at the start of the simulation the angle zero.
    #[default]
    Incremental,
    /// As [`EncoderKind::Incremental`] until the joint passes a whole turn; from then on that mark, and
    /// [`JointFlags::INDEX_SEEN`] is set.
    Indexed,
    /// The angle zero, always.
    Absolute,
}

/// One joint as its controller has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedJoint {
    /// Counts in one turn of the encoder, before the gear.
    pub counts_per_turn: u32,
    /// Turns of the encoder for one turn of the joint.
    pub gear: f64,
    /// Whether the controller counts (and pushes) against the joint's positive sense.
    pub reversed: bool,
    /// The largest torque at the joint, N m; 0 where it has no motor.
    pub peak: f64,
    /// The torque that the motor holds for ever, N m. Without meaning unless motors get hot
    /// ([`Motor`](crate::phenomena::Motor)).
    pub continuous: f64,
    /// What the zero of its counts is.
    pub encoder: EncoderKind,
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
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) joint: SimulatedJoint,
    /// The joint's peak torque as the line would carry it, N m, never negative.
    pub(super) peak: f32,
    /// Counts a radian of the joint, with the controller's sign.
    counts_per_rad: f64,
    /// What the encoder read at count zero, rad of the joint.
    origin: f64,
    /// Which turn the joint is in, where its index has not been seen yet.
    turn: Option<f64>,
    pub(super) slipped: f64,
    pub(super) flags: JointFlags,
}

impl Axis {
    /// A joint that has just powered up at the angle zero; `angle` is where it is, rad.
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
        axis.turn = (joint.encoder == EncoderKind::Indexed).then(|| turn_of(angle));
        axis
    }

    /// Power lost and back at an angle, rad.
    pub(super) fn reboot(&mut self, angle: f64, disc: Option<&Disc>) {
        self.flags.set(JointFlags::INDEX_SEEN | JointFlags::OVERCURRENT, false);
        self.power_up(angle, disc);
        self.turn = (self.joint.encoder == EncoderKind::Indexed).then(|| turn_of(angle));
    }

    fn power_up(&mut self, angle: f64, disc: Option<&Disc>) {
        self.origin = match self.joint.encoder {
            // The zero of an absolute encoder is where it was mounted, and its error is that of the mounting.
            EncoderKind::Absolute => disc.map_or(0.0, |disc| disc.zero_off),
            EncoderKind::Incremental | EncoderKind::Indexed => self.marked(angle, disc),
        };
    }

    /// What count zero is where it is taken at an angle, rad.
    fn marked(&self, angle: f64, disc: Option<&Disc>) -> f64 {
        disc.map_or(angle, |disc| disc.reading(angle, self.joint.gear) + disc.zero_off)
    }

    /// Has the encoder's errors replaced at an angle, rad. The count goes on from where it is: a zero once taken stays.
    pub(super) fn replace_disc(&mut self, angle: f64, old: Option<&Disc>, new: Option<&Disc>) {
        let reads =
            |disc: Option<&Disc>| disc.map_or(0.0, |disc| disc.error(angle + self.slipped, self.joint.gear));
        self.origin += reads(new) - reads(old);
    }

    /// Lets the encoder see a joint angle, rad.
    pub(super) fn sense(&mut self, angle: f64, disc: Option<&Disc>) {
        if let Some(before) = self.turn {
            let turn = turn_of(angle);
            if turn != before {
                // The mark passed is the upper end of the lower turn.
                self.origin = self.marked(TAU * turn.max(before), disc);
                self.turn = None;
                self.flags.set(JointFlags::INDEX_SEEN, true);
            }
        }
    }

    /// The count at a joint angle, rad: floor, wrapped to 32 bits.
    pub(super) fn count(&self, angle: f64, disc: Option<&Disc>) -> i32 {
        let turned = angle + self.slipped;
        let read = disc.map_or(turned, |disc| disc.reading(turned, self.joint.gear));
        let exact = (read - self.origin) * self.counts_per_rad;
        // The cast to 64 bits is towards zero; the one to 32 keeps the low bits, which is the wrap.
        let whole = exact as i64;
        let whole = whole - i64::from(whole as f64 > exact);
        disc.map_or(whole, |disc| disc.coarse(whole)) as i32
    }

    /// The rate in the controller's sense, rad/s of the joint, at a joint angle and rate.
    pub(super) fn rate(&self, angle: f64, rate: f64, disc: Option<&Disc>) -> f32 {
        let rate = disc.map_or(rate, |disc| rate * disc.slope(angle + self.slipped, self.joint.gear));
        (if self.joint.reversed { -rate } else { rate }) as f32
    }
}

/// Which turn an angle, rad, is in.
fn turn_of(angle: f64) -> f64 {
    libm::floor(angle / TAU)
}
