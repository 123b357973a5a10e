//! ODrive controllers as a motor bus: CANSimple through a serial CAN adapter that speaks slcan.
//!
//! | module | what it does |
//! |---|---|
//! | [`slcan`] | CAN frames as lines of text |
//! | [`message`] | the messages of CANSimple that are needed |
//! | `axis` | what is known of one axis: position, state, errors, a restart |
//! | `bus` | torques out, positions in |
//! | `meet` | bring-up: who is there, and whether their watchdogs work |
//! | `talk` | questions and answers outside the loop |
//!
//! `docs/controllers.md` says how to set the controllers up, and what only hardware can tell.

mod axis;
mod bus;
mod meet;
pub mod message;
pub mod slcan;
mod talk;
#[cfg(test)]
mod tests;

use self::bus::OdriveBus;
use self::message::{Command, state};
use super::can::can_ns;
use super::{BusTraffic, Expected, Found, MeetError, MotorBus, Protocol, Reports, Traffic};
use crate::line::Line;

/// What an adapter answers to a frame, bytes.
const TAKEN_BYTES: usize = 2;

/// ODrives that speak CANSimple, behind an adapter that speaks slcan.
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
        // The end of a half line that the adapter may have.
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
        // A torque each and one question. The one tick that switches motors also has mode and state
        // of each.
        let commands = joints + 1;
        // A position and a heartbeat each, and an answer to the question.
        let feedback = 2 * joints + 1;
        // Heartbeats, every tenth tick or rarer, come one after another.
        let frames = |stuffed| joints as u64 * can_ns(8, stuffed) * 21 / 10;
        Traffic {
            commands: commands * slcan::FRAME_BYTES + 1,
            feedback: feedback * slcan::FRAME_BYTES + commands * TAKEN_BYTES,
            turnaround_us: 0,
            bus: Some(BusTraffic { name: "CAN at 1 Mbit/s", least_ns: frames(false), most_ns: frames(true) }),
        }
    }

    fn reports(&self) -> Reports {
        Reports { unasked: true, status_ms: 40 }
    }
}
