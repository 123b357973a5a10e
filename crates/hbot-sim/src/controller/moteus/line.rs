//! The lines of text of an fdcanusb adapter, and of a moteus servo's UART, which uses the same
//! lines.
//!
//! A line `can send ID DATA FLAGS` is answered by `OK`, then by an `rcv` line for each answer on
//! the bus. On a UART each line from the controller ends with a space, `*` and the CRC-8 of
//! everything before the `*` (polynomial 0x97, start value 0). After the first line with a checksum
//! to the controller, all lines to it must have one.

/// Length of the longest line that is accepted, in bytes. Longer lines are refused.
const LONGEST: usize = 256;

/// A CAN frame to or from the servos.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct CanFrame {
    pub(super) id: u32,
    pub(super) data: Vec<u8>,
}

/// What the adapter does with one received line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Asked {
    /// The line is valid: send this frame on the bus.
    Send(CanFrame),
    /// The line is not valid: answer with this text.
    Refused(&'static str),
}

/// The simulated adapter, which turns lines of text from the host into CAN frames.
#[derive(Debug, Clone)]
pub(super) struct Adapter {
    /// True if the lines to the host have checksums, as on the UART of a servo.
    pub(super) checksums: bool,
    /// True after a line with a checksum has arrived from the host. From then on, lines without a
    /// checksum are refused.
    required: bool,
    line: Vec<u8>,
    too_long: bool,
}

impl Adapter {
    pub(super) fn new(checksums: bool) -> Self {
        Self { checksums, required: false, line: Vec::with_capacity(LONGEST), too_long: false }
    }

    /// Simulates that the adapter loses power and restarts.
    pub(super) fn reboot(&mut self) {
        *self = Self::new(self.checksums);
    }

    /// Adds one received byte. If the byte ends a line that is not empty, returns what to do with
    /// the line.
    pub(super) fn take(&mut self, byte: u8) -> Option<Asked> {
        if byte != b'\n' && byte != b'\r' {
            self.too_long |= self.line.len() == LONGEST;
            if !self.too_long {
                self.line.push(byte);
            }
            return None;
        }
        let (line, too_long) = (std::mem::take(&mut self.line), std::mem::take(&mut self.too_long));
        let asked = (!line.is_empty())
            .then(|| if too_long { Asked::Refused("ERR line too long") } else { self.understand(&line) });
        self.line = line;
        self.line.clear();
        asked
    }

    fn understand(&mut self, line: &[u8]) -> Asked {
        let mut content = line;
        if self.checksums {
            match line.iter().rposition(|byte| *byte == b'*') {
                Some(star) if star + 3 == line.len() => {
                    let text = std::str::from_utf8(&line[star + 1..]).unwrap_or("");
                    if u8::from_str_radix(text, 16) != Ok(crc8(&line[..star])) {
                        return Asked::Refused("ERR checksum mismatch");
                    }
                    self.required = true;
                    content = &line[..star];
                }
                _ if self.required => return Asked::Refused("ERR checksum missing"),
                _ => {}
            }
        }
        let Ok(text) = std::str::from_utf8(content) else { return Asked::Refused("ERR unknown command") };
        send(text.trim_end())
    }
}

/// Decodes a line that should be a `can send` command. Returns the frame to send, or the text of
/// the error answer.
fn send(text: &str) -> Asked {
    let mut words = text.split(' ').filter(|word| !word.is_empty());
    if words.next() != Some("can") {
        return Asked::Refused("ERR unknown command");
    }
    if words.next() != Some("send") {
        return Asked::Refused("ERR unknown subcommand");
    }
    let (Some(id), Some(data)) = (words.next(), words.next()) else {
        return Asked::Refused("ERR insufficient options");
    };
    if words.any(|flags| flags.chars().any(|flag| !"BbFfRr".contains(flag))) {
        return Asked::Refused("ERR unknown flag");
    }
    let Some(id) = u32::from_str_radix(id, 16).ok().filter(|id| *id < 1 << 29) else {
        return Asked::Refused("ERR bad id");
    };
    if data.len() % 2 != 0 || data.len() > 128 {
        return Asked::Refused("ERR data invalid length");
    }
    let nibble = |c: u8| (c as char).to_digit(16);
    let bytes = data.as_bytes().chunks(2).map(|pair| Some((nibble(pair[0])? << 4 | nibble(pair[1])?) as u8));
    match bytes.collect::<Option<Vec<u8>>>() {
        Some(data) => Asked::Send(CanFrame { id, data }),
        None => Asked::Refused("ERR invalid data"),
    }
}

/// Appends a line of text to `reply`, with a checksum if `checksums` is true.
pub(super) fn say(reply: &mut Vec<u8>, text: &str, checksums: bool) {
    let start = reply.len();
    reply.extend_from_slice(text.as_bytes());
    if checksums {
        reply.push(b' ');
        let crc = crc8(&reply[start..]);
        reply.extend_from_slice(format!("*{crc:02X}").as_bytes());
    }
    reply.extend_from_slice(b"\r\n");
}

/// Appends the `rcv` line with which the adapter passes a servo's frame to the host.
pub(super) fn say_frame(reply: &mut Vec<u8>, frame: &CanFrame, checksums: bool) {
    let mut text = format!("rcv {:X} ", frame.id);
    for byte in &frame.data {
        text.push_str(&format!("{byte:02X}"));
    }
    text.push_str(" E B F");
    say(reply, &text, checksums);
}

/// Returns the CRC-8 of `bytes` with the polynomial 0x97, computed bit by bit.
fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 != 0 { crc << 1 ^ 0x97 } else { crc << 1 })
    })
}
