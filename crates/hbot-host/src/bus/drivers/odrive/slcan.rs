//! slcan (also called the LAWICEL protocol): CAN frames as lines of text on a serial line. Adapters
//! for python-can and for Linux's `slcand` use it.
//!
//! A standard frame is the letter `t`, three hexadecimal digits of the id, one digit of the length,
//! two digits of each data byte, and a carriage return. The letter `r` marks a remote request
//! (RTR), which has no data bytes. `T` and `R` mark frames whose id has eight digits. The adapter
//! answers a frame that it accepts with an empty line, `z` or `Z`, and a frame that it refuses with
//! the bell character.

/// Byte at the end of a line.
const END: u8 = b'\r';
/// Byte with which the adapter refuses a frame or command.
const BELL: u8 = 7;
/// Largest length of a line without its end, in bytes: `T`, id, length digit and eight data bytes.
const LONGEST: usize = 1 + 8 + 1 + 16;

/// Largest length of the line of a standard frame, in bytes, with its end.
pub const FRAME_BYTES: usize = 1 + 3 + 1 + 16 + 1;

/// Opens the CAN channel of an adapter at 1 Mbit/s. The carriage returns first end any half line.
/// The channel is closed before, since an open one keeps its bit rate.
pub const OPEN: &[u8] = b"\r\r\rC\rS8\rO\r";

/// A CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// The id: 11 bits, or 29 bits if `extended` is true.
    pub id: u32,
    /// True if the id has 29 bits.
    pub extended: bool,
    /// True for a remote request: the frame asks for the message with this id.
    pub remote: bool,
    /// Number of data bytes, at most 8.
    pub length: u8,
    /// Data bytes; those after `length` are 0.
    pub data: [u8; 8],
}

impl Frame {
    /// Returns a standard frame with the id `id` and at most the first 8 of `bytes`.
    #[must_use]
    pub fn new(id: u16, bytes: &[u8]) -> Self {
        let length = bytes.len().min(8);
        let mut data = [0; 8];
        data[..length].copy_from_slice(&bytes[..length]);
        let id = u32::from(id) & 0x7ff;
        Self { id, extended: false, remote: false, length: length as u8, data }
    }

    /// Returns a remote request, as a standard frame, for a message of 8 bytes.
    #[must_use]
    pub fn request(id: u16) -> Self {
        Self { remote: true, length: 8, ..Self::new(id, &[]) }
    }

    /// Appends the text of this frame to `line`, with its end.
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

/// Returns the hexadecimal digit of the lower four bits of `value`.
fn digit(value: u8) -> u8 {
    b"0123456789ABCDEF"[usize::from(value & 0xf)]
}

/// What an adapter sends at one time: a line of text, or the bell character.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// A frame that the adapter received from the bus.
    Frame(Frame),
    /// The adapter accepted a frame or a command.
    Taken,
    /// The adapter refused a frame or a command.
    Refused,
}

/// Error for a line that is not valid slcan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Damaged;

/// Decodes the bytes from an adapter, in pieces of any size. Does not allocate memory.
///
/// No hexadecimal digit is a letter that begins a frame. If the end of a frame is lost, the decoder
/// therefore still finds the next frame.
#[derive(Debug, Clone)]
pub struct Decoder {
    line: [u8; LONGEST],
    length: usize,
    /// True while the rest of a damaged line is skipped. The damage has been reported already.
    skips: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { line: [0; LONGEST], length: 0, skips: false }
    }
}

impl Decoder {
    /// Takes the next byte from the adapter. Returns a [`Word`] if the byte completes one, and
    /// [`Damaged`] if it shows that the line of text is damaged.
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

/// Decodes a whole line of text, without its end.
fn word(line: &[u8]) -> Result<Word, Damaged> {
    match line {
        [] | [b'z' | b'Z'] => Ok(Word::Taken),
        [b't' | b'r', ..] => frame(line, 3),
        [b'T' | b'R', ..] => frame(line, 8),
        _ => Err(Damaged),
    }
}

/// Decodes a whole line of text that contains a frame. The id of the frame has `id_digits` digits.
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

/// Returns the number that at most eight hexadecimal digits stand for.
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
        // A remote request has a length but no data bytes.
        assert_eq!(words(b"r0208\r"), [Ok(Word::Frame(Frame::request(0x020)))]);
    }

    /// The longest line has 26 bytes without its end.
    #[test]
    fn a_line_that_is_too_long_or_begins_with_no_letter_of_a_frame_is_damaged_at_once() {
        let good = Ok(Word::Frame(Frame::new(0x021, &[1, 2])));
        let long = [&b"T"[..], &[b'0'; 26], b"\rt02120102\r"].concat();
        assert_eq!(words(&long), [Err(Damaged), good]);
        for line in [&b"12\x07"[..], b"?\x07", b"zz\x07", b"t02?\x07", b"t02z\x07"] {
            let line_text = line.escape_ascii();
            assert_eq!(words(line), [Err(Damaged), Ok(Word::Refused)], "{line_text}");
        }
    }

    #[test]
    fn ids_have_11_or_29_bits() {
        let largest = Frame::new(0x7ff, &[]);
        assert_eq!(words(b"t7FF0\r"), [Ok(Word::Frame(largest))]);
        let long = Frame { id: 0x1fff_ffff, extended: true, ..Frame::new(0, &[1, 2]) };
        assert_eq!(words(b"T1FFFFFFF20102\r"), [Ok(Word::Frame(long))]);
        let request = Frame { id: 0x21, extended: true, ..Frame::request(0) };
        assert_eq!(words(b"R000000218\r"), [Ok(Word::Frame(request))]);
        assert_eq!(words(b"T200000000\r"), [Err(Damaged)]);
    }
}
