//! The virtual motor controllers of one port: what the firmware at the far end of a serial line does.
//!
//! They know time in nanoseconds as they are told it, the true joint angles and rates, and the messages of
//! `hbot-link`; they know nothing of the sphere. Encoders are exact but for the floor to a count.

use core::f64::consts::TAU;

use hbot_core::device::MAX_JOINTS;
use hbot_core::rig::{Joint, Zero};
use hbot_link::{
    Command, ControllerFlags, Description, Feedback, JointDescription, JointFlags, JointReading,
    PROTOCOL_VERSION,
};

use crate::plant::JointTorques;

/// What the motors' sensors read, degrees Celsius.
const TEMPERATURE: f32 = 25.0;

/// What its [`Description`] calls the firmware.
pub const FIRMWARE: &str = concat!("hbot-sim ", env!("CARGO_PKG_VERSION"));

/// What the zero of a joint's counts is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoder {
    /// Where the joint stood when the controller powered up; at the start of the simulation the angle zero.
    #[default]
    Incremental,
    /// As [`Encoder::Incremental`] until the joint passes a whole turn; from then on that mark, and
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
    /// What the zero of its counts is.
    pub encoder: Encoder,
}

impl From<&Joint> for SimulatedJoint {
    fn from(joint: &Joint) -> Self {
        Self {
            counts_per_turn: joint.counts_per_turn,
            gear: joint.gear,
            reversed: joint.reversed,
            peak: joint.peak,
            encoder: match joint.zero {
                Zero::Absolute => Encoder::Absolute,
                Zero::Index => Encoder::Indexed,
                Zero::Assume | Zero::Calibrate => Encoder::Incremental,
            },
        }
    }
}

/// Trouble to make, or to end. Joints are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Power lost and back: torque zero, undescribed, counts anew (an absolute encoder's stay), watchdog forgotten.
    /// What [`Fault`]s are on stays on.
    Reboot,
    /// Whether commands still act but nothing is answered: the line back is cut.
    Mute(bool),
    /// Whether nothing is heard or answered: the line is cut both ways.
    Deaf(bool),
    /// Whether the controller reports [`ControllerFlags::FAULT`] and gives no torque.
    Failed(bool),
    /// Whether a joint reports [`JointFlags::OVERTEMPERATURE`]; torque goes on.
    Hot {
        /// Which joint.
        joint: usize,
        /// Whether it is.
        on: bool,
    },
    /// How far the encoder of a joint has slipped, rad of the joint in its positive sense, from the truth.
    Slipped {
        /// Which joint.
        joint: usize,
        /// By how much, rad.
        angle: f64,
    },
}

/// The controllers of one port, for all joints.
#[derive(Debug, Clone)]
pub struct Controllers {
    joints: usize,
    axes: [Axis; MAX_JOINTS],
    /// Commanded and clamped, joint's sense, N m.
    torque: JointTorques,
    enabled: bool,
    expired: bool,
    described: bool,
    /// When the last valid command runs out, ns; none since power-up: `None`.
    deadline: Option<u64>,
    mute: bool,
    deaf: bool,
    failed: bool,
}

#[derive(Debug, Clone, Copy)]
struct Axis {
    joint: SimulatedJoint,
    /// The joint's peak torque as the line would carry it, N m, never negative.
    peak: f32,
    /// Counts a radian of the joint, with the controller's sign.
    counts_per_rad: f64,
    /// Where the joint stood at count zero, rad.
    origin: f64,
    /// Which turn the joint is in, where its index has not been seen yet.
    turn: Option<f64>,
    slipped: f64,
    flags: JointFlags,
}

impl Controllers {
    /// Controllers that have just powered up with all joints of `specs` (at most [`MAX_JOINTS`] are taken) at the angle
    /// zero; `angles` is where they are, rad.
    #[must_use]
    pub fn new(specs: &[SimulatedJoint], angles: &[f64; MAX_JOINTS]) -> Self {
        let none = SimulatedJoint {
            counts_per_turn: 1,
            gear: 1.0,
            reversed: false,
            peak: 0.0,
            encoder: Encoder::Incremental,
        };
        let axes = core::array::from_fn(|j| {
            let joint = specs.get(j).copied().unwrap_or(none);
            let sign = if joint.reversed { -1.0 } else { 1.0 };
            Axis {
                joint,
                peak: (joint.peak as f32).max(0.0),
                counts_per_rad: sign * joint.gear * f64::from(joint.counts_per_turn) / TAU,
                origin: 0.0,
                turn: (joint.encoder == Encoder::Indexed).then(|| turn_of(angles[j])),
                slipped: 0.0,
                flags: JointFlags::empty(),
            }
        });
        Self {
            joints: specs.len().min(MAX_JOINTS),
            axes,
            torque: [0.0; MAX_JOINTS],
            enabled: false,
            expired: false,
            described: false,
            deadline: None,
            mute: false,
            deaf: false,
            failed: false,
        }
    }

    /// The torques that act at the joints, in the joints' own sense, N m.
    #[must_use]
    pub fn torque(&self) -> &JointTorques {
        const NONE: JointTorques = [0.0; MAX_JOINTS];
        if self.gives_torque() { &self.torque } else { &NONE }
    }

    /// When the watchdog expires if nothing is heard before, ns; `None` where it has, or never was fed.
    #[must_use]
    pub fn deadline(&self) -> Option<u64> {
        self.deadline.filter(|_| !self.expired)
    }

