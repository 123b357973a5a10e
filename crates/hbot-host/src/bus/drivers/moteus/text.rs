//! The lines of text that carry CAN frames to and from the servos, in two dialects: that of an
//! fdcanusb adapter, and that of a UART, with checksums.

use moteus_protocol::CanFdFrame;
use moteus_protocol::fdcanusb::{
    EncodeOptions, Line as Content, MAX_LINE_LENGTH, encode_can_send, parse_line, strip_checksum,
};

/// Bytes that end a line of which only the first part was sent. They contain the letter `x`, which
/// is in no valid command, so the adapter or servo refuses the line. If only an end of line
/// followed, a servo could obey the first part: if it sets the mode but no torque, the servo
/// switches to position mode.
pub(super) const BREAK: &[u8] = b"x\n";
/// Length of the longest line of text, in bytes, including the end of the line.
pub(super) const LONGEST: usize = MAX_LINE_LENGTH;

/// Whether the lines of text that carry frames to and from moteus servos have checksums.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Dialect {
    /// Lines to and from an fdcanusb adapter, which refuses checksums.
    #[default]
    Fdcanusb,
    /// Lines to and from the UART of a servo. Each line ends with a checksum (CRC-8).
    Uart,
}

/// Appends the line of text that carries `frame` to `out`. To avoid a memory allocation in the
/// control loop, the caller reserves `LONGEST` bytes in advance.
pub(super) fn push(out: &mut Vec<u8>, frame: &CanFdFrame, dialect: Dialect) {
    let options = EncodeOptions { checksum: dialect == Dialect::Uart, ..EncodeOptions::default() };
    let mut line = [0; LONGEST];
    // A buffer of this length is always sufficient.
    let length = encode_can_send(frame, &options, &mut line).unwrap_or(0);
    out.extend_from_slice(&line[..length]);
}

/// The content of one line of text from an adapter or a servo.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Said {
    /// A CAN frame from a servo.
    Frame(CanFdFrame),
    /// The adapter or servo has accepted a command (`OK`).
    Taken,
    /// The adapter or servo has refused a command (`ERR`).
    Refused,
    /// A damaged line, or text of another protocol.
    Damaged,
}

/// Assembles received bytes into lines. Does not allocate memory.
#[derive(Debug, Clone)]
pub(super) struct Inbox {
    line: [u8; LONGEST],
    length: usize,
    too_long: bool,
    /// True if each line must have a checksum. A line without one is then damaged.
    required: bool,
}

impl Inbox {
    pub(super) fn new(dialect: Dialect) -> Self {
        Self { line: [0; LONGEST], length: 0, too_long: false, required: dialect == Dialect::Uart }
    }

    /// Adds one received byte. If the byte ends a line that is not empty, returns the content of
    /// the line and whether the line has a valid checksum.
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
        // A line that only begins with `OK` is damaged.
        Content::Ok if content == b"OK" => Said::Taken,
        Content::Err(_) => Said::Refused,
        Content::Ok | Content::Other(_) => Said::Damaged,
    }
}
