//! The driver for moteus servos (mjbots), which are connected through an fdcanusb adapter or on a
//! UART (docs/controllers.md).
//!
//! | module | what it does |
//! |---|---|
//! | `codec` | encodes frames to the servos, with the vendor's crate, and decodes their answers |
//! | `text` | the lines of text that carry frames, in both dialects |
//! | `talk` | questions and answers outside the loop |
//! | `meet` | checks that the servos are those of the rig file and have the right settings |
//! | `servo` | what is known of one servo: position, faults, restarts |
//! | `bus` | the bus that the loop calls |
//!
//! The protocol lacks three things, which the driver replaces. *Which command an answer belongs
//! to*: the watchdog time of a command is returned bit for bit in its answer, and its mantissa
//! carries the tick. *Restarts*: every other answer contains the time since power-on. *Motors on or
//! off*: an answer shows the mode that the servo had before it carried out the command.

mod bus;
mod codec;
mod meet;
mod servo;
mod talk;
#[cfg(test)]
mod tests;
mod text;

use std::sync::atomic::Ordering;

use hbot_core::MAX_JOINTS;

use crate::bus::can::can_fd_ns;
use crate::bus::{BusTraffic, Expected, Found, MeetError, MotorBus, Protocol, Traffic};
use crate::line::Line;

use self::bus::MoteusBus;
use self::talk::Talk;
use self::text::{BREAK, Dialect};

/// The CAN destination id with which a frame is sent to all servos.
const BROADCAST: u8 = 0x7f;
/// The version of the vendor's register map that this driver supports.
const REGISTER_MAP: i32 = 5;
/// Number of data bytes on the CAN bus of the longest command, and of the answer to it.
const COMMAND_BYTES: usize = 48;
const ANSWER_BYTES: usize = 32;

/// Indices into the notes of an [`Expected`]. The first note says whether the line has checksums.
/// The notes that follow hold the time at which each servo got power, in ms on the system's clock,
/// and then how long it had had power when it said so, in ms.
const DIALECT: usize = 0;
const POWERED: usize = 1;
const UPTIME: usize = POWERED + MAX_JOINTS;

/// The driver for moteus servos.
#[derive(Debug, Clone, Copy)]
pub struct Moteus;

impl Protocol for Moteus {
    fn meet(&self, line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError> {
        meet::meet(line, expected)
    }

    fn switch_off(&self, line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError> {
        Talk::open(line, expected)?.switch_off()
    }

    fn off_bytes(&self, _: &Expected) -> Vec<u8> {
        // An adapter refuses lines with checksums and a UART lines without, so the frame is sent in
        // both forms.
        let mut bytes = BREAK.to_vec();
        for dialect in [Dialect::Fdcanusb, Dialect::Uart] {
            text::push(&mut bytes, &codec::stop_all(), dialect);
        }
        bytes
    }

    fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus> {
        Box::new(MoteusBus::new(line, expected))
    }

    fn scan(&self, line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
        meet::scan(line, expected)
    }

    fn traffic(&self, joints: usize) -> Traffic {
        // A command line has the id, data, flags, checksum and end. Before each answer, `OK`
        // arrives with its checksum.
        let (command, answer) = (22 + 2 * COMMAND_BYTES, 8 + 28 + 2 * ANSWER_BYTES);
        let frames = |answers_long, stuffed| {
            can_fd_ns(COMMAND_BYTES as u64, true, stuffed)
                + can_fd_ns(ANSWER_BYTES as u64, answers_long, stuffed)
        };
        let bus = BusTraffic {
            name: "CAN-FD at 1 and 5 Mbit/s",
            // Servos with ids up to 7 answer with short ids.
            least_ns: joints as u64 * frames(false, false),
            most_ns: joints as u64 * frames(true, true),
        };
        Traffic { commands: joints * command, feedback: joints * answer, turnaround_us: 0, bus: Some(bus) }
    }
}

/// Returns whether the lines of text between this program and the servos have checksums.
/// [`Talk::open`] has found this out and stored it in `expected`.
fn dialect(expected: &Expected) -> Dialect {
    match expected.note(DIALECT).load(Ordering::Relaxed) {
        0 => Dialect::Fdcanusb,
        _ => Dialect::Uart,
    }
}
