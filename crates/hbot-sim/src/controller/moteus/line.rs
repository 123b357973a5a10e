//! The text lines of an fdcanusb adapter, and of the UART of a moteus that behaves like one.
//!
//! `can send ID DATA FLAGS` is answered by `OK`, then by an `rcv` line for each answer on the bus.
//! On a UART each line from the controller ends with a space, `*` and the CRC-8 of what stands
//! before the `*` (polynomial 0x97, start value 0); once a line to the controller had one, all
//! must.

/// The longest line that is kept; more is a line of no meaning.
const LONGEST: usize = 256;

/// A CAN frame to the servos.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct CanFrame {
    pub(super) id: u32,
    pub(super) data: Vec<u8>,
}

/// What a line asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Asked {
    /// A frame for the bus.
    Send(CanFrame),
    /// Nothing: the line is refused for this reason.
    Refused(&'static str),
}

/// The adapter: from bytes to frames.
#[derive(Debug, Clone)]
pub(super) struct Adapter {
    /// A UART: lines back have checksums.
    pub(super) checksums: bool,
    /// A line with a checksum has come, so all need one.
    required: bool,
    line: Vec<u8>,
    too_long: bool,
}

impl Adapter {
    pub(super) fn new(checksums: bool) -> Self {
        Self { checksums, required: false, line: Vec::with_capacity(LONGEST), too_long: false }
    }

    /// Power lost and back.
    pub(super) fn reboot(&mut self) {
        *self = Self::new(self.checksums);
    }

    /// Takes a byte; what the line asks for where it ends one that is not empty.
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

/// What `can send ...` asks for.
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

/// Appends a line to the host.
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

/// Appends the line of a frame from the servos.
pub(super) fn say_frame(reply: &mut Vec<u8>, frame: &CanFrame, checksums: bool) {
    let mut text = format!("rcv {:X} ", frame.id);
    for byte in &frame.data {
        text.push_str(&format!("{byte:02X}"));
    }
    text.push_str(" E B F");
    say(reply, &text, checksums);
}

/// CRC-8 of polynomial 0x97, a bit at a time.
fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 != 0 { crc << 1 ^ 0x97 } else { crc << 1 })
    })
}
