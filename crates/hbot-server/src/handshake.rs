//! Before the first tick, and when a line is back: the controllers say who they are.

use std::io;
use std::time::Duration;

use hbot_core::Rig;
use hbot_link::{
    Command, ControllerFlags, Decoder, Description, FromController, MAX_COMMAND_FRAME, PROTOCOL_VERSION,
    ToController, encode,
};
use thiserror::Error;

use crate::engine::Line;
use crate::wire::Wire;

const TRIES: u32 = 10;
const WAIT: Duration = Duration::from_millis(100);

/// The controllers do not answer, or are not those of this rig.
#[derive(Debug, Error)]
pub enum HandshakeError {
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
    /// Another protocol.
    #[error(
        "controllers speak version {theirs} of the link protocol, this server {PROTOCOL_VERSION}: update the older one"
    )]
    Protocol {
        /// The controllers' version.
        theirs: u16,
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
}

/// Who must be at the other end of a line.
#[derive(Debug, Clone)]
pub struct Expected {
    /// The port, for messages.
    port: String,
    /// In the order of the line: each joint's number in the rig, and its counts a turn.
    joints: Vec<(usize, u32)>,
}

impl Expected {
    /// The controllers of `rig` on line number `port` of `line`, which is called `name`.
    #[must_use]
    pub fn new(name: &str, rig: &Rig, line: &Line, port: usize) -> Self {
        let mut joints: Vec<_> = line.joints(port).collect();
        joints.sort_by_key(|(_, at)| *at);
        let joints =
            joints.into_iter().map(|(joint, _)| (joint, rig.joints[joint].counts_per_turn)).collect();
        Self { port: name.to_owned(), joints }
    }

    /// How many joints are on the line.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// The command that switches the motors of the line off.
    fn off(&self) -> ToController {
        let mut off = Command { watchdog_ms: 1, ..Command::default() };
        // At most as many as a line may have.
        let _ = off.torque.resize(self.joints(), 0.0);
        ToController::Command(off)
    }

    /// The bytes that switch the motors of the line off, whatever was written to it before.
    #[must_use]
    pub fn off_frame(&self) -> Vec<u8> {
        framed(&self.off())
    }

    /// In what controllers that describe themselves differ from those of the rig, if in anything. Does not allocate.
    pub(crate) fn difference(&self, there: &Description) -> Option<Difference> {
        if there.protocol != PROTOCOL_VERSION {
            return Some(Difference::Protocol);
        }
        if there.joints.len() != self.joints() {
            return Some(Difference::Joints);
        }
        let mut both = there.joints.iter().zip(&self.joints);
        both.position(|(theirs, (_, ours))| theirs.counts_per_turn != *ours).map(Difference::Counts)
    }
}

/// In what controllers differ from those of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Difference {
    /// The version of the link protocol.
    Protocol,
    /// How many joints there are.
    Joints,
    /// The counts a turn of the joint at this place on the line.
    Counts(usize),
}

/// The table of a joint in a rig file.
#[must_use]
pub fn field(joint: usize) -> String {
    format!("wheel[{}].{}", joint / 2, if joint.is_multiple_of(2) { "steer" } else { "drive" })
}

/// Asks the controllers on `wire` to describe themselves and holds the answer against the rig.
///
/// # Errors
/// They do not answer, or are not those of the rig.
pub fn handshake(wire: &mut dyn Wire, expected: &Expected) -> Result<Description, HandshakeError> {
    let answer = ask(wire, &expected.port, &ToController::Describe, |message| match message {
        FromController::Description(description) => Some(description),
        FromController::Feedback(_) => None,
    })?;
    check(answer, expected)
}

/// Switches the motors on `wire` off, and says whether their controllers have lost power since they were asked to describe
/// themselves last.
///
/// # Errors
/// They do not answer.
pub fn switch_off(wire: &mut dyn Wire, expected: &Expected) -> Result<bool, HandshakeError> {
    ask(wire, &expected.port, &expected.off(), |message| match message {
        FromController::Feedback(feedback) => Some(feedback.flags.contains(ControllerFlags::UNDESCRIBED)),
        FromController::Description(_) => None,
    })
}

/// The frame of `message` after a zero byte, which ends a half frame that may be on the line.
fn framed(message: &ToController) -> Vec<u8> {
    let mut frame = vec![0; 1 + MAX_COMMAND_FRAME];
    let n = encode(message, &mut frame[1..]).unwrap_or(0);
    frame.truncate(1 + n);
    frame
}

/// Says `message` until the answer comes.
fn ask<T>(
    wire: &mut dyn Wire,
    port: &str,
    message: &ToController,
    mut answer: impl FnMut(FromController) -> Option<T>,
) -> Result<T, HandshakeError> {
    let failed = |error| HandshakeError::Line { port: port.to_owned(), error };
    let mut decoder = Decoder::<FromController>::new();
    let mut buffer = [0; 512];
    let frame = framed(message);
    for _ in 0..TRIES {
        wire.write(&frame).map_err(failed)?;
        for _ in 0..WAIT.as_millis() {
            let mut found = None;
            let got = wire.read(&mut buffer).map_err(failed)?;
            decoder.feed(&buffer[..got], |frame| {
                if let Some(it) = frame.ok().and_then(&mut answer) {
                    found = Some(it);
                }
            });
            if let Some(found) = found {
                return Ok(found);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    Err(HandshakeError::Silent { port: port.to_owned() })
}

fn check(description: Description, expected: &Expected) -> Result<Description, HandshakeError> {
    match expected.difference(&description) {
        None => Ok(description),
        Some(Difference::Protocol) => Err(HandshakeError::Protocol { theirs: description.protocol }),
        Some(Difference::Joints) => {
            let (theirs, ours) = (description.joints.len(), expected.joints());
            Err(HandshakeError::Joints { port: expected.port.clone(), theirs, ours })
        }
        Some(Difference::Counts(place)) => {
            let (joint, ours) = expected.joints[place];
            let theirs = description.joints[place].counts_per_turn;
            Err(HandshakeError::Counts { joint: joint + 1, field: field(joint), theirs, ours })
        }
    }
}
