//! The serial protocol between the rig PC of an Hbot (the *host*) and its motor controllers:
//! messages, frames, and a decoder that recovers from a damaged line. The crate needs neither the
//! standard library nor an allocator, so firmware can use it too. `docs/link.md` describes the same
//! bytes for firmware in any other language.
//!
//! # Layers, top to bottom
//!
//! | layer | here | purpose |
//! |---|---|---|
//! | message | [`ToController`], [`FromController`] | a description, torques or readings |
//! | body | [postcard] | integers as varints, `f32` little endian |
//! | check | CRC-32/ISO-HDLC | four bytes, little endian, after the body |
//! | frame | COBS | removes every zero; adds one byte per 254 bytes begun |
//! | delimiter | one byte `0x00` | ends the frame; the only zero on the line |
//!
//! A reader that starts in the middle of a frame finds the next one at the delimiter.
//!
//! [`encode`] applies all layers and writes into a buffer of the caller. A [`Decoder`] reverses
//! them. It takes bytes in pieces of any size, as the port delivers them.
//!
//! # Request and answer
//!
//! A controller sends only when it receives a request. It answers [`ToController::Describe`] with a
//! [`Description`], and each valid [`Command`] with a [`Feedback`] that repeats the command's
//! `sequence`. In each tick, one command and one feedback carry all joints of a port, in the order
//! of the description.
//!
//! # What this crate checks, and what it does not
//!
//! A frame is accepted or refused as a whole. A refused frame gives a [`FrameError`]. In an
//! accepted frame every bit pattern of a field passes unchanged: NaN and infinite floats, unknown
//! flags, implausible currents. Values are checked by the receiver: on the host by the core, on a
//! controller by its own limits (see [`Command`]).
//!
//! [postcard]: https://postcard.jamesmunns.com/wire-format
//!
//! ```
//! use hbot_link::{Command, Decoder, MAX_COMMAND_FRAME, ToController, encode};
//!
//! let torque = heapless::Vec::from_slice(&[0.25, -0.5]).unwrap();
//! let command = Command { sequence: 7, enable: true, watchdog_ms: 20, torque };
//! let message = ToController::Command(command);
//! let mut buffer = [0; MAX_COMMAND_FRAME];
//! let length = encode(&message, &mut buffer).unwrap();
//!
//! let mut decoder = Decoder::<ToController>::default();
//! let mut received = None;
//! decoder.feed(&buffer[..length], |result| received = Some(result));
//! assert_eq!(received, Some(Ok(message)));
//! ```
#![no_std]

#[cfg(test)]
extern crate std;

mod decoder;
mod flags;
mod frame;
mod message;
#[cfg(test)]
mod tests;

pub use decoder::{Decoder, FrameError};
pub use flags::{ControllerFlags, JointFlags};
pub use frame::{
    BITS_PER_BYTE, EncodeError, MAX_COMMAND_FRAME, MAX_DESCRIPTION_FRAME, MAX_FEEDBACK_FRAME,
    command_frame_bytes, description_frame_bytes, encode, feedback_frame_bytes,
};
pub use message::{
    Command, Description, Feedback, FromController, JointDescription, JointReading, Message, ToController,
};

/// Version of the serial protocol. It increases with every change to the bytes on the line. Host
/// and motor controller must have the same version; the controller reports its version in its
/// [`Description`].
pub const PROTOCOL_VERSION: u16 = 1;

/// Largest number of joints on one serial port. A rig with more joints needs several ports.
pub const MAX_JOINTS: usize = 16;

/// Largest length of the firmware's name, [`Description::firmware`], in bytes of UTF-8.
pub const MAX_FIRMWARE_BYTES: usize = 32;
