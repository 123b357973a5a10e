//! From the bytes on the line to messages, in whatever pieces the bytes arrive.

use crate::Message;
use crate::frame::{CRC, CRC_BYTES, DELIMITER, MAX_FRAME};
use core::{fmt, marker::PhantomData};

/// Collects bytes until a delimiter and makes a message, or an error, of what came before it.
///
/// Frames may arrive in halves, several at once, or behind garbage. Every frame gives one result, in the
/// order of the line; a frame that is refused takes none of the next with it, since the search begins anew at
/// each zero. Two zeros in a row are an empty frame and are skipped silently, so a sender may end whatever
/// came before with an extra zero. The first result after a port is opened may be an error, where reading
/// began in the midst of a frame.
#[derive(Clone, Debug)]
pub struct Decoder<M> {
    /// What came since the last delimiter, still in COBS, in the first `length` bytes.
    frame: [u8; MAX_FRAME],
    length: usize,
    /// This frame has been refused as too long: nothing is kept until its delimiter.
    skipping: bool,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Decoder<M> {
    /// A decoder at the start of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self { frame: [0; MAX_FRAME], length: 0, skipping: false, message: PhantomData }
    }

    /// Takes one byte in and returns the result that it completes, if any.
    pub fn push(&mut self, byte: u8) -> Option<Result<M, FrameError>> {
        if byte == DELIMITER { self.finish() } else { self.collect(&[byte]).map(Err) }
    }

    /// Takes any number of bytes in and hands each result that they complete to `each`: the same results as
    /// [`push`](Self::push) for every byte, and quicker.
    pub fn feed(&mut self, bytes: &[u8], mut each: impl FnMut(Result<M, FrameError>)) {
        let mut pieces = bytes.split(|byte| *byte == DELIMITER);
        let unfinished = pieces.next_back().unwrap_or_default();
        for piece in pieces {
            if let Some(error) = self.collect(piece) {
                each(Err(error));
            }
            if let Some(result) = self.finish() {
                each(result);
            }
        }
        if let Some(error) = self.collect(unfinished) {
            each(Err(error));
        }
    }

    /// Forgets a frame begun, as after the port was opened anew.
    pub const fn reset(&mut self) {
        self.length = 0;
        self.skipping = false;
    }

    /// Keeps bytes without a delimiter; an error where the frame has just become too long.
    fn collect(&mut self, bytes: &[u8]) -> Option<FrameError> {
        if self.skipping {
            return None;
        }
        let end = self.length + bytes.len();
        // The delimiter itself is never kept.
        if end > M::MAX_FRAME - 1 {
            self.skipping = true;
            return Some(FrameError::TooLong);
        }
        self.frame[self.length..end].copy_from_slice(bytes);
        self.length = end;
        None
    }

    /// The result of the frame that a delimiter ends, if it has not had one.
    fn finish(&mut self) -> Option<Result<M, FrameError>> {
        let had_its_result = self.skipping || self.length == 0;
        let length = self.length;
        self.reset();
        if had_its_result { None } else { Some(decode(&mut self.frame[..length])) }
    }
}

impl<M: Message> Default for Decoder<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// The message in a frame without its delimiter; the frame is overwritten.
fn decode<M: Message>(frame: &mut [u8]) -> Result<M, FrameError> {
    let length = cobs::decode_in_place(frame).map_err(|_| FrameError::Cobs)?;
    let (body, check) = frame[..length].split_last_chunk::<CRC_BYTES>().ok_or(FrameError::TooShort)?;
    if body.is_empty() {
        return Err(FrameError::TooShort);
    }
    if CRC.checksum(body) != u32::from_le_bytes(*check) {
        return Err(FrameError::Crc);
    }
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Ok(message),
        Ok(_) | Err(_) => Err(FrameError::Body),
    }
}

/// Why a frame was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameError {
    /// More bytes without a delimiter than the longest frame has. Told once, as soon as it is so; the rest of
    /// the frame is skipped. Common causes: another device or baud rate, a delimiter lost.
    TooLong,
    /// A COBS code points past the end of the frame: bytes were lost or a delimiter came too early.
    Cobs,
    /// Too few bytes for a body and its check.
    TooShort,
    /// The check does not match the body: the frame was damaged on the line.
    Crc,
    /// The check matches, but the body is no message of this direction and protocol version, or bytes are
    /// left over after it. The sender is of another version or at fault; the line is not.
    Body,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "serial frame refused: longer than any of the protocol, no delimiter seen",
            Self::Cobs => "serial frame refused: a COBS code points past its end",
            Self::TooShort => "serial frame refused: too short for a body and its CRC-32",
            Self::Crc => "serial frame refused: its CRC-32 does not match its body",
            Self::Body => "serial frame refused: intact, but its body is no message of this protocol version",
        })
    }
}

impl core::error::Error for FrameError {}
