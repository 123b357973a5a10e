//! Splits the bytes of a connection into messages. The bytes can arrive in pieces of any size.

use crate::encoding::LENGTH_BYTES;
use crate::{Encoding, MAX_REQUEST_BYTES, asks_estop};

/// Splits the bytes of a connection into messages.
///
/// A message is returned whole or refused whole. Refusing one does not affect the next. Lines can
/// end with `\r\n`. Blank lines and frames of length zero are skipped. The memory in use is at most
/// twice the bytes that are pushed before messages are taken out. A message that is too long is
/// refused as soon as this is known, before memory is reserved for it.
#[derive(Clone, Debug)]
pub struct Splitter {
    encoding: Encoding,
    limit: usize,
    /// Bytes that were received. The bytes before `start` belong to messages that have been
    /// returned.
    bytes: Vec<u8>,
    start: usize,
    /// Number of bytes from `start` on that contain no newline. They need not be searched again
    /// when more bytes arrive.
    searched: usize,
    skipping: Skipping,
}

/// How much of a refused message still has to be skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Skipping {
    Nothing,
    ToNewline,
    Bytes(usize),
}

impl Splitter {
    /// Creates a splitter for requests. It refuses requests longer than [`MAX_REQUEST_BYTES`].
    #[must_use]
    pub const fn new(encoding: Encoding) -> Self {
        Self::with_limit(encoding, MAX_REQUEST_BYTES)
    }

    /// Creates a splitter for messages of at most `limit` bytes. The newline of a line counts, but
    /// the length before a MessagePack map does not.
    #[must_use]
    pub const fn with_limit(encoding: Encoding, limit: usize) -> Self {
        Self { encoding, limit, bytes: Vec::new(), start: 0, searched: 0, skipping: Skipping::Nothing }
    }

    /// Returns the encoding in which the next message is expected.
    #[must_use]
    pub const fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Changes the encoding of all messages that have not been returned yet, after a client has
    /// asked for another encoding.
    pub const fn set_encoding(&mut self, encoding: Encoding) {
        self.encoding = encoding;
        self.searched = 0;
    }

    /// Changes the largest size of a message, in bytes. The newline of a line counts, but the
    /// length before a MessagePack map does not.
    pub const fn set_limit(&mut self, limit: usize) {
        self.limit = limit;
    }

    /// Returns the received bytes that follow the last returned message.
    #[must_use]
    pub fn waiting(&self) -> &[u8] {
        &self.bytes[self.start..]
    }

