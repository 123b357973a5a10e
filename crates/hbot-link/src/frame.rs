//! Encodes messages into frames, and computes the sizes of frames.

use crate::{MAX_FIRMWARE_BYTES, MAX_JOINTS, Message};
use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc};

/// Number of bits on the line per byte: a start bit, eight data bits and a stop bit (8N1). For one
/// direction of a line, the lowest possible baud rate is this number times bytes per frame times
/// frames per second.
pub const BITS_PER_BYTE: usize = 10;

/// Length of the longest frame to a motor controller, in bytes. It is [`command_frame_bytes`] for
/// [`MAX_JOINTS`] joints.
pub const MAX_COMMAND_FRAME: usize = command_frame_bytes(MAX_JOINTS);

/// Length of the longest frame from a motor controller, in bytes. It is [`feedback_frame_bytes`]
/// for [`MAX_JOINTS`] joints.
pub const MAX_FEEDBACK_FRAME: usize = feedback_frame_bytes(MAX_JOINTS);

/// Length of the longest frame with a [`Description`](crate::Description), in bytes. It is
/// [`description_frame_bytes`] for [`MAX_JOINTS`] joints.
pub const MAX_DESCRIPTION_FRAME: usize = description_frame_bytes(MAX_JOINTS);

/// Returns the length of the longest frame with a [`Command`](crate::Command) for `joints` joints,
/// in bytes, with its delimiter.
///
/// # Preconditions
///
/// `joints` is at most [`MAX_JOINTS`], because no message holds more.
#[must_use]
pub const fn command_frame_bytes(joints: usize) -> usize {
    let header = VARIANT + VARINT_U32 + BOOL + VARINT_U16 + COUNT;
    frame_bytes(header + joints * F32)
}

/// Returns the length of the longest frame with a [`Feedback`](crate::Feedback) for `joints`
/// joints, in bytes, with its delimiter. A real frame can be shorter, because small numbers are
/// encoded in fewer bytes.
///
/// # Preconditions
///
/// `joints` is at most [`MAX_JOINTS`], because no message holds more.
#[must_use]
pub const fn feedback_frame_bytes(joints: usize) -> usize {
    let header = VARIANT + VARINT_U32 + VARINT_U16 + COUNT;
    let joint = VARINT_U32 + 3 * F32 + VARINT_U16;
    frame_bytes(header + joints * joint)
}

/// Returns the length of the longest frame with a [`Description`](crate::Description) of `joints`
/// joints, in bytes, with its delimiter.
///
/// # Preconditions
///
/// `joints` is at most [`MAX_JOINTS`], because no message holds more.
#[must_use]
pub const fn description_frame_bytes(joints: usize) -> usize {
    let header = VARIANT + VARINT_U16 + COUNT + MAX_FIRMWARE_BYTES + COUNT;
    frame_bytes(header + joints * VARINT_U32)
}

/// Encodes `message` as a frame with its delimiter, and writes it to the start of `buffer`. Returns
/// the length of the frame in bytes. A buffer of `M::MAX_FRAME` bytes is always large enough.
///
/// # Errors
///
/// Returns [`EncodeError::BufferTooSmall`] if the frame does not fit into `buffer`. The content of
/// `buffer` is then invalid.
pub fn encode<M: Message>(message: &M, buffer: &mut [u8]) -> Result<usize, EncodeError> {
    let too_small = EncodeError::BufferTooSmall { given: buffer.len(), enough: M::MAX_FRAME };
    let mut scratch = [0; MAX_CHECKED_BODY];
    // The sizes above are those of the largest messages. So every message fits the scratch buffer,
    // and this error cannot occur.
    let body =
        postcard::to_slice(message, &mut scratch[..MAX_CHECKED_BODY - CRC_BYTES]).map_err(|_| too_small)?;
    let length = body.len();
    let check = CRC.checksum(body);
    scratch[length..length + CRC_BYTES].copy_from_slice(&check.to_le_bytes());

    let end = cobs::try_encode(&scratch[..length + CRC_BYTES], buffer).map_err(|_| too_small)?;
    // If the last byte is a zero, `try_encode` may count a code byte that did not fit. Then `end`
    // is outside of the buffer and the frame is refused here.
    *buffer.get_mut(end).ok_or(too_small)? = DELIMITER;
    Ok(end + 1)
}

/// The reason why a message could not be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeError {
    /// The frame does not fit into the buffer.
    BufferTooSmall {
        /// Size of the buffer, in bytes.
        given: usize,
        /// Size that is large enough for every message of this type, in bytes.
        enough: usize,
    },
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::BufferTooSmall { given, enough } = self;
        write!(f, "serial frame does not fit a buffer of {given} bytes; {enough} always suffice")
    }
}

impl core::error::Error for EncodeError {}

/// The byte that ends a frame. COBS encoding ensures that it occurs nowhere else in a frame.
pub(crate) const DELIMITER: u8 = 0;

/// Number of bytes of the CRC that follows the body of a frame.
pub(crate) const CRC_BYTES: usize = 4;

/// How the CRC is computed: with the table that the features of this crate choose.
#[cfg(feature = "crc-table-16")]
type Way = crc::Table<16>;
#[cfg(all(feature = "crc-table", not(feature = "crc-table-16")))]
type Way = crc::Table<1>;
#[cfg(not(any(feature = "crc-table", feature = "crc-table-16")))]
type Way = crc::NoTable;

