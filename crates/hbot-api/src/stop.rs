//! Finds stop requests in received bytes, before they are split into messages or parsed.
//!
//! A stop must not wait for the requests before it, and must be found even in a damaged message.
//! The bytes are therefore searched as they arrive for the key `op` with the value `estop` or
//! `disable`: in JSON or MessagePack, at any depth, in upper or lower case. A false match only
//! stops the rig once too often, which is harmless.

use crate::OpName;
use crate::names::names;
use memchr::memmem;

names! {
    /// The kind of a request that stops the rig. The server finds such requests in the received
    /// bytes before it parses them.
    pub enum Stop {
        /// An emergency stop, [`Op::Estop`](crate::Op::Estop).
        Estop = "estop",
        /// The end of rendering, [`Op::Disable`](crate::Op::Disable).
        Disable = "disable",
    }
}

/// Largest number of blanks on either side of the colon at which a stop in JSON is still found.
const MAX_BLANKS: usize = 8;
/// Number of last bytes that are kept, so that a stop is found if its bytes arrive in several
/// pieces. This is the longest stop without its last byte: `"op"`, blanks, colon, blanks, and
/// `"disable"` without its closing quote.
const TAIL_BYTES: usize = 4 + MAX_BLANKS + 1 + MAX_BLANKS + 8;

/// Finds requests that stop the rig in the bytes of a connection. The bytes can arrive in pieces of
/// any size. Does not allocate memory.
#[derive(Clone, Debug, Default)]
pub struct StopFinder {
    /// The last bytes that have arrived. The first `kept` elements are in use.
    tail: [u8; TAIL_BYTES],
    kept: usize,
}

impl StopFinder {
    /// Searches the next received bytes for requests that stop the rig. Calls `found` for each,
    /// with the number of bytes in `piece` up to its end.
    pub fn push(&mut self, piece: &[u8], mut found: impl FnMut(Stop, usize)) {
        let mut joined = [0; 2 * TAIL_BYTES];
        let head = piece.len().min(TAIL_BYTES);
        let length = self.kept + head;
        joined[..self.kept].copy_from_slice(&self.tail[..self.kept]);
        joined[self.kept..length].copy_from_slice(&piece[..head]);
        each(&joined[..length], |at, value| {
            // Stops that lie in only one piece are found in that piece.
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

/// Returns whether a message requests an emergency stop. The rest of the message is ignored and can
/// be damaged.
#[must_use]
pub fn asks_estop(message: &[u8]) -> bool {
    let mut asks = false;
    each(message, |_, value| asks |= value.is(Stop::Estop.as_str()).is_some());
    asks
}

/// Returns whether a message seems to contain an op that is allowed to be long (see
/// [`OpRow::long`](field@crate::OpRow::long)). It does not parse the message.
#[must_use]
pub fn may_be_long(message: &[u8]) -> bool {
    let mut may = false;
    let long = OpName::ALL.into_iter().filter(|op| op.row().long);
    each(message, |_, value| may |= long.clone().any(|op| value.is(op.as_str()).is_some()));
    may
}

/// The value of a key `op` that was found in a message: the bytes from the value on, and the number
/// of bytes from the `o` of the key to the value.
#[derive(Clone, Copy)]
enum Found<'a> {
    /// A value in JSON: the bytes from its opening quote on, and the number of bytes from the key
    /// to it.
    Json(&'a [u8], usize),
    /// A value in MessagePack: the bytes from its header on, and the number of bytes from the key
    /// to it.
    Msgpack(&'a [u8], usize),
}

impl Found<'_> {
    /// Returns the number of bytes from the `o` of the key to the end of the value if the value is
    /// `name`. Returns `None` for any other value.
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

/// If `bytes` begins with the MessagePack header of text or binary data of this length, returns the
/// number of bytes of the header. Otherwise returns `None`.
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

/// Calls `found` for each key `op` in `bytes`, with its value and the index at which the key begins
/// (its quote or header).
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
            // Text or binary data of two bytes, whatever the width of the length in the header.
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

/// Returns the stop that the value of a key `op` names, if any, and the index in the message at
/// which this value ends. `at` is the index at which the key begins (its quote or header).
fn stop(value: Found<'_>, at: usize) -> Option<(Stop, usize)> {
    Stop::ALL.into_iter().find_map(|stop| value.is(stop.as_str()).map(|length| (stop, at + 1 + length)))
}
