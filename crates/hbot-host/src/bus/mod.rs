//! Motor buses: the seam between the loop and whatever turns the wheels.
//!
//! A driver implements two traits. [`MotorBus`] is what the loop calls in every tick: it reads and
//! writes, and never waits. [`Protocol`] is what happens outside the loop: how the controllers on a
//! serial line are met, how their motors are switched off, and what a tick costs on the line.
//! `docs/drivers.md` explains how to write one, and [`conformance`](crate::conformance) tests it.
//!
//! A bus knows neither the rig nor its geometry. It counts its joints from 0 in the order in which
//! they stand on the line; [`Layout`](crate::layout::Layout) knows which joint of the rig each one is.

pub mod hbot;
mod meet;
mod obedience;

use std::fmt;

use hbot_config::rig as config;
use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;

pub use self::meet::{Expected, ExpectedJoint, MeetError, converse, field};
pub use self::obedience::Obedience;
use crate::line::Line;

/// What one bus has received since the previous call of [`MotorBus::receive`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Heard {
    /// The newest reading. `None` where no new one has come.
    pub reading: Option<Reading>,
    /// Everything that any reading has complained of, the older ones too.
    pub complaints: Complaints,
    /// Damaged frames.
    pub damaged: u16,
    /// Whole frames from other controllers, or that answer a command that was never sent.
    pub foreign: u32,
    /// The controllers may have lost their zeros: they have lost power, or they are others.
    pub zeros_lost: bool,
    /// The line was gone and is back.
    pub reopened: bool,
}

/// What the encoders of one bus read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The tick of the command that this reading answers. If the protocol does not say which, the
    /// oldest tick that is possible: the age of a reading is then too long, never too short.
    pub answers: u32,
    /// In the order of the bus. Entries beyond the bus's joints are ignored.
    pub joints: [JointReading; MAX_JOINTS],
}

/// What the encoder of one joint reads, in the sense of its controller.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct JointReading {
    /// Counts of the encoder, `counts_per_turn` of the rig file a turn; wraps at 32 bits.
    pub count: i32,
    /// Rate of the joint after its gear, rad/s.
    pub rate: f64,
    /// The encoder has passed its index since power-on.
    pub index_seen: bool,
}

/// What the motors of one bus are to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BusCommand {
    /// The tick that this command belongs to. If the protocol can echo a number, send this one.
    pub tick: u32,
    /// Motors on.
    pub enable: bool,
    /// How long the controllers hold this command if no other follows, ms.
    pub watchdog_ms: u16,
    /// Torque of each joint in the order of the bus and in the sense of its controller, N m.
    pub torque: [f64; MAX_JOINTS],
}

/// The motors behind one serial line or one adapter, as the loop sees them.
///
/// Both calls return at once: they neither wait nor allocate. `now_ns` is the time since the start
/// of the loop: a bus has no clock of its own, so that it works in virtual time too.
pub trait MotorBus: Send {
    /// Reads what has arrived before the command of `tick` goes out.
    fn receive(&mut self, now_ns: u64, tick: u32) -> Heard;

    /// Writes a command. Returns whether the line took it whole; the rest of a command that was cut
    /// short must not spoil the next one.
    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool;

    /// Tells the bus that its motors are off and that no command follows. May wait.
    fn release(&mut self) {}
}

/// A protocol that motor controllers speak on a serial line.
pub trait Protocol: fmt::Debug + Send + Sync {
    /// Meets the controllers on a line: they are there, and they are those that the rig file
    /// describes. Their motors stay off. May wait.
    ///
    /// # Errors
    /// They do not answer, or they are not those of the rig.
    fn meet(&self, line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError>;

    /// Switches the motors off, and returns whether the controllers have lost power since
    /// [`meet`](Self::meet) asked them last. May wait.
    ///
    /// # Errors
    /// They do not answer.
    fn switch_off(&self, line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError>;

    /// The bytes that switch the motors off, whatever was written to the line before them. A helper
    /// process writes them when this program dies. At most 255.
    fn off_bytes(&self, expected: &Expected) -> Vec<u8>;

    /// The bus on a line whose controllers have been met.
    fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus>;

    /// What a tick of this number of joints costs on the line at most.
    fn traffic(&self, joints: usize) -> Traffic;
}

/// What one tick costs on a line, at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes to the controllers.
    pub commands: usize,
    /// Bytes from the controllers.
    pub feedback: usize,
    /// Time that the controllers need beyond that of the bytes, us. `rig check` adds it to the time of
    /// the feedback.
    pub turnaround_us: u32,
}

/// The driver of a protocol that a rig file may name.
#[must_use]
pub fn driver(protocol: config::Protocol) -> &'static dyn Protocol {
    match protocol {
        config::Protocol::Hbot => &hbot::HbotLink,
        other @ (config::Protocol::Moteus | config::Protocol::Odrive) => {
            unreachable!("a rig file that names {} is refused", other.name())
        }
    }
}