/// Computes the CRC of a frame's body.
pub(crate) static CRC: Crc<u32, Way> = Crc::<u32, Way>::new(&CRC_32_ISO_HDLC);

/// Length of the longest frame in either direction, with its delimiter, in bytes.
pub(crate) const MAX_FRAME: usize = MAX_FEEDBACK_FRAME;

/// Length of the longest body in either direction together with its CRC, in bytes. A frame is at
/// least two bytes longer: COBS adds one or more, and the delimiter is another.
const MAX_CHECKED_BODY: usize = MAX_FRAME - 2;

const _: () = assert!(MAX_COMMAND_FRAME <= MAX_FRAME && MAX_DESCRIPTION_FRAME <= MAX_FRAME);

/// Largest number of bytes of a `u32` in the body of a frame. Integers are encoded as varints, with
/// 7 bits per byte. The next constants are for the other types.
const VARINT_U32: usize = 5;
const VARINT_U16: usize = 3;
const F32: usize = 4;
const BOOL: usize = 1;
/// Number of bytes of an enum variant's index. It is a varint below 128, so it takes one byte.
const VARIANT: usize = 1;
/// Number of bytes of the count before a list or a string. It is a varint below 128, so it takes
/// one byte.
const COUNT: usize = 1;
const _: () = assert!(MAX_JOINTS < 128 && MAX_FIRMWARE_BYTES < 128);

const fn frame_bytes(body: usize) -> usize {
    cobs::max_encoding_length(body + CRC_BYTES) + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{all_samples, largest_command, largest_description, largest_feedback};
    use crate::{FromController, ToController};
    use std::{format, vec};

    /// Checks that messages with the largest values have exactly the computed size, for each number
    /// of joints. This shows that the computed sizes are not larger than necessary.
    #[test]
    fn worst_case_sizes_are_exact() {
        let mut buffer = [0; MAX_FRAME];
        for joints in 0..=MAX_JOINTS {
            let command = ToController::Command(largest_command(joints));
            assert_eq!(encode(&command, &mut buffer), Ok(command_frame_bytes(joints)), "{joints} joints");
            let feedback = FromController::Feedback(largest_feedback(joints));
            assert_eq!(encode(&feedback, &mut buffer), Ok(feedback_frame_bytes(joints)), "{joints} joints");
            let description = FromController::Description(largest_description(joints));
            assert_eq!(
                encode(&description, &mut buffer),
                Ok(description_frame_bytes(joints)),
                "{joints} joints"
            );
        }
        assert_eq!((MAX_COMMAND_FRAME, MAX_FEEDBACK_FRAME, MAX_DESCRIPTION_FRAME), (81, 337, 124));
    }

    #[test]
    fn every_buffer_too_small_is_refused_and_the_smallest_that_fits_is_taken() {
        for (name, sample) in all_samples() {
            let frame = sample.encoded();
            for given in 0..frame.len() {
                let error = sample.encode_into(&mut vec![0xA5; given]);
                assert!(
                    matches!(error, Err(EncodeError::BufferTooSmall { given: g, .. }) if g == given),
                    "{name}, {given}"
                );
            }
            let mut exact = vec![0xA5; frame.len()];
            assert_eq!(sample.encode_into(&mut exact), Ok(frame.len()), "{name}");
            assert_eq!(exact, frame, "{name}");
        }
    }

    /// Checks that a buffer that is one byte too short is refused even if the CRC ends in a zero
    /// byte. This case is special, because nothing then follows the last COBS code byte. About one
    /// CRC in 256 ends in zero, so a few thousand sequence numbers give several.
    #[test]
    fn a_check_that_ends_in_zero_is_framed_whole() {
        let mut buffer = [0; MAX_COMMAND_FRAME];
        let mut found = 0;
        for sequence in 0..4096 {
            let mut command = largest_command(2);
            command.sequence = sequence;
            let message = ToController::Command(command);
            let length = encode(&message, &mut buffer).unwrap();
            if buffer[length - 2] == 1 {
                found += 1;
                assert!(encode(&message, &mut buffer[..length - 1]).is_err());
                assert!(encode(&message, &mut buffer[..length - 2]).is_err());
            }
        }
        assert!(found > 0);
    }

    #[test]
    fn the_check_is_the_crc_that_the_page_names() {
        assert_eq!(CRC.checksum(b"123456789"), 0xCBF4_3926);
    }

    /// Checks that the three ways to compute the CRC give the same result, for each length of a
    /// body. This test compares them whichever features are chosen.
    #[test]
    fn the_check_is_the_same_with_each_table() {
        let body: [u8; MAX_FRAME] = core::array::from_fn(|i| (i * i + 7 * i) as u8);
        let (none, small, large) = (
            Crc::<u32, crc::NoTable>::new(&CRC_32_ISO_HDLC),
            Crc::<u32, crc::Table<1>>::new(&CRC_32_ISO_HDLC),
            Crc::<u32, crc::Table<16>>::new(&CRC_32_ISO_HDLC),
        );
        for length in 0..=MAX_FRAME {
            let body = &body[..length];
            let checks = [none.checksum(body), small.checksum(body), large.checksum(body)];
            assert_eq!(checks, [CRC.checksum(body); 3], "{length} bytes");
        }
    }

    #[test]
    fn errors_say_what_would_do() {
        let error = encode(&ToController::Describe, &mut [0; 3]).unwrap_err();
        assert_eq!(format!("{error}"), "serial frame does not fit a buffer of 3 bytes; 81 always suffice");
    }
}
