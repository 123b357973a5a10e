//! The virtual motor controllers of one line: what the firmware at its far end does, in each
//! protocol that a rig file may name.
//!
//! | module | what it does |
//! |---|---|
//! | `joints` (`joint`, `disc`, `motors`) | what all protocols stand on: encoders that count, motors that push |
//! | [`hbot`] | the firmware of docs/link.md |
//! | `moteus` | moteus servos behind an fdcanusb or a UART |
//! | `odrive` | ODrives behind an adapter that speaks slcan |
//!
//! They know time in nanoseconds as they are told it, the true joint angles and rates, and the
//! bytes of their line; they know nothing of the sphere. Encoders are exact but for the floor to a
//! count, and motors give what is asked of them, unless [`phenomena`] say otherwise. A firmware is
//! one type that implements `Speaks`, and its arm in `Firmware`.

mod disc;
pub mod hbot;
mod joint;
mod joints;
mod moteus;
mod motors;
mod odrive;

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
    /// [`InjectedFault::Reboot`] of the controller of one joint. Where one controller has all joints, of
    /// that.
    RebootOne(usize),
    /// Switches the loss of all answers on or off. Commands still take effect, as if only the line
    /// back to the host were cut.
    Mute(bool),
    /// Switches the loss of all commands and answers on or off, as if the line were cut in both
    /// directions.
    Deaf(bool),
    /// Whether the controller of one joint hears and answers nothing. Where one controller has all
    /// joints, none does.
    DeafOne {
        /// Which joint.
        joint: usize,
        /// Whether it is.
        on: bool,
    },
    /// Whether the controllers report a fault of their own and give no torque.
    Failed(bool),
    /// [`InjectedFault::Failed`] of the controller of one joint. Where one controller has all joints, of
    /// that.
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
    Moteus(Box<moteus::Moteus>),
    Odrive(Box<odrive::Odrive>),
}

impl Firmware {
    fn new(line: Line, joints: &Joints, angles: &[f64; MAX_JOINTS]) -> Option<Self> {
        let first_id = line.protocol.ids().map_or(0, |ids| *ids.start() as u8);
        match line.protocol {
            Protocol::Hbot => Some(Self::Hbot(Box::new(hbot::Hbot::new()))),
            Protocol::Moteus => {
                let servos = moteus::Moteus::new(first_id, line.checksums, joints, angles);
                Some(Self::Moteus(Box::new(servos)))
            }
            Protocol::Odrive => Some(Self::Odrive(Box::new(odrive::Odrive::new(joints)))),
        }
    }

    fn speaks(&self) -> &dyn Speaks {
        match self {
            Self::Hbot(it) => it.as_ref(),
            Self::Moteus(it) => it.as_ref(),
            Self::Odrive(it) => it.as_ref(),
        }
    }

    fn speaks_mut(&mut self) -> &mut dyn Speaks {
        match self {
            Self::Hbot(it) => it.as_mut(),
            Self::Moteus(it) => it.as_mut(),
            Self::Odrive(it) => it.as_mut(),
        }
    }
}

/// What controllers speak, and through what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line {
    /// What they speak.
    pub protocol: Protocol,
    /// Whether a moteus line has checksums: it is a UART, not an fdcanusb. Without meaning for
    /// others.
    pub checksums: bool,
}

impl From<Protocol> for Line {
    fn from(protocol: Protocol) -> Self {
        Self { protocol, checksums: true }
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
        line: Line,
        specs: &[SimulatedJoint],
        angles: &[f64; MAX_JOINTS],
        encoder: Option<&phenomena::Encoder>,
    ) -> Option<Self> {
        let joints = Joints::new(specs, angles, encoder);
        let firmware = Firmware::new(line, &joints, angles)?;
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

    /// Has them do what is due by themselves at `now_ns`; what they say unasked is appended to
    /// `reply`.
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

    /// Takes in bytes of the line at `now_ns`, with the truth of that instant, and appends the
    /// answers to `reply`.
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

    /// Sets a setting of the controller of one joint by the vendor's name, such as
    /// `servo.timeout_mode` of a moteus. False where there is none of this name.
    pub fn set(&mut self, joint: usize, name: &str, value: f64) -> bool {
        match &mut self.firmware {
            Firmware::Hbot(_) => false,
            Firmware::Odrive(axes) => axes.set(joint, name, value),
            Firmware::Moteus(servos) => servos.set(joint, name, value),
        }
    }

    /// Gives the controller of one joint another id on the bus, as a builder does by mistake.
    pub fn set_id(&mut self, joint: usize, id: u8) {
        match &mut self.firmware {
            Firmware::Hbot(_) => {}
            Firmware::Odrive(axes) => axes.set_id(joint, id),
            Firmware::Moteus(servos) => servos.set_id(joint, id),
        }
    }

    /// How many frames were refused since power-up: damaged, or of no meaning.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.firmware.speaks().refused()
    }
}
