//! The lines of text that frames travel in: those of an fdcanusb adapter, or of a UART with
//! checksums.

use moteus_protocol::CanFdFrame;
use moteus_protocol::fdcanusb::{
    EncodeOptions, Line as Content, MAX_LINE_LENGTH, encode_can_send, parse_line, strip_checksum,
};

/// Ends a line of which only a part has been taken, so that it is refused: neither data nor flags
/// have this letter. A bare end of line would have the part obeyed, and a mode without its torque
/// is position mode.
pub(super) const BREAK: &[u8] = b"x\n";
/// The longest line, with its end.
pub(super) const LONGEST: usize = MAX_LINE_LENGTH;

/// Which of the two dialects a line speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Dialect {
    /// An fdcanusb adapter: no checksums, it refuses them.
    #[default]
    Fdcanusb,
    /// The UART of a moteus: each line ends with a CRC-8.
    Uart,
}

/// Appends the line of `frame` to `out`, which has room for it.
pub(super) fn push(out: &mut Vec<u8>, frame: &CanFdFrame, dialect: Dialect) {
    let options = EncodeOptions { checksum: dialect == Dialect::Uart, ..EncodeOptions::default() };
    let mut line = [0; LONGEST];
    // A buffer of this length is always sufficient.
    let length = encode_can_send(frame, &options, &mut line).unwrap_or(0);
    out.extend_from_slice(&line[..length]);
}

/// What a line says.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Said {
    /// A frame from a servo.
    Frame(CanFdFrame),
    /// A line has been taken.
    Taken,
    /// A line has been refused.
    Refused,
    /// It is damaged, or of another protocol.
    Damaged,
}

/// Collects bytes to lines. Does not allocate.
#[derive(Debug, Clone)]
pub(super) struct Inbox {
    line: [u8; LONGEST],
    length: usize,
    too_long: bool,
    /// Checksums are required: a line without one is damaged.
    required: bool,
}

impl Inbox {
    pub(super) fn new(dialect: Dialect) -> Self {
        Self { line: [0; LONGEST], length: 0, too_long: false, required: dialect == Dialect::Uart }
    }

    /// Takes a byte. Where it ends a line that is not empty: what that says, and whether it has a
    /// valid checksum.
    pub(super) fn take(&mut self, byte: u8) -> Option<(Said, bool)> {
        if byte != b'\n' && byte != b'\r' {
            match self.line.get_mut(self.length) {
                Some(place) => *place = byte,
                None => self.too_long = true,
            }
            self.length = (self.length + 1).min(LONGEST);
            return None;
        }
        let (length, too_long) = (std::mem::take(&mut self.length), std::mem::take(&mut self.too_long));
        (length > 0).then(|| {
            let (content, checked, valid) = strip_checksum(&self.line[..length]);
            if too_long || checked && !valid || self.required && !checked {
                return (Said::Damaged, false);
            }
            (understood(content), checked)
        })
    }
}

fn understood(content: &[u8]) -> Said {
    match parse_line(content) {
        Content::Rcv(frame) => Said::Frame(frame),
        // Words that merely begin alike are damaged ones.
        Content::Ok if content == b"OK" => Said::Taken,
        Content::Err(_) => Said::Refused,
        Content::Ok | Content::Other(_) => Said::Damaged,
    }
}
