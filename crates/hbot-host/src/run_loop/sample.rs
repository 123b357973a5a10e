//! The sample that the loop publishes in each tick.

use hbot_core::inputs::{Complaints, MAX_COMMANDS};
use hbot_core::outputs::{Reply, State};

use crate::bus::Telemetry;

/// The record of one tick that the loop publishes to the rest of the program.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// State of the control law after the tick.
    pub state: State,
    /// Nominal time of the tick since the start of the loop, ns.
    pub t_ns: u64,
    /// Revision number of the scene that was rendered.
    pub scene: u64,
    /// Time that each part of this tick took.
    pub timing: TickTiming,
    /// Counts of events since the start of the loop.
    pub counters: Counters,
    /// Answers to the orders that the loop took from the service in this tick.
    pub answers: [Option<Answer>; MAX_COMMANDS],
    /// The number of a joint, and what its controller last reported about itself. The joints of the
    /// rig take turns, one in each tick, so that a sample stays small.
    pub telemetry: (usize, Telemetry),
    /// What all motor controllers complain of in this tick.
    pub complaints: Complaints,
    /// Whether a motor controller may have restarted.
    pub restarted: bool,
}

/// The loop's answer to one order of the service.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// Ticket number of the order, which was returned when the order was sent.
    pub ticket: u64,
    /// The control law's reply to the order.
    pub reply: Reply,
}

/// Time that each part of one tick took, ns.
#[derive(Debug, Clone, Copy, Default)]
pub struct TickTiming {
    /// Time for which the loop's thread was awake before the deadline, ns; 0 in virtual time.
    pub awake_ns: u64,
    /// Time from the deadline to the start of the tick, ns; 0 in virtual time.
    pub lateness_ns: u64,
    /// Time spent in the control law, ns.
    pub compute_ns: u64,
    /// Time spent on the serial line, ns: reading, decoding, encoding and writing.
    pub line_ns: u64,
    /// Age of the torque, ns: the time from the measurement of the newest reading to sending this
    /// tick's torque. A motor controller reads its encoders when it receives a command, so the send
    /// time of the command that the reading answers is taken as the time of the measurement. `None`
    /// if this tick has no new reading, or if the send time is no longer known.
    pub age_ns: Option<u64>,
}

/// Counts of events since the start of the loop.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Late ticks: those that began more than a quarter period after their deadline.
    pub late: u64,
    /// Skipped ticks: those whose deadline passed before the previous tick ended.
    pub skipped: u64,
    /// Missed ticks: those without a new reading.
    pub missed: u64,
    /// Damaged frames that were received.
    pub corrupt_frames: u64,
    /// Intact frames that came from other controllers or answer a command that was never sent.
    pub foreign_frames: u64,
    /// Commands that the serial line did not accept completely.
    pub send_failures: u64,
    /// Number of times that a lost serial line was reopened.
    pub reopened: u64,
    /// Samples that were dropped because the ring to the service was full.
    pub dropped_samples: u64,
}
