//! The messages of the protocol. The fields are in the order in which they are encoded.

use crate::{
    ControllerFlags, JointFlags, MAX_COMMAND_FRAME, MAX_FEEDBACK_FRAME, MAX_FIRMWARE_BYTES, MAX_JOINTS,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// A message from the host to a motor controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToController {
    /// Asks the motor controller for its [`Description`]. It is the first message after the port is
    /// opened.
    Describe,
    /// Commands the torques of one tick.
    Command(Command),
}

/// A message from a motor controller to the host. A motor controller sends a message only as an
/// answer.
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

/// The torques of one tick for all joints of a motor controller's port.
///
/// # Valid commands
///
/// A command is valid if three conditions hold: its frame is accepted, it has one torque per joint
/// of the motor controller, and each torque is finite. This crate checks only the first condition,
/// so firmware must check the others. Firmware must not answer an invalid command, act on it or
/// restart the watchdog because of it.
///
/// # The watchdog
///
/// If a motor controller receives no valid command for `watchdog_ms`, it sets its torque to zero by
/// itself and sets the flag [`ControllerFlags::WATCHDOG_EXPIRED`]. Its torque stays at zero,
/// whichever commands arrive, until a command with `enable = false` clears the flag. After that, a
/// command with `enable = true` can give torque again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Sequence number of the command on this port. It wraps at 32 bits. The answer repeats it.
    pub sequence: u32,
    /// True if the torques are to be applied. If false, the joints make no torque, whatever
    /// `torque` contains, and an expired watchdog is cleared.
    pub enable: bool,
    /// Watchdog time, ms: how long the command stays valid after its arrival if no other command
    /// follows. A host sends 1 to 65535. A motor controller treats 0 as expired on arrival, so the
    /// command gives no torque.
    pub watchdog_ms: u16,
    /// Torque at each joint, after the gear, in N m, in the order of the description. A positive
    /// torque turns the joint towards greater encoder counts. The host converts from the sign
    /// conventions of the rig.
    pub torque: heapless::Vec<f32, MAX_JOINTS>,
}

/// What a motor controller reports about itself: protocol version, firmware and joints.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// Protocol version of the motor controller, [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION). A
    /// host refuses every version except its own.
    pub protocol: u16,
    /// Name and version of the firmware, for people to read.
    pub firmware: heapless::String<MAX_FIRMWARE_BYTES>,
    /// The joints of the port. Commands and feedback list them in the same order.
    pub joints: heapless::Vec<JointDescription, MAX_JOINTS>,
}

/// The properties of one joint that a motor controller reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JointDescription {
    /// Encoder counts per turn of the encoder, which is on the motor side of the gear; 1 or more.
    /// The host compares the number with the rig file.
    pub counts_per_turn: u32,
}

/// The answer of a motor controller to a command: its state, and a reading of every joint. All
/// joints are sampled at the moment when the command arrives.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// Sequence number of the command that is answered ([`Command::sequence`]).
    pub sequence: u32,
    /// State of the motor controller after it has processed the command.
    pub flags: ControllerFlags,
    /// One reading per joint, in the order of the description.
    pub joints: heapless::Vec<JointReading, MAX_JOINTS>,
}

/// The reading of one joint: position, rate, current and temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointReading {
    /// Position of the encoder, which is on the motor side of the gear, in counts. It wraps from
    /// [`i32::MAX`] to [`i32::MIN`] and back. So the motion between two readings is their wrapping
    /// difference.
    pub count: i32,
    /// Rate of the joint, after the gear, rad/s. Positive towards greater encoder counts.
    pub rate: f32,
    /// Motor current, A. A positive current drives the joint towards greater encoder counts. 0 if
    /// the current is not measured.
    pub current: f32,
    /// Temperature of the motor, degrees Celsius. 0 if it is not measured.
    pub temperature: f32,
    /// State of the joint as a set of flags.
    pub flags: JointFlags,
}

pub(crate) mod sealed {
    use crate::{MAX_COMMAND_FRAME, MAX_FEEDBACK_FRAME};
    use core::fmt::Debug;

    /// What only this crate knows of a type of message.
    pub trait Sealed {
        /// Memory for the longest frame.
        type Frame: Clone + Debug + AsMut<[u8]>;
        const NO_FRAME: Self::Frame;
    }

    impl Sealed for super::ToController {
        type Frame = [u8; MAX_COMMAND_FRAME];
        const NO_FRAME: Self::Frame = [0; MAX_COMMAND_FRAME];
    }

    impl Sealed for super::FromController {
        type Frame = [u8; MAX_FEEDBACK_FRAME];
        const NO_FRAME: Self::Frame = [0; MAX_FEEDBACK_FRAME];
    }
}

/// A type of message that is sent as one frame: [`ToController`] or [`FromController`]. The trait
/// is sealed, so other crates cannot implement it.
pub trait Message: Serialize + DeserializeOwned + sealed::Sealed {
    /// Length of the longest frame with a message of this type, in bytes, with its delimiter. A
    /// buffer of this size is always large enough.
    const MAX_FRAME: usize;
}

impl Message for ToController {
    const MAX_FRAME: usize = MAX_COMMAND_FRAME;
}

impl Message for FromController {
    const MAX_FRAME: usize = MAX_FEEDBACK_FRAME;
}
