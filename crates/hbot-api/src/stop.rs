//! Stops found in bytes that nobody has split or parsed.
//!
//! A stop must not wait for the requests before it, and must be found in a message that is damaged. So it is looked for in the
//! bytes as they come: the key `op` with the value `estop` or `disable`, in JSON or MessagePack, at any depth, in letters of
//! either case. What is found by mistake stops the rig once too often, which harms nobody.

use crate::OpName;
use crate::names::names;
use memchr::memmem;

names! {
    /// A request that makes the rig safe.
    pub enum Stop {
        /// [`Op::Estop`](crate::Op::Estop).
        Estop = "estop",
        /// [`Op::Disable`](crate::Op::Disable).
        Disable = "disable",
    }
}

/// Blanks that may stand on either side of the colon in JSON.
const MAX_BLANKS: usize = 8;
/// The bytes of a match that may have come in earlier pieces: `"op"`, blanks, colon, blanks, and `"disable"` without its end.
const TAIL_BYTES: usize = 4 + MAX_BLANKS + 1 + MAX_BLANKS + 8;

/// Finds stops in a connection's bytes, in whatever pieces they come. Takes no memory beyond itself.
#[derive(Clone, Debug, Default)]
pub struct StopFinder {
    /// The end of what has come, `kept` bytes.
    tail: [u8; TAIL_BYTES],
    kept: usize,
}

impl StopFinder {
    /// Looks through the next piece: calls `found` with each stop and the number of bytes of the piece up to its end.
    pub fn push(&mut self, piece: &[u8], mut found: impl FnMut(Stop, usize)) {
        let mut joined = [0; 2 * TAIL_BYTES];
        let head = piece.len().min(TAIL_BYTES);
        let length = self.kept + head;
        joined[..self.kept].copy_from_slice(&self.tail[..self.kept]);
        joined[self.kept..length].copy_from_slice(&piece[..head]);
        each(&joined[..length], |at, value| {
            // Those that lie in one piece are found in it.
            if at < self.kept
                && let Some((stop, end)) = stop(value, at)
                && end > self.kept
            {
                found(stop, end - self.kept);
            }
        });
        each(piece, |at, value| {
            if let Some((stop, end)) = stop(value, at) {
                found(stop, end);
            }
        });
        let last = if piece.len() < TAIL_BYTES { &joined[..length] } else { piece };
        self.kept = last.len().min(TAIL_BYTES);
        self.tail[..self.kept].copy_from_slice(&last[last.len() - self.kept..]);
    }
}

/// Whether a message asks for an emergency stop, whatever else it holds and however damaged it is.
#[must_use]
pub fn asks_estop(message: &[u8]) -> bool {
    let mut asks = false;
    each(message, |_, value| asks |= value.is(Stop::Estop.as_str()).is_some());
    asks
}

/// Whether a message may be one of those that may be long ([`OpRow::long`](field@crate::OpRow::long)). Nothing is parsed.
#[must_use]
pub fn may_be_long(message: &[u8]) -> bool {
    let mut may = false;
    let long = OpName::ALL.into_iter().filter(|op| op.row().long);
    each(message, |_, value| may |= long.clone().any(|op| value.is(op.as_str()).is_some()));
    may
}

/// The bytes from the text that stands for the key `op`, and their encoding.
#[derive(Clone, Copy)]
enum Found<'a> {
    /// From the opening quote of the value on.
    Json(&'a [u8], usize),
    /// From the header of the value on.
    Msgpack(&'a [u8], usize),
}

impl Found<'_> {
    /// The bytes from the `o` of the key to the end of the value, if the value is `name`.
    fn is(self, name: &str) -> Option<usize> {
        let (bytes, from) = match self {
            Self::Json(bytes, from) => {
                let (bytes, end) = bytes.split_at_checked(name.len() + 1)?;
                if bytes[0] != b'"' || *end.first()? != b'"' {
                    return None;
                }
                (bytes, from)
            }
            Self::Msgpack(bytes, from) => {
                let length = header(bytes, name.len())?;
                (bytes.get(length - 1..length + name.len())?, from + length - 1)
            }
        };
        let quote = usize::from(matches!(self, Self::Json(..)));
        bytes[1..].eq_ignore_ascii_case(name.as_bytes()).then_some(from + 1 + name.len() + quote)
    }
}

/// The bytes of the MessagePack header of text or bytes of this length.
fn header(bytes: &[u8], length: usize) -> Option<usize> {
    let short = u8::try_from(length).ok()?;
    let (first, rest) = bytes.split_first()?;
    let announced: &[u8] = match first {
        0xd9 | 0xc4 => &[short],
        0xda | 0xc5 => &[0, short],
        0xdb | 0xc6 => &[0, 0, 0, short],
        _ => return (*first == 0xa0 | short).then_some(1),
    };
    rest.starts_with(announced).then_some(1 + announced.len())
}

/// Calls `found` with each place in `bytes` where the key `op` begins, quote or header included, and with its value.
fn each(bytes: &[u8], mut found: impl FnMut(usize, Found<'_>)) {
    for at in memmem::find_iter(bytes, b"op") {
        let Some(before) = at.checked_sub(1) else { continue };
        match bytes[before] {
            b'"' => {
                let rest = &bytes[at + 2..];
                let Some((b'"', rest)) = rest.split_first() else { continue };
                let Some((b':', rest)) = without_blanks(rest).split_first() else { continue };
                let value = without_blanks(rest);
                found(before, Found::Json(value, bytes.len() - value.len() - at));
            }
            // Text or bytes of two, whatever the width of their length.
            0xa2 | 0x02 => found(before, Found::Msgpack(&bytes[at + 2..], 2)),
            _ => {}
        }
    }
}

fn without_blanks(bytes: &[u8]) -> &[u8] {
    let blanks =
        bytes.iter().take(MAX_BLANKS).take_while(|byte| matches!(byte, b' ' | b'\t' | b'\r')).count();
    &bytes[blanks..]
}

/// Which stop the value is, of a key that begins `at` with its quote or header, and where it ends.
fn stop(value: Found<'_>, at: usize) -> Option<(Stop, usize)> {
    Stop::ALL.into_iter().find_map(|stop| value.is(stop.as_str()).map(|length| (stop, at + 1 + length)))
}
