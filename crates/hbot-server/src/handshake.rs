//! Before the first tick: the controllers say who they are.

use std::io;
use std::time::Duration;

use hbot_core::Rig;
use hbot_link::{Decoder, Description, FromController, PROTOCOL_VERSION, ToController, encode};
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
    #[error("the controllers have {theirs} joints, the rig file {ours}: correct its wheels")]
    Joints {
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

/// Asks the controllers on `wire` to describe themselves and holds the answer against the rig.
///
/// # Errors
/// They do not answer, or are not those of the rig.
pub fn handshake(
    wire: &mut dyn Wire,
    port: &str,
    rig: &Rig,
    line: &Line,
) -> Result<Description, HandshakeError> {
    let failed = |error| HandshakeError::Line { port: port.to_owned(), error };
    let mut decoder = Decoder::<FromController>::new();
    let mut buffer = [0; 512];
    // A zero first ends whatever was on the line before.
    let mut ask = [0; 64];
    let n = 1 + encode(&ToController::Describe, &mut ask[1..]).unwrap_or(0);
    for _ in 0..TRIES {
        wire.write(&ask[..n]).map_err(failed)?;
        for _ in 0..WAIT.as_millis() {
            let mut found = None;
            let got = wire.read(&mut buffer).map_err(failed)?;
            decoder.feed(&buffer[..got], |frame| {
                if let Ok(FromController::Description(description)) = frame {
                    found = Some(description);
                }
            });
            if let Some(description) = found {
                return check(description, rig, line);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    Err(HandshakeError::Silent { port: port.to_owned() })
}

fn check(description: Description, rig: &Rig, line: &Line) -> Result<Description, HandshakeError> {
    if description.protocol != PROTOCOL_VERSION {
        return Err(HandshakeError::Protocol { theirs: description.protocol });
    }
    let ours = rig.device.joints();
    if description.joints.len() != ours {
        return Err(HandshakeError::Joints { theirs: description.joints.len(), ours });
    }
    for (i, place) in line.places.iter().enumerate() {
        let (theirs, ours) = (description.joints[*place].counts_per_turn, rig.joints[i].counts_per_turn);
        if theirs != ours {
            let field = format!("wheel[{}].{}", i / 2, if i % 2 == 0 { "steer" } else { "drive" });
            return Err(HandshakeError::Counts { joint: i + 1, field, theirs, ours });
        }
    }
    Ok(description)
}
