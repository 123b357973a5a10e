//! The simulated motor controllers of one port. They do what the firmware at the far end of a
//! serial line does.
//!
//! Their inputs are the time in nanoseconds, the true joint angles and rates, and the messages of
//! `hbot-link`. They know nothing of the sphere. Unless [`phenomena`] change it, encoders are exact
//! except for rounding down to a whole count, and motors give exactly the commanded torque.

mod disc;
pub mod hbot;
mod joint;
mod joints;
mod motors;

use hbot_config::rig::Protocol;
use hbot_core::device::MAX_JOINTS;

pub use self::hbot::FIRMWARE;
pub use self::joint::{EncoderKind, SimulatedJoint};
use self::joints::Joints;
pub use self::joints::Truth;
use crate::phenomena;
use crate::plant::JointTorques;

/// A fault that a test or a user can switch on or off in the simulated motor controllers. Joints
/// are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InjectedFault {
    /// Power is lost and returns. The torque is zero, the watchdog is cleared, and
    /// `UNDESCRIBED` is set. Counts restart, except those of absolute encoders.
    /// Other [`InjectedFault`]s stay active.
    Reboot,
    /// [`InjectedFault::Reboot`] of the controller of one joint. Where one controller has all joints, of that.
    RebootOne(usize),
    /// Switches the loss of all answers on or off. Commands still take effect, as if only the line
    /// back to the host were cut.
    Mute(bool),
    /// Switches the loss of all commands and answers on or off, as if the line were cut in both
    /// directions.
    Deaf(bool),
    /// Whether the controller of one joint hears and answers nothing. Where one controller has all joints, none does.
    DeafOne {
        /// Which joint.
        joint: usize,
        /// Whether it is.
        on: bool,
    },
    /// Whether the controllers report a fault of their own and give no torque.
    Failed(bool),
    /// [`InjectedFault::Failed`] of the controller of one joint. Where one controller has all joints, of that.
    FailedOne {
        /// Which joint.
        joint: usize,
        /// Whether it has.
        on: bool,
    },
    /// Whether a joint reports that it is too hot; torque goes on.
    Hot {
        /// Index of the joint.
        joint: usize,
        /// Whether the joint reports overtemperature.
        on: bool,
    },
    /// Simulates an encoder that has slipped on its shaft: its angle gets a constant error.
    Slipped {
        /// Index of the joint.
        joint: usize,
        /// Encoder angle minus true angle, in rad of the joint in its positive direction.
        angle: f64,
    },
}

/// What firmware does, whatever it speaks.
trait Speaks {
    /// Takes in `bytes` at `now_ns` and appends its answers to `reply`.
    fn hear(
        &mut self,
        now_ns: u64,
        bytes: &[u8],
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    );

    /// When it next does something by itself, ns: a watchdog expires, or it speaks unasked.
    fn next_ns(&self) -> Option<u64>;

    /// When it next speaks unasked, ns. At that time [`next_ns`](Self::next_ns) is due.
    fn next_word_ns(&self) -> Option<u64> {
        None
    }

    /// Does what is due by itself at `now_ns`. What it says unasked is appended to `reply`.
    fn pass(&mut self, now_ns: u64, joints: &mut Joints, truth: &Truth<'_>, reply: &mut Vec<u8>);

    /// Makes trouble, or ends it, at the joint angles `angles`, rad.
    fn inject(&mut self, fault: InjectedFault, joints: &mut Joints, angles: &[f64; MAX_JOINTS]);

    /// How many frames were refused since power-up: damaged, or of no meaning.
    fn refused(&self) -> u64;
}

/// The firmware of one line.
#[derive(Debug, Clone)]
enum Firmware {
    Hbot(Box<hbot::Hbot>),
}

impl Firmware {
    fn new(protocol: Protocol, _joints: usize) -> Option<Self> {
        match protocol {
            Protocol::Hbot => Some(Self::Hbot(Box::new(hbot::Hbot::new()))),
            Protocol::Moteus | Protocol::Odrive => None,
        }
    }

    fn speaks(&self) -> &dyn Speaks {
        match self {
            Self::Hbot(it) => it.as_ref(),
        }
    }

