//! Before the first tick, and when a line is back: whether the controllers are those of the rig.

use std::io;
use std::time::Duration;

use hbot_core::Rig;
use thiserror::Error;

use crate::layout::{Layout, Place};
use crate::line::Line;

/// How often a question is asked.
const TRIES: u32 = 10;
/// How long each answer is waited for.
const WAIT: Duration = Duration::from_millis(100);

/// The controllers do not answer, or are not those of this rig.
#[derive(Debug, Error)]
pub enum MeetError {
    /// No answer.
    #[error(
        "no answer from the motor controllers on {port} within {} ms: check power, cable and baud rate",
        u64::from(TRIES) * u64::try_from(WAIT.as_millis()).unwrap_or(0)
    )]
    Silent {
        /// The port.
        port: String,
    },
    /// The line failed.
    #[error("serial port {port}: {error}")]
    Line {
        /// The port.
        port: String,
        /// What the system says.
        error: io::Error,
    },
    /// Another version of the protocol.
    #[error(
        "controllers speak version {theirs} of the link protocol, this server {ours}: update the older one"
    )]
    Version {
        /// The controllers' version.
        theirs: u16,
        /// This program's.
        ours: u16,
    },
    /// Another number of joints.
    #[error("the controllers on {port} have {theirs} joints, the rig file {ours} there: correct its wheels")]
    Joints {
        /// The port.
        port: String,
        /// On the line.
        theirs: usize,
        /// In the rig file.
        ours: usize,
    },
    /// Another encoder.
    #[error(
        "joint {joint}: its controller counts {theirs} a turn, the rig file says {ours}: correct counts_per_turn of \
         {field}"
    )]
    Counts {
        /// Which joint, counted from 1.
        joint: usize,
        /// Its field in the rig file.
        field: String,
        /// On the line.
        theirs: u32,
        /// In the rig file.
        ours: u32,
    },
    /// A controller is set up so that no torque may be asked of it.
    #[error("{port}: {reason}")]
    Setting {
        /// The port.
        port: String,
        /// What is wrong, and the command that mends it.
        reason: String,
    },
}

/// Who must be at the other end of a line.
#[derive(Debug, Clone)]
pub struct Expected {
    /// The port, for messages.
    port: String,
    /// In the order of the bus.
    joints: Vec<ExpectedJoint>,
}

/// A joint as the rig file describes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedJoint {
    /// Its number in the rig, from 0: steer, drive of each wheel.
    pub number: usize,
    /// The id of its controller on the bus: `controller` of the rig file, or its place on the
    /// simulated line. Joints stand on a bus in the order of their ids.
    pub id: u8,
    /// Counts of its encoder in one turn of the encoder.
    pub counts_per_turn: u32,
    /// Turns of the encoder in one turn of the joint.
    pub gear: f64,
}

impl Expected {
    /// The controllers of `rig` on bus number `bus` of `layout`, on a port that is called `port`.
    #[must_use]
    pub fn new(port: &str, rig: &Rig, layout: &Layout, bus: usize) -> Self {
        let mut joints: Vec<_> = layout.on(bus).collect();
        joints.sort_by_key(|(_, place)| place.at);
        let expected = |(number, place): (usize, &Place)| {
            let joint = &rig.joints[number];
            ExpectedJoint { number, id: place.id, counts_per_turn: joint.counts_per_turn, gear: joint.gear }
        };
        Self { port: port.to_owned(), joints: joints.into_iter().map(expected).collect() }
    }

    /// The name of the port.
    #[must_use]
    pub fn port(&self) -> &str {
        &self.port
    }

    /// How many joints are on the line.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// The joint at place `at` of the bus, from 0. A driver whose controllers speak of turns, or of the
    /// motor's shaft, converts by it.
    #[must_use]
    pub fn joint(&self, at: usize) -> Option<&ExpectedJoint> {
        self.joints.get(at)
    }

    /// A rig with one joint fewer, for tests of drivers.
    #[must_use]
    pub fn without_last(&self) -> Self {
        let mut other = self.clone();
        other.joints.pop();
        other
    }

    /// A rig whose last encoder counts one more a turn, for tests of drivers.
    #[must_use]
    pub fn with_other_counts(&self) -> Self {
        let mut other = self.clone();
        if let Some(joint) = other.joints.last_mut() {
            joint.counts_per_turn += 1;
        }
        other
    }

    /// The first joint whose counts a turn are not `theirs` (in the order of the bus): its place.
    /// Does not allocate.
    pub fn first_wrong_counts(&self, theirs: impl IntoIterator<Item = u32>) -> Option<usize> {
        theirs.into_iter().zip(&self.joints).position(|(theirs, joint)| theirs != joint.counts_per_turn)
    }

    /// The error where the line carries another number of joints.
    #[must_use]
    pub fn wrong_joints(&self, theirs: usize) -> MeetError {
        MeetError::Joints { port: self.port.clone(), theirs, ours: self.joints() }
    }

    /// The error where the joint at place `at` counts `theirs` a turn.
    #[must_use]
    pub fn wrong_counts(&self, at: usize, theirs: u32) -> MeetError {
        let ExpectedJoint { number, counts_per_turn: ours, .. } = self.joints[at];
        MeetError::Counts { joint: number + 1, field: field(number), theirs, ours }
    }
}

/// The table of a joint in a rig file.
#[must_use]
pub fn field(joint: usize) -> String {
    format!("wheel[{}].{}", joint / 2, if joint.is_multiple_of(2) { "steer" } else { "drive" })
}

/// Writes `question` up to ten times, 100 ms apart, until `answer` finds what it looks for in the
/// bytes that come back. For drivers outside the loop: it waits.
///
/// # Errors
/// No answer, or the line is gone.
pub fn converse<T>(
    line: &mut dyn Line,
    expected: &Expected,
    question: &[u8],
    mut answer: impl FnMut(&[u8]) -> Option<T>,
) -> Result<T, MeetError> {
    let failed = |error| MeetError::Line { port: expected.port.clone(), error };
    let mut buffer = [0; 512];
    for _ in 0..TRIES {
        // Before the first tick: a simulated line stands still.
        line.write(0, question).map_err(failed)?;
        for _ in 0..WAIT.as_millis() {
            let got = line.read(0, &mut buffer).map_err(failed)?;
            if let Some(found) = answer(&buffer[..got]) {
                return Ok(found);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    Err(MeetError::Silent { port: expected.port.clone() })
}
