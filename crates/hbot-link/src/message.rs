//! The messages of the protocol. The fields are in the order in which they are encoded.

use crate::{
    ControllerFlags, JointFlags, MAX_COMMAND_FRAME, MAX_FEEDBACK_FRAME, MAX_FIRMWARE_BYTES, MAX_JOINTS,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// A message from the host to a motor controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToController {
    /// Asks the controller for a [`Description`]. It is the first message after the port is opened.
    Describe,
    /// The torques of one tick.
    Command(Command),
}

/// A message from a motor controller to the host. A controller sends one only as an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no allocator to box with, and feedback is the common case"
)]
pub enum FromController {
    /// The answer to [`ToController::Describe`].
    Description(Description),
    /// The answer to [`ToController::Command`].
    Feedback(Feedback),
}

/// The torques of one tick, for all joints of the port.
///
/// # Valid commands
///
/// A command is valid if three conditions hold: its frame is accepted, it has one torque per joint
/// of the controller, and each torque is finite. This crate checks only the first. Firmware must
/// check the others. It must not act on an invalid command, not answer it and not restart the
/// watchdog with it.
///
/// # The watchdog
///
/// If a controller receives no valid command for `watchdog_ms`, it goes to zero torque by itself
/// and sets [`ControllerFlags::WATCHDOG_EXPIRED`]. It stays at zero torque, however many commands
/// arrive, until it receives a command with `enable = false`. That command clears the flag. The
/// next command with `enable = true` can give torque again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Number of the command on this port. It wraps. The feedback repeats it.
    pub sequence: u32,
    /// True if the torques are to be applied. If false, the joints have no torque, whatever
    /// `torque` contains, and an expired watchdog is cleared.
    pub enable: bool,
    /// Watchdog time in ms, 1 to 65535: how long the command is valid after its arrival if no other
    /// command follows. A host never sends 0. A controller treats 0 as expired on arrival, so the
    /// command gives no torque.
    pub watchdog_ms: u16,
    /// Torque at each joint, after the gear, N m, in the order of the description. The sign is that
    /// of the controller: a positive torque turns the joint towards greater counts. The host
    /// converts the signs of the rig.
    pub torque: heapless::Vec<f32, MAX_JOINTS>,
}

/// The description that a motor controller gives of itself: protocol version, firmware and joints.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION) of the controller. A host refuses any version
    /// except its own.
    pub protocol: u16,
    /// Name and version of the firmware, for people to read.
    pub firmware: heapless::String<MAX_FIRMWARE_BYTES>,
    /// The joints of the port. Commands and feedback have the same order.
    pub joints: heapless::Vec<JointDescription, MAX_JOINTS>,
}

/// The properties of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JointDescription {
    /// Encoder counts per turn of the encoder, before the gear; 1 or more. The host compares it
    /// with the rig file.
    pub counts_per_turn: u32,
}

/// The readings of all joints of the port. All are sampled together when the answered command
/// arrives.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// [`Command::sequence`] of the command that is answered.
    pub sequence: u32,
    /// State of the controller after it has processed that command.
    pub flags: ControllerFlags,
    /// One reading per joint, in the order of the description.
    pub joints: heapless::Vec<JointReading, MAX_JOINTS>,
}

/// The reading of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointReading {
    /// Position of the encoder, before the gear, in counts. It wraps from [`i32::MAX`] to
    /// [`i32::MIN`] and back: the motion between two readings is their wrapping difference.
    pub count: i32,
    /// Rate of the joint, after the gear, rad/s; positive towards greater counts.
    pub rate: f32,
    /// Motor current, A; positive current drives towards greater counts. 0 if it is not measured.
    pub current: f32,
    /// Temperature of the motor, degrees Celsius. 0 if it is not measured.
    pub temperature: f32,
    /// State of this joint, as a set of flags.
    pub flags: JointFlags,
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::ToController {}
    impl Sealed for super::FromController {}
}

/// A message that is sent in its own frame: [`ToController`] or [`FromController`]. The trait is
/// sealed.
pub trait Message: Serialize + DeserializeOwned + sealed::Sealed {
    /// Largest number of bytes of a frame of this type on the line, with its delimiter. A buffer of
    /// this size is always large enough.
    const MAX_FRAME: usize;
}

impl Message for ToController {
    const MAX_FRAME: usize = MAX_COMMAND_FRAME;
}

impl Message for FromController {
    const MAX_FRAME: usize = MAX_FEEDBACK_FRAME;
}
