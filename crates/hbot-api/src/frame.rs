//! From the bytes on a connection to messages, in whatever pieces the bytes arrive.

use crate::encoding::LENGTH_BYTES;
use crate::{Encoding, MAX_REQUEST_BYTES, asks_estop};

/// Finds where messages begin and end.
///
/// A message is taken whole or refused whole; one that is refused takes none of the next with it. Lines may end with
/// `\r\n`; lines of nothing but blanks and frames of length zero are passed over. Memory is bounded by twice what is pushed
/// before it is taken out: an over-long message is refused as soon as that is known, before room is made for it.
#[derive(Clone, Debug)]
pub struct Splitter {
    encoding: Encoding,
    limit: usize,
    /// Bytes not yet taken are those from `start` on.
    bytes: Vec<u8>,
    start: usize,
    /// So many of them hold no newline, so a long line that comes in small pieces is searched once.
    searched: usize,
    skipping: Skipping,
}

/// What is left of a message that has been refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Skipping {
    Nothing,
    ToNewline,
    Bytes(usize),
}

impl Splitter {
    /// A splitter of requests: [`MAX_REQUEST_BYTES`] at most.
    #[must_use]
    pub const fn new(encoding: Encoding) -> Self {
        Self::with_limit(encoding, MAX_REQUEST_BYTES)
    }

    /// A splitter with another limit, in bytes of a line with its newline, or of a map without its length.
    #[must_use]
    pub const fn with_limit(encoding: Encoding, limit: usize) -> Self {
        Self { encoding, limit, bytes: Vec::new(), start: 0, searched: 0, skipping: Skipping::Nothing }
    }

    /// The encoding in which the next message is looked for.
    #[must_use]
    pub const fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Goes over to another encoding from the next byte on that has not been taken: after a hello that asks for it.
    pub const fn set_encoding(&mut self, encoding: Encoding) {
        self.encoding = encoding;
        self.searched = 0;
    }

    /// Goes over to another limit, in bytes of a line with its newline, or of a map without its length.
    pub const fn set_limit(&mut self, limit: usize) {
        self.limit = limit;
    }

    /// The bytes that [`pending`](Self::pending) counts.
    #[must_use]
    pub fn waiting(&self) -> &[u8] {
        &self.bytes[self.start..]
    }

    /// Bytes that have come and are not yet part of a message taken. At the end of a connection: what was cut off.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.bytes.len() - self.start
    }

    /// Takes bytes in. Take all messages out before pushing more, or memory grows.
    pub fn push(&mut self, bytes: &[u8]) {
        self.space(bytes.len()).extend_from_slice(bytes);
    }

    /// Where bytes that come are to be appended, with room for so many: what [`push`](Self::push) does, in place. What stands there is
    /// not to be touched.
    pub fn space(&mut self, bytes: usize) -> &mut Vec<u8> {
        // Not for a few bytes each time, or many that wait would be moved for every message taken.
        if self.start >= self.pending() {
            self.bytes.drain(..self.start);
            self.start = 0;
        }
        self.bytes.reserve(bytes);
        &mut self.bytes
    }

    /// The next message without newline or length, or why one was refused; `None` where more bytes are needed.
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

    /// Passes over lines of nothing but blanks, however many, in one go.
    fn pass_blank_lines(&mut self) {
        if self.searched == 0 {
            let waiting = &self.bytes[self.start..];
            let blanks = &waiting[..waiting.len() - waiting.trim_ascii_start().len()];
            // The blanks before a line belong to it.
            self.start += memchr::memrchr(b'\n', blanks).map_or(0, |last| last + 1);
        }
    }

    /// Where in `bytes` the next line is, without the blanks around it.
    fn next_line(&mut self) -> Option<Result<(usize, usize), SplitError>> {
        let waiting = &self.bytes[self.start..];
        // A line may have its newline at the last byte allowed, and no later.
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
        // Nearly every line is ASCII, which is seen at once.
        if !line.is_ascii()
            && let Err(error) = std::str::from_utf8(line)
            // A stop is one in whatever company.
            && !asks_estop(line)
        {
            return Some(Err(SplitError::NotUtf8 { at: error.valid_up_to() }));
        }
        let blanks = length - line.trim_ascii_start().len();
        Some(Ok((from + blanks, from + blanks + line.trim_ascii().len())))
    }

    /// Where in `bytes` the next map is.
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

    /// Lets go of what belongs to a message refused.
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

/// Why a message was refused before its contents were looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum SplitError {
    /// More bytes than the limit. Told once; the rest of the message is skipped as it comes.
    #[error("message of {} bytes; at most {limit} are taken", Length(*length, *limit))]
    TooLarge {
        /// The most that is taken, bytes.
        limit: usize,
        /// What was announced, bytes; `None` for a line, whose end has not been seen.
        length: Option<usize>,
    },
    /// A frame's length begins with `{`: JSON was sent where a hello has asked for MessagePack. Its bytes are skipped
    /// like those of any frame too large, so in practice nothing after it is read.
    #[error("JSON where the hello has asked for MessagePack: send a 4-byte length, then a map")]
    LooksLikeJson,
    /// A line is not UTF-8.
    #[error("line is not UTF-8 from byte {at} on")]
    NotUtf8 {
        /// Where in the line the first wrong byte is, from 0.
        at: usize,
    },
}

/// How long a message is that is too long.
struct Length(Option<usize>, usize);

impl std::fmt::Display for Length {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            Some(length) => write!(f, "{length}"),
            None => write!(f, "more than {}", self.1),
        }
    }
}
