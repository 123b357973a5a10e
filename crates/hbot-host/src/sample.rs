//! What the loop publishes each tick.

use hbot_core::inputs::MAX_COMMANDS;
use hbot_core::outputs::{Reply, State};

/// One tick, as everybody but the loop sees it.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// The controller's state.
    pub state: State,
    /// Nominal time of the tick since the loop's start, ns.
    pub t_ns: u64,
    /// The revision of the scene that was rendered.
    pub scene: u64,
    /// How long things took.
    pub timing: TickTiming,
    /// What has happened since the start.
    pub counters: Counters,
    /// Answers to orders that this tick took.
    pub answers: [Option<Answer>; MAX_COMMANDS],
}

/// The answer to an order.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// The order's ticket.
    pub ticket: u64,
    /// What became of it.
    pub reply: Reply,
}

/// How long things took in one tick, ns.
#[derive(Debug, Clone, Copy, Default)]
pub struct TickTiming {
    /// Awake before the deadline, waiting for it; 0 in virtual time.
    pub awake_ns: u64,
    /// From the deadline to the start of the tick; 0 in virtual time.
    pub lateness_ns: u64,
    /// In the controller.
    pub compute_ns: u64,
    /// On the serial line: reading, decoding, encoding, writing.
    pub link_ns: u64,
    /// Torque age: from the command that the newest reading answers (which is when the controller took the reading) to
    /// this tick's torque on the wire. `None` before the first reading.
    pub age_ns: Option<u64>,
}

/// What has happened since the loop's start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Ticks that started more than a quarter period after their deadline.
    pub late: u64,
    /// Ticks whose deadline passed before the one before them ended.
    pub skipped: u64,
    /// Ticks without new feedback.
    pub missed: u64,
    /// Damaged frames.
    pub corrupt_frames: u64,
    /// Whole frames from other controllers, or that answer a command that was never sent.
    pub foreign_frames: u64,
    /// Commands that the serial line did not take whole.
    pub send_failures: u64,
    /// Times that a serial line was gone and came back.
    pub reopened: u64,
    /// Samples that found no place because nobody fetched them.
    pub dropped_samples: u64,
}
