//! What is said on the line. Fields stand here in the order in which they are encoded.

use crate::{
    ControllerFlags, JointFlags, MAX_COMMAND_FRAME, MAX_FEEDBACK_FRAME, MAX_FIRMWARE_BYTES, MAX_JOINTS,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Host to controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToController {
    /// Asks for a [`Description`]; the first message after the port is opened.
    Describe,
    /// Torques for one tick.
    Command(Command),
}

/// Controller to host, and only in answer to a message from there.
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

/// The torques of one tick, for all joints of the port. The name is that of docs/link.md; `Command` of hbot-core is
/// what a person or a client asks of the loop, and never leaves the PC.
///
/// # Valid commands
///
/// A command is valid where its frame is accepted, its torques are as many as the controller's joints, and
/// each of them is finite. This crate checks the first alone. Firmware must check the rest and act on no
/// other: an invalid command is not answered and does not feed the watchdog.
///
/// # The watchdog
///
/// A controller that hears no valid command for `watchdog_ms` goes to zero torque by itself, sets
/// [`ControllerFlags::WATCHDOG_EXPIRED`], and stays there, however many commands arrive after, until it sees
/// a command with `enable = false`. That one clears the flag; the next with `enable = true` may give torque
/// again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Counts the commands of this port and wraps; the feedback repeats it.
    pub sequence: u32,
    /// Whether the torques are to be applied. Where false, the joints are free of torque whatever `torque`
    /// says, and an expired watchdog is cleared.
    pub enable: bool,
    /// How long this command holds with no other after it, in ms from its arrival; 1 to 65535. A host never
    /// sends 0; a controller takes 0 as expired on arrival, so the command gives no torque.
    pub watchdog_ms: u16,
    /// Torque at each joint, after the gear, in N m, in the order of the description. Its sign is the
    /// controller's own: positive turns the joint towards greater counts. Signs of the rig are put right by
    /// the host.
    pub torque: heapless::Vec<f32, MAX_JOINTS>,
}

/// What a controller is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// The controller's [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION). A host refuses any but its own.
    pub protocol: u16,
    /// Name and version of the firmware, for people to read.
    pub firmware: heapless::String<MAX_FIRMWARE_BYTES>,
    /// The joints of the port. Commands and feedback keep this order.
    pub joints: heapless::Vec<JointDescription, MAX_JOINTS>,
}

/// What a joint is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JointDescription {
    /// Counts in one turn of the encoder, before the gear; 1 or more. The host holds it against the rig file.
    pub counts_per_turn: u32,
}

/// What the joints of the port read, all sampled together on the arrival of the command that this answers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// [`Command::sequence`] of the command that this answers.
    pub sequence: u32,
    /// The state of the controller once it has taken that command in.
    pub flags: ControllerFlags,
    /// One reading a joint, in the order of the description.
    pub joints: heapless::Vec<JointReading, MAX_JOINTS>,
}

/// What one joint reads, as it stands on the line. The name is that of docs/link.md; `JointReading` of hbot-host is
/// what a driver of any protocol makes of its own frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointReading {
    /// Position at the encoder, before the gear, in counts. Wraps from [`i32::MAX`] to [`i32::MIN`] and back:
    /// the motion between two readings is their wrapping difference.
    pub count: i32,
    /// Rate of the joint, after the gear, in rad/s; positive towards greater counts.
    pub rate: f32,
    /// Motor current in A; positive drives towards greater counts. 0 where it is not measured.
    pub current: f32,
    /// Temperature of the motor in degrees Celsius. 0 where it is not measured.
    pub temperature: f32,
    /// What there is to say of this joint.
    pub flags: JointFlags,
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::ToController {}
    impl Sealed for super::FromController {}
}

/// A message that travels in a frame of its own: [`ToController`] or [`FromController`], and no other type.
pub trait Message: Serialize + DeserializeOwned + sealed::Sealed {
    /// The most bytes that a frame of this type has on the line, delimiter included: a buffer of this size
    /// always suffices.
    const MAX_FRAME: usize;
}

impl Message for ToController {
    const MAX_FRAME: usize = MAX_COMMAND_FRAME;
}

impl Message for FromController {
    const MAX_FRAME: usize = MAX_FEEDBACK_FRAME;
}
