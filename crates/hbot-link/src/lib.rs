//! The serial line between an Hbot's rig PC (the *host*) and its motor controllers: messages, frames, and a
//! decoder that survives a bad line. Neither the standard library nor an allocator is used, so firmware links
//! the same crate. `docs/link.md` describes the same bytes for firmware in any other language.
//!
//! # Layers, top to bottom
//!
//! | layer | here | what it does |
//! |---|---|---|
//! | message | [`ToController`], [`FromController`] | what is said: a description, torques, readings |
//! | body | [postcard](https://postcard.jamesmunns.com/wire-format) | integers as varints, `f32` little endian |
//! | check | CRC-32/ISO-HDLC | four bytes little endian after the body |
//! | frame | COBS | takes every zero out of body and check, at a byte for each 254 begun |
//! | delimiter | one byte `0x00` | ends the frame; the one zero on the line, so a reader always finds back |
//!
//! [`encode`] goes down through all of them into a buffer of the caller's; a [`Decoder`] goes up, from bytes
//! in whatever pieces the port delivers.
//!
//! # The conversation
//!
//! A controller speaks when it is spoken to. [`ToController::Describe`] is answered by a [`Description`],
//! each valid [`Command`] by a [`Feedback`] with the command's `sequence`. One command and one feedback a
//! tick carry all joints of a port, in the order of the description.
//!
//! # What is judged here, and what is not
//!
//! A frame is accepted whole or refused whole, with a [`FrameError`]. Inside an accepted frame every bit
//! pattern of a field passes as it is: NaN and infinite floats, flags that have no name yet, implausible
//! currents. Judging values is left to those who know what is plausible: on the host the core's feedback
//! check, on a controller its own limits (see [`Command`]).
//!
//! ```
//! use hbot_link::{Command, Decoder, MAX_COMMAND_FRAME, ToController, encode};
//!
//! let torque = heapless::Vec::from_slice(&[0.25, -0.5]).unwrap();
//! let message = ToController::Command(Command { sequence: 7, enable: true, watchdog_ms: 20, torque });
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

/// The version that both sides must have in common; a [`Description`] says the controller's. It goes up with
/// every change to the bytes on the line.
pub const PROTOCOL_VERSION: u16 = 1;

/// The most joints that one port carries. A rig with more has several ports.
pub const MAX_JOINTS: usize = 16;

/// The longest [`Description::firmware`], in bytes of UTF-8.
pub const MAX_FIRMWARE_BYTES: usize = 32;