    /// Returns the number of received bytes that follow the last returned message. At the end of a
    /// connection, these bytes are an incomplete message.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.bytes.len() - self.start
    }

    /// Adds received bytes. Call [`next_message`](Self::next_message) until it returns `None`
    /// before adding more, or the memory in use grows.
    pub fn push(&mut self, bytes: &[u8]) {
        self.space(bytes.len()).extend_from_slice(bytes);
    }

    /// Returns the buffer for received bytes, with room for `bytes` more. The caller appends to it
    /// directly, which avoids the copy that [`push`](Self::push) makes. The bytes already in the
    /// buffer must not be changed.
    pub fn space(&mut self, bytes: usize) -> &mut Vec<u8> {
        // Moves the waiting bytes only if at least as many have been taken. Otherwise many waiting
        // bytes would be moved for every message taken.
        if self.start >= self.pending() {
            self.bytes.drain(..self.start);
            self.start = 0;
        }
        self.bytes.reserve(bytes);
        &mut self.bytes
    }

    /// Returns the next message without the newline or length that frames it, or an error if the
    /// message is refused. Returns `None` if more bytes are needed.
    pub fn next_message(&mut self) -> Option<Result<&[u8], SplitError>> {
        loop {
            self.skip();
            if self.skipping != Skipping::Nothing {
                return None;
            }
            let found = match self.encoding {
                Encoding::Json => {
                    self.pass_blank_lines();
                    self.next_line()?
                }
                Encoding::Msgpack => self.next_map()?,
            };
            match found {
                Ok((from, to)) if from == to => {}
                Ok((from, to)) => return Some(Ok(&self.bytes[from..to])),
                Err(error) => return Some(Err(error)),
            }
        }
    }

    /// Skips all blank lines before the next message.
    fn pass_blank_lines(&mut self) {
        if self.searched == 0 {
            let waiting = &self.bytes[self.start..];
            let blanks = &waiting[..waiting.len() - waiting.trim_ascii_start().len()];
            // Blanks at the start of a line belong to that line.
            self.start += memchr::memrchr(b'\n', blanks).map_or(0, |last| last + 1);
        }
    }

    /// Returns the range in `bytes` of the next line, without blanks at its start and end. Returns
    /// `None` if more bytes are needed.
    fn next_line(&mut self) -> Option<Result<(usize, usize), SplitError>> {
        let waiting = &self.bytes[self.start..];
        // The newline must be within the limit.
        let within = &waiting[..waiting.len().min(self.limit)];
        let Some(length) = newline(&within[self.searched..]).map(|at| self.searched + at) else {
            self.searched = within.len();
            if within.len() < self.limit {
                return None;
            }
            self.searched = 0;
            self.skipping = Skipping::ToNewline;
            return Some(Err(SplitError::TooLarge { limit: self.limit, length: None }));
        };
        let from = self.start;
        self.start += length + 1;
        self.searched = 0;
        let line = &self.bytes[from..from + length];
        // Nearly every line is ASCII, which is quick to check.
        if !line.is_ascii()
            && let Err(error) = std::str::from_utf8(line)
            // A stop is obeyed even in a line that is not UTF-8.
            && !asks_estop(line)
        {
            return Some(Err(SplitError::NotUtf8 { at: error.valid_up_to() }));
        }
        let blanks = length - line.trim_ascii_start().len();
        Some(Ok((from + blanks, from + blanks + line.trim_ascii().len())))
    }

    /// Returns the range in `bytes` of the next MessagePack map, without its length. Returns `None`
    /// if more bytes are needed.
    fn next_map(&mut self) -> Option<Result<(usize, usize), SplitError>> {
        let length = *self.bytes[self.start..].first_chunk::<LENGTH_BYTES>()?;
        let (length, text) = (u32::from_be_bytes(length) as usize, length.starts_with(b"{"));
        let from = self.start + LENGTH_BYTES;
        if length > self.limit {
            self.start = from;
            self.skipping = Skipping::Bytes(length);
            return Some(Err(if text {
                SplitError::LooksLikeJson
            } else {
                SplitError::TooLarge { limit: self.limit, length: Some(length) }
            }));
        }
        if self.bytes.len() - from < length {
            return None;
        }
        self.start = from + length;
        Some(Ok((from, self.start)))
    }

    /// Discards the received bytes that belong to a refused message.
    fn skip(&mut self) {
        let waiting = &self.bytes[self.start..];
        match self.skipping {
            Skipping::Nothing => {}
            Skipping::ToNewline => match newline(waiting) {
                Some(at) => {
                    self.start += at + 1;
                    self.skipping = Skipping::Nothing;
                }
                None => self.start = self.bytes.len(),
            },
            Skipping::Bytes(left) => {
                let skipped = left.min(waiting.len());
                self.start += skipped;
                self.skipping =
                    if skipped == left { Skipping::Nothing } else { Skipping::Bytes(left - skipped) };
            }
        }
    }
}

fn newline(bytes: &[u8]) -> Option<usize> {
    memchr::memchr(b'\n', bytes)
}

/// The error returned when a message is refused before its content is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum SplitError {
    /// The message is longer than the limit. The error is returned once, and the rest of the
    /// message is skipped.
    #[error("message of {} bytes; at most {limit} are taken", Length(*length, *limit))]
    TooLarge {
        /// Largest legal size of a message, in bytes.
        limit: usize,
        /// Size of the message in bytes, as announced before it. `None` for a line, whose size is
        /// not known before its end.
        length: Option<usize>,
    },
    /// The client sent JSON although it had asked for MessagePack: the length of the message begins
    /// with `{`. The announced bytes are skipped, as with any message that is too long. They are so
    /// many that in practice no later message is read.
    #[error("JSON where the hello has asked for MessagePack: send a 4-byte length, then a map")]
    LooksLikeJson,
    /// A line of JSON is not valid UTF-8.
    #[error("line is not UTF-8 from byte {at} on")]
    NotUtf8 {
        /// Index of the first invalid byte in the line, counted from 0.
        at: usize,
    },
}

/// Displays the length of a message that is too long, or "more than" the limit if the length is not
/// known.
struct Length(Option<usize>, usize);

impl std::fmt::Display for Length {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            Some(length) => write!(f, "{length}"),
            None => write!(f, "more than {}", self.1),
        }
    }
}
