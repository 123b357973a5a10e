//! slcan: CAN frames as lines of text on a serial line (the LAWICEL protocol, as the adapters for
//! python-can and for Linux's `slcand` speak it).
//!
//! A standard frame is `t`, three hexadecimal digits of its id, one of its length, two of each
//! byte, and a carriage return. `r` asks for a message (RTR) and has no bytes. `T` and `R` have ids
//! of eight digits. The adapter answers a frame that it has taken with an empty line, or with `z`
//! or `Z`, and one that it refuses with a bell.

/// Ends a line.
const END: u8 = b'\r';
/// A frame or command was refused.
const BELL: u8 = 7;
/// The longest line without its end: `T`, id, length, eight bytes.
const LONGEST: usize = 1 + 8 + 1 + 16;

/// The longest line of a standard frame, bytes.
pub const FRAME_BYTES: usize = 1 + 3 + 1 + 16 + 1;

/// Ends whatever line the adapter has begun, sets CAN to 1 Mbit/s, and opens the channel. An
/// adapter whose channel is open refuses the rest, and is as it must be.
pub const OPEN: &[u8] = b"\r\r\rS8\rO\r";

/// A CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Its id: 11 bits, or 29 where it is extended.
    pub id: u32,
    /// It has an id of 29 bits.
    pub extended: bool,
    /// It asks for the message of this id.
    pub remote: bool,
    /// How many bytes of `data` it has, at most 8.
    pub length: u8,
    /// Its bytes; those past `length` are 0.
    pub data: [u8; 8],
}

impl Frame {
    /// A standard frame of at most 8 bytes.
    #[must_use]
    pub fn new(id: u16, bytes: &[u8]) -> Self {
        let length = bytes.len().min(8);
        let mut data = [0; 8];
        data[..length].copy_from_slice(&bytes[..length]);
        let id = u32::from(id) & 0x7ff;
        Self { id, extended: false, remote: false, length: length as u8, data }
    }

    /// A standard frame that asks for a message of 8 bytes.
    #[must_use]
    pub fn request(id: u16) -> Self {
        Self { remote: true, length: 8, ..Self::new(id, &[]) }
    }

    /// Appends the line of this frame.
    pub fn write(&self, line: &mut Vec<u8>) {
        let kind = match (self.extended, self.remote) {
            (false, false) => b't',
            (false, true) => b'r',
            (true, false) => b'T',
            (true, true) => b'R',
        };
        line.push(kind);
        let digits = if self.extended { 8 } else { 3 };
        line.extend((0..digits).rev().map(|k| digit((self.id >> (4 * k)) as u8 & 0xf)));
        line.push(digit(self.length));
        if !self.remote {
            let bytes = &self.data[..usize::from(self.length)];
            line.extend(bytes.iter().flat_map(|byte| [digit(byte >> 4), digit(byte & 0xf)]));
        }
        line.push(END);
    }
}

/// A hexadecimal digit.
fn digit(value: u8) -> u8 {
    b"0123456789ABCDEF"[usize::from(value & 0xf)]
}

/// What an adapter says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// A frame that was on the bus.
    Frame(Frame),
    /// A frame or a command was taken.
    Taken,
    /// A frame or a command was refused.
    Refused,
}

/// A line that is none of slcan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Damaged;

/// Makes words of bytes in whatever pieces they come. Does not allocate.
///
/// A letter that begins a frame is no hexadecimal digit, so that a frame whose end was lost does
/// not take the next one along.
#[derive(Debug, Clone)]
pub struct Decoder {
    line: [u8; LONGEST],
    length: usize,
    /// The line is damaged, which has been said: its rest means nothing.
    skips: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { line: [0; LONGEST], length: 0, skips: false }
    }
}

impl Decoder {
    /// Takes in a byte. Returns what ends, or is found damaged, with it.
    pub fn push(&mut self, byte: u8) -> Option<Result<Word, Damaged>> {
        match byte {
            END => {
                let skipped = std::mem::take(&mut self.skips);
                let line = &self.line[..std::mem::take(&mut self.length)];
                if skipped { None } else { Some(word(line)) }
            }
            BELL => {
                *self = Self::default();
                Some(Ok(Word::Refused))
            }
            b't' | b'T' | b'r' | b'R' => {
                let cut = self.length > 0 && !self.skips;
                *self = Self::default();
                self.line[0] = byte;
                self.length = 1;
                cut.then_some(Err(Damaged))
            }
            _ if self.skips => None,
            _ => {
                let fits = self.length < LONGEST;
                let means = byte.is_ascii_hexdigit() && self.length > 0
                    || matches!(byte, b'z' | b'Z') && self.length == 0;
                if !(fits && means) {
                    (self.skips, self.length) = (true, 0);
                    return Some(Err(Damaged));
                }
                self.line[self.length] = byte;
                self.length += 1;
                None
            }
        }
    }
}

/// What a whole line says.
fn word(line: &[u8]) -> Result<Word, Damaged> {
    match line {
        [] | [b'z' | b'Z'] => Ok(Word::Taken),
        [b't' | b'r', ..] => frame(line, 3),
        [b'T' | b'R', ..] => frame(line, 8),
        _ => Err(Damaged),
    }
}

fn frame(line: &[u8], id_digits: usize) -> Result<Word, Damaged> {
    let extended = id_digits == 8;
    let remote = matches!(line[0], b'r' | b'R');
    let id = number(line.get(1..=id_digits).ok_or(Damaged)?)?;
    let length = number(line.get(id_digits + 1..id_digits + 2).ok_or(Damaged)?)? as usize;
    let bytes = &line[id_digits + 2..];
    let expected = if remote { 0 } else { 2 * length };
    let most = if extended { 0x1fff_ffff } else { 0x7ff };
    if length > 8 || id > most || bytes.len() != expected {
        return Err(Damaged);
    }
    let mut data = [0; 8];
    for (byte, digits) in data.iter_mut().zip(bytes.chunks_exact(2)) {
        *byte = number(digits)? as u8;
    }
    Ok(Word::Frame(Frame { id, extended, remote, length: length as u8, data }))
}

/// The number of at most eight hexadecimal digits.
fn number(digits: &[u8]) -> Result<u32, Damaged> {
    digits.iter().try_fold(0, |number, digit| {
        let value = char::from(*digit).to_digit(16).ok_or(Damaged)?;
        Ok(number << 4 | value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(bytes: &[u8]) -> Vec<Result<Word, Damaged>> {
        let mut decoder = Decoder::default();
        bytes.iter().filter_map(|byte| decoder.push(*byte)).collect()
    }

    #[test]
    fn a_frame_whose_end_was_lost_does_not_take_the_next_one_along() {
        let good = Ok(Word::Frame(Frame::new(0x021, &[1, 2])));
        assert_eq!(words(b"t0212010t02120102\r"), [Err(Damaged), good]);
        assert_eq!(words(b"t02\xff12010t02120102\r"), [Err(Damaged), good], "damage is said once");
        assert_eq!(
            words(b"\r\x07z\rt02120102\r"),
            [Ok(Word::Taken), Ok(Word::Refused), Ok(Word::Taken), good]
        );
    }

    #[test]
    fn a_line_of_another_length_than_it_says_is_damaged() {
        for line in
            [&b"t02130102\r"[..], b"t0212010203\r", b"t0219010203040506070809\r", b"t8000\r", b"t02\r"]
        {
            assert_eq!(words(line), [Err(Damaged)], "{}", String::from_utf8_lossy(line));
        }
        // A request has a length and no bytes.
        assert_eq!(words(b"r0208\r"), [Ok(Word::Frame(Frame::request(0x020)))]);
    }
}
