//! Decodes bytes from the line into messages. The bytes can arrive in pieces of any size.

use crate::Message;
use crate::frame::{CRC, CRC_BYTES, DELIMITER};
use core::{fmt, marker::PhantomData};

/// Collects bytes from the line and decodes each frame into a message or an error. A frame ends at
/// a delimiter, the byte 0.
///
/// Frames can arrive in parts, several at once, or after garbage. Every frame gives one result, in
/// the order of arrival. A refused frame does not affect the next one, because decoding starts anew
/// after each delimiter. Two delimiters in a row enclose an empty frame, which is skipped without
/// an error. So a sender can begin with an extra delimiter, to end any bytes that were sent before.
/// If reading began in the middle of a frame, the first result can be an error.
#[derive(Clone, Debug)]
pub struct Decoder<M: Message> {
    /// The bytes received since the last delimiter, still COBS-encoded. Only the first `length`
    /// bytes are valid.
    frame: M::Frame,
    length: usize,
    /// True if this frame was already refused because it is too long. Its bytes are then dropped up
    /// to the delimiter.
    skipping: bool,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Decoder<M> {
    /// Creates a decoder that expects the start of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self { frame: M::NO_FRAME, length: 0, skipping: false, message: PhantomData }
    }

    /// Takes one byte from the line. Returns a message or an error if the byte completes a frame.
    pub fn push(&mut self, byte: u8) -> Option<Result<M, FrameError>> {
        if byte == DELIMITER { self.finish() } else { self.collect(&[byte]).map(Err) }
    }

    /// Takes any number of bytes from the line, and calls `each` with the result of every frame
    /// that they complete. The results are those of [`push`](Self::push) for each byte, but this
    /// function is faster.
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

    /// Drops an incomplete frame. Useful after the port was reopened.
    pub const fn reset(&mut self) {
        self.length = 0;
        self.skipping = false;
    }

    /// Stores bytes of a frame that contain no delimiter. Returns an error if they make the frame
    /// too long.
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
        self.frame.as_mut()[self.length..end].copy_from_slice(bytes);
        self.length = end;
        None
    }

    /// Ends the frame at a delimiter and returns its result. Returns `None` if the frame is empty
    /// or was already refused.
    fn finish(&mut self) -> Option<Result<M, FrameError>> {
        let had_its_result = self.skipping || self.length == 0;
        let length = self.length;
        self.reset();
        if had_its_result { None } else { Some(decode(&mut self.frame.as_mut()[..length])) }
    }
}

impl<M: Message> Default for Decoder<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// Decodes the message in a frame. The frame must not contain its delimiter; its bytes are
/// overwritten.
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
    /// More bytes arrived without a delimiter than the longest frame has. The error is reported at
    /// once and only once, and the rest of the frame is skipped. Common causes are a different
    /// device on the line, a different baud rate, or a lost delimiter.
    TooLong,
    /// A COBS code byte points beyond the end of the frame. Bytes were lost, or a delimiter came
    /// too early.
    Cobs,
    /// The frame has too few bytes to contain a body and its CRC.
    TooShort,
    /// The CRC does not match the body: the frame was damaged on the line.
    Crc,
    /// The CRC matches, but the body is not a message of this direction and protocol version, or
    /// bytes are left over after the message. The line works, but the sender has another protocol
    /// version or is faulty.
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
