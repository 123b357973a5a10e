//! Messages for tests, and the tests of the crate as a whole.

mod golden;
mod line;

use crate::*;
use heapless::{String, Vec};
use std::vec::Vec as StdVec;

/// A message for tests, to or from a motor controller.
#[expect(clippy::large_enum_variant, reason = "a test may waste a few bytes")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum AnyMessage {
    To(ToController),
    From(FromController),
}

impl AnyMessage {
    pub(crate) fn encode_into(&self, buffer: &mut [u8]) -> Result<usize, EncodeError> {
        match self {
            Self::To(message) => encode(message, buffer),
            Self::From(message) => encode(message, buffer),
        }
    }

    pub(crate) fn encoded(&self) -> StdVec<u8> {
        let mut buffer = [0; MAX_FEEDBACK_FRAME];
        let length = self.encode_into(&mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    pub(crate) fn body(&self) -> StdVec<u8> {
        let mut buffer = [0; MAX_FEEDBACK_FRAME];
        match self {
            Self::To(message) => postcard::to_slice(message, &mut buffer).unwrap().to_vec(),
            Self::From(message) => postcard::to_slice(message, &mut buffer).unwrap().to_vec(),
        }
    }

    /// Feeds `pieces` to a decoder for messages of the same direction as this one. Returns the
    /// decoder's results.
    pub(crate) fn decode(&self, pieces: &[&[u8]]) -> StdVec<Result<AnyMessage, FrameError>> {
        match self {
            Self::To(_) => decode_all(pieces, Self::To),
            Self::From(_) => decode_all(pieces, Self::From),
        }
    }
}

pub(crate) fn decode_all<M: Message>(
    pieces: &[&[u8]],
    sample: impl Fn(M) -> AnyMessage,
) -> StdVec<Result<AnyMessage, FrameError>> {
    let mut decoder = Decoder::<M>::default();
    let mut results = StdVec::new();
    for piece in pieces {
        decoder.feed(piece, |result| results.push(result.map(&sample)));
    }
    results
}

/// A float without a zero byte. COBS adds the most bytes to data without zeros, so frames of such
/// floats are as long as possible.
const FULL_F32: f32 = f32::from_bits(0x7F7F_7F7F);

pub(crate) fn largest_command(joints: usize) -> Command {
    let torque = Vec::from_slice(&[FULL_F32; MAX_JOINTS][..joints]).unwrap();
    Command { sequence: u32::MAX, enable: true, watchdog_ms: u16::MAX, torque }
}

pub(crate) fn largest_feedback(joints: usize) -> Feedback {
    let reading = JointReading {
        count: i32::MIN,
        rate: FULL_F32,
        current: FULL_F32,
        temperature: FULL_F32,
        flags: JointFlags::from_bits(u16::MAX),
    };
    Feedback {
        sequence: u32::MAX,
        flags: ControllerFlags::from_bits(u16::MAX),
        joints: Vec::from_slice(&[reading; MAX_JOINTS][..joints]).unwrap(),
    }
}

pub(crate) fn largest_description(joints: usize) -> Description {
    let joint = JointDescription { counts_per_turn: u32::MAX };
    Description {
        protocol: u16::MAX,
        firmware: String::try_from("0123456789abcdef0123456789abcdef").unwrap(),
        joints: Vec::from_slice(&[joint; MAX_JOINTS][..joints]).unwrap(),
    }
}

/// Returns the messages whose bytes are listed in docs/link.md, with the names that they have on
/// that page.
pub(crate) fn all_samples() -> StdVec<(&'static str, AnyMessage)> {
    let command = |sequence, enable, torque: &[f32]| {
        let torque = Vec::from_slice(torque).unwrap();
        AnyMessage::To(ToController::Command(Command { sequence, enable, watchdog_ms: 20, torque }))
    };
    let feedback = |sequence, flags, joints: &[JointReading]| {
        let joints = Vec::from_slice(joints).unwrap();
        AnyMessage::From(FromController::Feedback(Feedback { sequence, flags, joints }))
    };
    let joint =
        |count, rate, current, temperature, flags| JointReading { count, rate, current, temperature, flags };
    let counts = |counts_per_turn| JointDescription { counts_per_turn };
    std::vec![
        ("describe", AnyMessage::To(ToController::Describe)),
        (
            "description",
            AnyMessage::From(FromController::Description(Description {
                protocol: 1,
                firmware: String::try_from("example 1.0.0").unwrap(),
                joints: Vec::from_slice(&[counts(65_536), counts(65_536), counts(8192), counts(8192)])
                    .unwrap(),
            })),
        ),
        ("command_disable", command(0, false, &[0.0; 4])),
        ("command_enable", command(1000, true, &[0.25, -0.5, 1.0, -0.0625])),
        ("command_wrap", command(u32::MAX, true, &[f32::MIN_POSITIVE, f32::MAX])),
        (
            "feedback_after_boot",
            feedback(0, ControllerFlags::UNDESCRIBED, &[joint(0, 0.0, 0.0, 21.5, JointFlags::empty())]),
        ),
        (
            "feedback_enabled",
            feedback(
                1000,
                ControllerFlags::ENABLED,
                &[
                    joint(1, 0.5, 0.125, 24.0, JointFlags::INDEX_SEEN),
                    joint(-1, -0.5, -0.25, 24.5, JointFlags::INDEX_SEEN),
                    joint(i32::MAX, 6.25, 0.5, 31.0, JointFlags::empty()),
                    joint(
                        i32::MIN,
                        -6.25,
                        -0.03125,
                        30.75,
                        JointFlags::OVERCURRENT | JointFlags::OVERTEMPERATURE
                    ),
                ],
            ),
        ),
        (
            "feedback_watchdog",
            feedback(1300, ControllerFlags::WATCHDOG_EXPIRED | ControllerFlags::FAULT, &[])
        ),
        ("feedback_largest", AnyMessage::From(FromController::Feedback(largest_feedback(MAX_JOINTS)))),
    ]
}