    /// Lets the watchdog see the time `now_ns`.
    pub fn watch(&mut self, now_ns: u64) {
        if self.deadline.is_some_and(|deadline| now_ns >= deadline) {
            self.expired = true;
        }
    }

    /// Lets the encoders see the joint angles, rad, so that an index passed is not missed.
    pub fn sense(&mut self, angles: &[f64; MAX_JOINTS]) {
        for (axis, angle) in self.axes[..self.joints].iter_mut().zip(angles) {
            if let Some(before) = axis.turn {
                let turn = turn_of(*angle);
                if turn != before {
                    // The mark passed is the upper end of the lower turn.
                    axis.origin = TAU * turn.max(before);
                    axis.turn = None;
                    axis.flags.set(JointFlags::INDEX_SEEN, true);
                }
            }
        }
    }

    /// Answers [`hbot_link::ToController::Describe`].
    pub fn describe(&mut self) -> Option<Description> {
        if self.deaf {
            return None;
        }
        self.described = true;
        let joint = |axis: &Axis| JointDescription { counts_per_turn: axis.joint.counts_per_turn };
        (!self.mute).then(|| Description {
            protocol: PROTOCOL_VERSION,
            firmware: FIRMWARE.try_into().unwrap_or_default(),
            joints: self.axes[..self.joints].iter().map(joint).collect(),
        })
    }

    /// Takes a command in at `now_ns`, with the true joint angles (rad) and rates (rad/s) of that instant, and
    /// answers it. A command that is not valid is not answered and changes nothing.
    pub fn command(
        &mut self,
        now_ns: u64,
        command: &Command,
        angles: &[f64; MAX_JOINTS],
        rates: &[f64; MAX_JOINTS],
    ) -> Option<Feedback> {
        let valid = command.torque.len() == self.joints && command.torque.iter().all(|t| t.is_finite());
        if self.deaf || !valid {
            return None;
        }
        self.watch(now_ns);
        if !command.enable {
            self.expired = false;
        }
        self.enabled = command.enable;
        self.deadline = Some(now_ns.saturating_add(u64::from(command.watchdog_ms) * 1_000_000));
        self.watch(now_ns);
        for ((axis, torque), asked) in self.axes.iter_mut().zip(&mut self.torque).zip(&command.torque) {
            let given = asked.clamp(-axis.peak, axis.peak);
            axis.flags.set(JointFlags::OVERCURRENT, command.enable && given != *asked);
            *torque = f64::from(if axis.joint.reversed { -given } else { given });
        }
        (!self.mute).then(|| self.feedback(command.sequence, angles, rates))
    }

    /// Makes trouble, or ends it, at the joint angles `angles`, rad. A joint that does not exist is ignored.
    pub fn inject(&mut self, fault: Fault, angles: &[f64; MAX_JOINTS]) {
        match fault {
            Fault::Reboot => self.reboot(angles),
            Fault::Mute(on) => self.mute = on,
            Fault::Deaf(on) => self.deaf = on,
            Fault::Failed(on) => self.failed = on,
            Fault::Hot { joint, on } => {
                if let Some(axis) = self.axes.get_mut(joint) {
                    axis.flags.set(JointFlags::OVERTEMPERATURE, on);
                }
            }
            Fault::Slipped { joint, angle } => {
                if let Some(axis) = self.axes.get_mut(joint) {
                    axis.slipped = angle;
                }
            }
        }
    }

    fn reboot(&mut self, angles: &[f64; MAX_JOINTS]) {
        self.torque = [0.0; MAX_JOINTS];
        (self.enabled, self.expired, self.described, self.deadline) = (false, false, false, None);
        for (axis, angle) in self.axes.iter_mut().zip(angles) {
            axis.flags.set(JointFlags::INDEX_SEEN | JointFlags::OVERCURRENT, false);
            if axis.joint.encoder != Encoder::Absolute {
                axis.origin = *angle;
            }
            axis.turn = (axis.joint.encoder == Encoder::Indexed).then(|| turn_of(*angle));
        }
    }

    fn gives_torque(&self) -> bool {
        self.enabled && !self.expired && !self.failed
    }

    fn feedback(&self, sequence: u32, angles: &[f64; MAX_JOINTS], rates: &[f64; MAX_JOINTS]) -> Feedback {
        let mut flags = ControllerFlags::empty();
        flags.set(ControllerFlags::ENABLED, self.gives_torque());
        flags.set(ControllerFlags::WATCHDOG_EXPIRED, self.expired);
        flags.set(ControllerFlags::FAULT, self.failed);
        flags.set(ControllerFlags::UNDESCRIBED, !self.described);
        let reading = |((axis, angle), rate): ((&Axis, &f64), &f64)| JointReading {
            count: axis.count(*angle),
            rate: if axis.joint.reversed { -*rate } else { *rate } as f32,
            current: 0.0,
            temperature: TEMPERATURE,
            flags: axis.flags,
        };
        let joints = self.axes[..self.joints].iter().zip(angles).zip(rates).map(reading).collect();
        Feedback { sequence, flags, joints }
    }
}

impl Axis {
    /// The count at a joint angle, rad: floor, wrapped to 32 bits.
    fn count(&self, angle: f64) -> i32 {
        let exact = (angle + self.slipped - self.origin) * self.counts_per_rad;
        // The cast to 64 bits is towards zero; the one to 32 keeps the low bits, which is the wrap.
        let whole = exact as i64;
        (whole - i64::from(whole as f64 > exact)) as i32
    }
}

/// Which turn an angle, rad, is in.
fn turn_of(angle: f64) -> f64 {
    libm::floor(angle / TAU)
}
