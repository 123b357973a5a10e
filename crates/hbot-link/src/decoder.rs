//! Decodes bytes from the line into messages. The bytes can arrive in pieces of any size.

use crate::Message;
use crate::frame::{CRC, CRC_BYTES, DELIMITER, MAX_FRAME};
use core::{fmt, marker::PhantomData};

/// Collects bytes up to a delimiter and decodes them into a message or an error.
///
/// Frames can arrive in parts, several at once, or after garbage. Every frame gives one result, in
/// the order of arrival. A refused frame does not affect the next one, because each zero byte
/// starts a new search. Two zeros in a row are an empty frame and are skipped silently, so a sender
/// can end old bytes with an extra zero. The first result after a port is opened can be an error,
/// if reading began in the middle of a frame.
#[derive(Clone, Debug)]
pub struct Decoder<M> {
    /// The bytes since the last delimiter, still in COBS, in the first `length` bytes.
    frame: [u8; MAX_FRAME],
    length: usize,
    /// True if this frame has been refused as too long. Its bytes are dropped up to the delimiter.
    skipping: bool,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Decoder<M> {
    /// Creates a decoder at the start of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self { frame: [0; MAX_FRAME], length: 0, skipping: false, message: PhantomData }
    }

    /// Takes one byte. Returns a message or an error if the byte completes a frame.
    pub fn push(&mut self, byte: u8) -> Option<Result<M, FrameError>> {
        if byte == DELIMITER { self.finish() } else { self.collect(&[byte]).map(Err) }
    }

    /// Takes any number of bytes and calls `each` with every result that they complete. The results
    /// are those of [`push`](Self::push) for every byte, but this is faster.
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

    /// Drops an incomplete frame, for example after the port was reopened.
    pub const fn reset(&mut self) {
        self.length = 0;
        self.skipping = false;
    }

    /// Stores bytes that contain no delimiter. Returns an error if the frame has just become too
    /// long.
    fn collect(&mut self, bytes: &[u8]) -> Option<FrameError> {
        if self.skipping {
            return None;
        }
        let end = self.length + bytes.len();
        // The delimiter itself is never stored.
        if end > M::MAX_FRAME - 1 {
            self.skipping = true;
            return Some(FrameError::TooLong);
        }
        self.frame[self.length..end].copy_from_slice(bytes);
        self.length = end;
        None
    }

    /// Ends the frame at a delimiter. Returns its result, unless it is empty or was already
    /// refused.
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

/// Decodes the message in a frame without its delimiter. Overwrites the frame.
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

/// The reason why a frame was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameError {
    /// More bytes arrived without a delimiter than the longest frame has. Reported once,
    /// immediately; the rest of the frame is skipped. Common causes are another device, another
    /// baud rate or a lost delimiter.
    TooLong,
    /// A COBS code points beyond the end of the frame: bytes were lost or a delimiter came too
    /// early.
    Cobs,
    /// The frame has too few bytes for a body and its check.
    TooShort,
    /// The check does not match the body: the frame was damaged on the line.
    Crc,
    /// The check matches, but the body is not a message of this direction and protocol version, or
    /// bytes are left over after it. The sender has another version or is faulty; the line is in
    /// order.
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
