//! Motor buses: the interface between the control loop and the motor controllers.
//!
//! A driver implements two traits. [`MotorBus`] is called by the loop in every tick: it reads and
//! writes, and never waits. [`Protocol`] is used outside the loop: it identifies the controllers on
//! a serial line, switches their motors off, and states how much traffic a tick causes.
//! `docs/drivers.md` explains how to write a driver, and [`conformance`]
//! tests it.
//!
//! A bus knows neither the rig nor its geometry. It counts its joints from 0 in the order in which
//! they stand on the line; [`Layout`](crate::rig::layout::Layout) knows which joint of the rig each
//! one is.

mod can;
pub mod conformance;
pub mod drivers;
mod filtering;
mod meet;
mod obedience;
mod telemetry;

use std::fmt;

use hbot_config::rig as config;
use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;

pub use self::filtering::{Filtering, Lag, each_once, filtering_warnings, late_rates};
pub use self::meet::{Expected, ExpectedJoint, Found, MeetError, Remedy, converse, field};
pub use self::obedience::Obedience;
pub use self::telemetry::{Telemetry, TelemetryLog};
use crate::line::Line;

/// Everything that one bus has received since the previous call of [`MotorBus::receive`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Heard {
    /// The newest reading, or `None` if no new reading has arrived.
    pub reading: Option<Reading>,
    /// All complaints of the readings received, including those of older readings.
    pub complaints: Complaints,
    /// Number of damaged frames received.
    pub damaged: u16,
    /// Number of intact frames that came from other controllers or answer a command that was never
    /// sent.
    pub foreign: u32,
    /// True if the controllers may have lost their zeros, because they lost power or were replaced.
    pub zeros_lost: bool,
    /// True if the line was lost and has been reopened.
    pub reopened: bool,
}

/// The encoder readings of all joints of one bus at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The tick of the command that this reading answers. If the protocol does not report it, this
    /// is the oldest tick possible: the computed age of the reading is then too long, never too
    /// short.
    pub answers: u32,
    /// Readings of the joints in the order of the bus. Entries beyond the number of joints are
    /// ignored.
    pub joints: [JointReading; MAX_JOINTS],
}

/// The encoder reading of one joint, with the controller's own sign.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct JointReading {
    /// Encoder count, which grows by `counts_per_turn` of the rig file in each turn of the encoder.
    /// It wraps at 32 bits.
    pub count: i32,
    /// Rate of the joint after its gear, rad/s.
    pub rate: f64,
    /// True if the encoder has passed its index mark since power-on.
    pub index_seen: bool,
}

/// The command that the loop sends to one bus in one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BusCommand {
    /// The tick that this command belongs to. If the protocol can return a number with each
    /// reading, the driver must send this one.
    pub tick: u32,
    /// True to switch the motors on, false to switch them off.
    pub enable: bool,
    /// The watchdog time, ms: how long the controllers hold this command if no other follows.
    pub watchdog_ms: u16,
    /// Torque of each joint after its gear, in the order of the bus and with the controller's own
    /// sign, N m.
    pub torque: [f64; MAX_JOINTS],
}

/// The motors behind one serial line or adapter, as the loop sees them.
///
/// `receive` and `command` return at once: they neither wait nor allocate memory. `now_ns` is the
/// time since the start of the loop. A bus has no clock, so it also works in virtual time.
pub trait MotorBus: Send {
    /// Reads everything that has arrived. The loop calls it before it sends the command of `tick`.
    fn receive(&mut self, now_ns: u64, tick: u32) -> Heard;

    /// Writes a command. Returns whether the line accepted all of its bytes. If a command is cut
    /// short, the driver must make sure that its fragment does not corrupt the next one.
    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool;

    /// Returns what the controller of the joint at a place of the bus, from 0, last reported about
    /// itself. In each tick the loop calls it for one joint, in turn, after
    /// [`command`](Self::command). By default nothing is known.
    fn telemetry(&self, _now_ns: u64, _at: usize) -> Telemetry {
        Telemetry::default()
    }

    /// Informs the bus that its motors are off and that no command follows. This call can block.
    fn release(&mut self) {}
}

/// A protocol that motor controllers on a serial line use. These functions are called outside the
/// control loop.
pub trait Protocol: fmt::Debug + Send + Sync {
    /// Checks that the controllers on a line answer and match the rig file, and stores the names of
    /// their firmware in `expected` ([`Expected::set_firmware`]). Their motors stay off. This call
    /// can block.
    ///
    /// # Errors
    /// Fails if the controllers do not answer, or if they are not those of the rig.
    fn meet(&self, line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError>;

    /// Switches the motors off. Returns whether the controllers have lost power since the last
    /// [`meet`](Self::meet). This call can block.
    ///
    /// # Errors
    /// Fails if the controllers do not answer.
    fn switch_off(&self, line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError>;

    /// Returns the bytes that switch the motors off, at most 255. They must work whatever was
    /// written to the line before, because a helper process writes them if this program dies.
    fn off_bytes(&self, expected: &Expected) -> Vec<u8>;

    /// Returns the bus for a line. Call it after [`meet`](Self::meet) has succeeded.
    fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus>;

    /// Lists all controllers that answer on a line, including any that are not in the rig file,
    /// with the settings of each that are wrong. Changes nothing. This call can block.
    ///
    /// # Errors
    /// Fails if no controller answers.
    fn scan(&self, line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError>;

    /// Returns the largest traffic that one tick causes on a line with `joints` joints.
    fn traffic(&self, joints: usize) -> Traffic;

    /// Returns whether controllers report without being asked, and how soon. By default they report
    /// everything in the answer to each command.
    fn reports(&self) -> Reports {
        Reports::default()
    }
}

/// When the controllers of a protocol report their readings and their status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reports {
    /// True if readings arrive without being asked for. The time on their way is then known only
    /// from other messages, which are asked for.
    pub unasked: bool,
    /// Longest time from a change to the controllers' report of it, in ms. Changes are motors that
    /// go on or off, and faults.
    pub status_ms: u32,
    /// Longest time from a change of the delay on the line until the ages of readings include it,
    /// in ms. It is 0 if each reading names the command that it answers.
    pub delay_ms: u32,
}

impl Default for Reports {
    fn default() -> Self {
        Self { unasked: false, status_ms: 1, delay_ms: 0 }
    }
}

/// The largest traffic that one tick causes on a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes from the host to the controllers.
    pub commands: usize,
    /// Bytes from the controllers to the host.
    pub feedback: usize,
    /// Time that the controllers need in addition to the transmission time of the bytes, in us.
    /// `rig check` adds it to the time of the feedback.
    pub turnaround_us: u32,
    /// The time that a tick takes on the CAN bus behind an adapter. `None` if the line has no such
    /// bus.
    pub bus: Option<BusTraffic>,
}

/// The time that the frames of one tick take on a bus that all controllers of a line share, for
/// both directions together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusTraffic {
    /// Name of the bus and its bit rates, for messages.
    pub name: &'static str,
    /// Time that the frames take with the fewest stuff bits, ns.
    pub least_ns: u64,
    /// Time that the frames take with the most stuff bits, ns.
    pub most_ns: u64,
}

/// Returns the driver for a protocol that a rig file names.
#[must_use]
pub fn driver(protocol: config::Protocol) -> &'static dyn Protocol {
    match protocol {
        config::Protocol::Hbot => &drivers::hbot::HbotLink,
        config::Protocol::Moteus => &drivers::moteus::Moteus,
        config::Protocol::Odrive => &drivers::odrive::Odrive,
    }
}
