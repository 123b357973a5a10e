//! The controllers as a host sees them: through bytes.

use hbot_link::{
    Command, ControllerFlags, Decoder, Description, Feedback, FromController, JointFlags, MAX_COMMAND_FRAME,
    PROTOCOL_VERSION, ToController, encode,
};
use hbot_sim::controller::{Encoder, FIRMWARE, Fault, SimulatedJoint};
use hbot_sim::plant::State;
use hbot_sim::rig::{RigConfig, RigError, SimulatedRig};

use crate::devices::rig;

pub(crate) const MS: u64 = 1_000_000;

/// The bytes of a message.
pub(crate) fn frame(message: &ToController) -> Vec<u8> {
    let mut buffer = [0; MAX_COMMAND_FRAME];
    let length = encode(message, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

/// A command with a watchdog of 20 ms.
pub(crate) fn command(sequence: u32, enable: bool, torque: &[f32]) -> Command {
    Command { sequence, enable, watchdog_ms: 20, torque: heapless(torque) }
}

fn heapless<T: Default + From<Command>>(torque: &[f32]) -> T
where
    T: Sized,
{
    let _ = torque;
    unimplemented!()
}
