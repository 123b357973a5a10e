//! Driver for ODrive motor controllers. It uses their protocol CANSimple, over a serial CAN adapter
//! with the text protocol slcan.
//!
//! | module | contents |
//! |---|---|
//! | [`slcan`] | CAN frames as lines of text |
//! | [`message`] | the messages of CANSimple that the driver needs |
//! | `axis` | state of one axis: position, errors, detection of a restart |
//! | `order` | whether motors are commanded on, and how long an axis may take |
//! | `bus` | torques to the axes and positions from them, in each tick |
//! | `meet` | bring-up: which axes are on the line, and whether they are set up right |
//! | `proof` | the part of bring-up that proves that watchdogs work |
//! | `trip` | the round trip of questions in the loop, from which the age of positions follows |
//! | `talk` | questions and answers before the first tick |
//!
//! `docs/controllers.md` explains how to set the controllers up, and which questions only hardware
//! can answer.

mod axis;
mod bus;
mod meet;
pub mod message;
mod order;
mod proof;
pub mod slcan;
mod talk;
#[cfg(test)]
mod tests;
mod trip;

use self::bus::OdriveBus;
use self::message::{Command, state};
use crate::bus::can::can_ns;
use crate::bus::{BusTraffic, Expected, Found, MeetError, MotorBus, Protocol, Reports, Traffic};
use crate::line::Line;

/// Largest number of bytes with which an adapter accepts a frame.
const TAKEN_BYTES: usize = 2;

/// Driver for ODrive motor controllers. They use the protocol CANSimple, behind a CAN adapter that
/// uses the text protocol slcan.
#[derive(Debug, Clone, Copy)]
pub struct Odrive;

impl Protocol for Odrive {
    fn meet(&self, line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError> {
        meet::meet(line, expected)
    }

    fn switch_off(&self, line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError> {
        meet::switch_off(line, expected)
    }

    fn off_bytes(&self, expected: &Expected) -> Vec<u8> {
        // Ends a half line that the adapter may have received.
        let mut bytes = vec![b'\r'];
        for joint in (0..expected.joints()).filter_map(|at| expected.joint(at)) {
            Command::AxisState(state::IDLE).write(joint.id, &mut bytes);
        }
        bytes
    }

    fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus> {
        Box::new(OdriveBus::new(line, &expected))
    }

    fn scan(&self, line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
        meet::scan(line, expected)
    }

    fn traffic(&self, joints: usize) -> Traffic {
        // Each axis gets a torque, and one axis a question. Only the first tick asks all axes, and
        // only a tick that switches motors on or off also sends each axis a mode and a state.
        let commands = joints + 1;
        // Each axis sends a position and a heartbeat, and one axis an answer.
        let feedback = 2 * joints + 1;
        // Each axis sends at most one heartbeat in ten ticks. The heartbeats of different axes come
        // one after another.
        let frames = |stuffed| joints as u64 * can_ns(8, stuffed) * 21 / 10;
        Traffic {
            commands: commands * slcan::FRAME_BYTES + 1,
            feedback: feedback * slcan::FRAME_BYTES + commands * TAKEN_BYTES,
            turnaround_us: 0,
            bus: Some(BusTraffic { name: "CAN at 1 Mbit/s", least_ns: frames(false), most_ns: frames(true) }),
        }
    }

    fn reports(&self) -> Reports {
        Reports { unasked: true, status_ms: 40, delay_ms: 150 }
    }
}
