//! Splits the bytes of a connection into messages. The bytes can arrive in pieces of any size.

use crate::encoding::LENGTH_BYTES;
use crate::{Encoding, MAX_REQUEST_BYTES, asks_estop};

/// Finds where messages begin and end in the bytes of a connection.
///
/// A message is returned whole or refused whole. Refusing one does not affect the next. Lines can
/// end with `\r\n`. Blank lines and frames of length zero are skipped. Memory is bounded by twice
/// the bytes that are pushed before they are taken out. A message that is too long is refused as
/// soon as this is known, before memory is reserved for it.
#[derive(Clone, Debug)]
pub struct Splitter {
    encoding: Encoding,
    limit: usize,
    /// Bytes received. Those from `start` on have not been taken out yet.
    bytes: Vec<u8>,
    start: usize,
    /// Number of untaken bytes known to contain no newline. A long line that arrives in small
    /// pieces is thus searched only once.
    searched: usize,
    skipping: Skipping,
}

/// The part of a refused message that still has to be skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Skipping {
    Nothing,
    ToNewline,
    Bytes(usize),
}

impl Splitter {
    /// Creates a splitter for requests, with the limit [`MAX_REQUEST_BYTES`].
    #[must_use]
    pub const fn new(encoding: Encoding) -> Self {
        Self::with_limit(encoding, MAX_REQUEST_BYTES)
    }

    /// Creates a splitter with another size limit. The limit is in bytes of a line including its
    /// newline, or of a map without its length.
    #[must_use]
    pub const fn with_limit(encoding: Encoding, limit: usize) -> Self {
        Self { encoding, limit, bytes: Vec::new(), start: 0, searched: 0, skipping: Skipping::Nothing }
    }

    /// Returns the encoding of the next message.
    #[must_use]
    pub const fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Changes the encoding from the next untaken byte on, after a hello that asks for it.
    pub const fn set_encoding(&mut self, encoding: Encoding) {
        self.encoding = encoding;
        self.searched = 0;
    }

    /// Changes the size limit. It is in bytes of a line including its newline, or of a map without
    /// its length.
    pub const fn set_limit(&mut self, limit: usize) {
        self.limit = limit;
    }

    /// Returns the bytes that have arrived and are not yet part of a message that was taken out.
    #[must_use]
    pub fn waiting(&self) -> &[u8] {
        &self.bytes[self.start..]
    }

    /// Returns the number of bytes that have arrived and are not yet part of a message that was
    /// taken out. At the end of a connection, these bytes are an incomplete message.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.bytes.len() - self.start
    }

    /// Adds received bytes. Take out all messages before pushing more, or the memory grows.
    pub fn push(&mut self, bytes: &[u8]) {
        self.space(bytes.len()).extend_from_slice(bytes);
    }

    /// Returns the buffer to which received bytes can be appended directly, with room for `bytes`
    /// more. This replaces [`push`](Self::push) without a copy. Bytes already in the buffer must
    /// not be changed.
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

    /// Returns the next message without its newline or length, or the error if it is refused.
    /// Returns `None` if more bytes are needed.
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

    /// Skips any number of blank lines at once.
    fn pass_blank_lines(&mut self) {
        if self.searched == 0 {
            let waiting = &self.bytes[self.start..];
            let blanks = &waiting[..waiting.len() - waiting.trim_ascii_start().len()];
            // Blanks at the start of a line belong to that line.
            self.start += memchr::memrchr(b'\n', blanks).map_or(0, |last| last + 1);
        }
    }

    /// Returns the range of the next line in `bytes`, without the blanks around it. `None` if more
    /// bytes are needed.
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

    /// Returns the range of the next MessagePack map in `bytes`. `None` if more bytes are needed.
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

    /// Discards the bytes that belong to a refused message.
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
    /// The message is longer than the limit. This is reported once, and the rest of the message is
    /// skipped.
    #[error("message of {} bytes; at most {limit} are taken", Length(*length, *limit))]
    TooLarge {
        /// Size limit, in bytes.
        limit: usize,
        /// Size that the message announced, in bytes. `None` for a line, whose end has not been
        /// received.
        length: Option<usize>,
    },
    /// The length of a frame begins with `{`: JSON was sent although the hello asked for
    /// MessagePack. The announced bytes are skipped as for any frame that is too long. In practice
    /// nothing after it is read.
    #[error("JSON where the hello has asked for MessagePack: send a 4-byte length, then a map")]
    LooksLikeJson,
    /// A line is not UTF-8.
    #[error("line is not UTF-8 from byte {at} on")]
    NotUtf8 {
        /// Index of the first invalid byte in the line, from 0.
        at: usize,
    },
}

/// Writes the length of a message that is too long, or the limit if its length is not known.
struct Length(Option<usize>, usize);

impl std::fmt::Display for Length {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            Some(length) => write!(f, "{length}"),
            None => write!(f, "more than {}", self.1),
        }
    }
}