    fn speaks_mut(&mut self) -> &mut dyn Speaks {
        match self {
            Self::Hbot(it) => it.as_mut(),
        }
    }
}

/// The byte that ends a frame of `protocol` on a serial line.
#[must_use]
pub const fn frame_end(protocol: Protocol) -> u8 {
    match protocol {
        Protocol::Hbot => 0,
        Protocol::Moteus => b'\n',
        Protocol::Odrive => b'\r',
    }
}

/// The controllers of one line, for all joints.
#[derive(Debug, Clone)]
pub struct SimulatedControllers {
    joints: Joints,
    firmware: Firmware,
    mute: bool,
    deaf: bool,
}

impl SimulatedControllers {
    /// Creates motor controllers that have just powered up.
    ///
    /// Encoder counts start as if all joints were at the angle zero; `angles` are the true angles,
    /// rad. At most [`MAX_JOINTS`] of `specs` are used. `encoder` gives the errors of the encoders,
    /// or `None` for exact encoders.
    #[must_use]
    pub fn new(
        protocol: Protocol,
        specs: &[SimulatedJoint],
        angles: &[f64; MAX_JOINTS],
        encoder: Option<&phenomena::Encoder>,
    ) -> Option<Self> {
        let joints = Joints::new(specs, angles, encoder);
        let firmware = Firmware::new(protocol, joints.count())?;
        Some(Self { joints, firmware, mute: false, deaf: false })
    }

    /// Replaces the errors of the encoders while the joints are at `angles`, rad.
    ///
    /// Encoder counts continue from their present values. A zero that was already set is kept until
    /// it is set again.
    pub fn set_encoder(&mut self, encoder: Option<&phenomena::Encoder>, angles: &[f64; MAX_JOINTS]) {
        self.joints.set_encoder(encoder, angles);
    }

    /// Replaces the parameters of the motors. `None` makes the motors ideal.
    ///
    /// Motors that were ideal before this call start cold, with their present torque. Other motors
    /// keep their current and heat.
    pub fn set_motor(&mut self, motor: Option<phenomena::Motor>) {
        self.joints.set_motor(motor);
    }

    /// Returns the torques that act at the joints now, in N m. A positive torque acts in the
    /// joint's positive direction.
    #[must_use]
    pub fn torque(&self) -> &JointTorques {
        self.joints.torque()
    }

    /// Advances the motors by `h` seconds and returns the torques to apply during that time, N m.
    ///
    /// For motors with a lag these are mean torques over that time. `rates` returns the joint rates
    /// at its start, rad/s. It is called only if the motors are not ideal.
    pub fn drive(&mut self, h: f64, rates: impl FnOnce() -> [f64; MAX_JOINTS]) -> JointTorques {
        self.joints.drive(h, rates)
    }

    /// When they next do something by themselves, ns: a watchdog expires, or one speaks unasked.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.firmware.speaks().next_ns()
    }

    /// When one of them next speaks unasked, ns.
    #[must_use]
    pub fn next_word_ns(&self) -> Option<u64> {
        self.firmware.speaks().next_word_ns()
    }

    /// Has them do what is due by themselves at `now_ns`; what they say unasked is appended to `reply`.
    pub fn pass(&mut self, now_ns: u64, truth: &Truth<'_>, reply: &mut Vec<u8>) {
        let before = reply.len();
        self.firmware.speaks_mut().pass(now_ns, &mut self.joints, truth, reply);
        if self.mute || self.deaf {
            reply.truncate(before);
        }
    }

    /// Updates the encoders with the present joint angles, rad, so that a passed index mark is
    /// detected.
    pub fn sense(&mut self, angles: &[f64; MAX_JOINTS]) {
        self.joints.sense(angles);
    }

    /// Takes in bytes of the line at `now_ns`, with the truth of that instant, and appends the answers to `reply`.
    pub fn hear(&mut self, now_ns: u64, bytes: &[u8], truth: &Truth<'_>, reply: &mut Vec<u8>) {
        if self.deaf {
            return;
        }
        let before = reply.len();
        self.firmware.speaks_mut().hear(now_ns, bytes, &mut self.joints, truth, reply);
        if self.mute {
            reply.truncate(before);
        }
    }

    /// Switches a fault on or off. `angles` are the true joint angles, rad. A fault of a joint that
    /// does not exist is ignored.
    pub fn inject(&mut self, fault: InjectedFault, angles: &[f64; MAX_JOINTS]) {
        match fault {
            InjectedFault::Mute(on) => self.mute = on,
            InjectedFault::Deaf(on) => self.deaf = on,
            InjectedFault::Hot { joint, on } => self.joints.set_hot(joint, on),
            InjectedFault::Slipped { joint, angle } => self.joints.slip(joint, angle),
            InjectedFault::Reboot
            | InjectedFault::RebootOne(_)
            | InjectedFault::DeafOne { .. }
            | InjectedFault::Failed(_)
            | InjectedFault::FailedOne { .. } => {
                self.firmware.speaks_mut().inject(fault, &mut self.joints, angles);
            }
        }
    }

    /// How many frames were refused since power-up: damaged, or of no meaning.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.firmware.speaks().refused()
    }
}
