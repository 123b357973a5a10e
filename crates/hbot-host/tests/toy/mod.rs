//! A complete driver for a simple protocol of text lines, which no real motor uses.
//! `docs/drivers.md` explains it step by step.
//!
//! ```text
//! D                                   who is there?
//! D 4 16384 4096 16384 4096 *5A       four joints with these counts a turn
//! C 17 1 20 10000 -20000 30000 0 *5A  tick, motors on, watchdog in ms, torques in uN m
//! R 17 1 99 3850773 -2688 ... *5A     tick answered, flags, count and rate in urad/s of each joint
//! ```
//!
//! The number after each `*` is the exclusive or of the bytes before it.

pub mod motors;

use std::io::Write as _;

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;
use hbot_host::bus::{
    BusCommand, Expected, Filtering, Found, Heard, JointReading, MeetError, MotorBus, Obedience, Protocol,
    Reading, Traffic, converse,
};
use hbot_host::line::Line;

/// Flag of a reading: the motors are on.
pub const ON: u32 = 1;
/// Flag of a reading: the watchdog has expired.
pub const EXPIRED: u32 = 2;
/// Flag of a reading: the controllers have restarted since the host last asked for their
/// description.
pub const STARTED: u32 = 4;
/// The line that asks the controllers for their description.
const ASK: &[u8] = b"D *44\n";
/// Largest length of a line of this protocol, bytes.
pub const LONGEST: usize = 512;

/// The driver of the toy protocol, an example for authors of drivers.
#[derive(Debug)]
pub struct Toy;

impl Protocol for Toy {
    fn meet(&self, line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError> {
        let counts = counts(line, expected)?;
        if counts.len() != expected.joints() {
            return Err(expected.wrong_joints(counts.len()));
        }
        let odd = expected.first_wrong_counts(counts.iter().copied());
        odd.map_or(Ok(()), |at| Err(expected.wrong_counts(at, counts[at])))
    }

    fn switch_off(&self, line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError> {
        ask(line, expected, &off(expected), |words| {
            words.next().filter(|word| *word == "R").and_then(|_| words.next())?;
            let flags: u32 = words.next()?.parse().ok()?;
            Some(flags & STARTED != 0)
        })
    }

    fn off_bytes(&self, expected: &Expected) -> Vec<u8> {
        framed(&off(expected))
    }

    fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus> {
        let obedience = Obedience::default();
        let (inbox, outbox) = (Inbox::default(), [0; LONGEST]);
        Box::new(ToyBus {
            line,
            expected,
            inbox,
            outbox,
            obedience,
            answered: None,
            cut: false,
            started: false,
        })
    }

    fn scan(&self, line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
        let counts = counts(line, expected)?;
        let found = |(at, counts): (usize, &u32)| Found {
            id: at as u8,
            model: format!("a toy of {counts} counts a turn"),
            firmware: "1".to_owned(),
            supply_v: None,
            zero: None,
            filtering: Filtering::default(),
            remedies: Vec::new(),
        };
        Ok(counts.iter().enumerate().map(found).collect())
    }

    fn traffic(&self, joints: usize) -> Traffic {
        // The widest numbers: a tick or count has up to 11 characters with its sign, after a space.
        Traffic { commands: 24 + 12 * joints, feedback: 24 + 24 * joints, turnaround_us: 0, bus: None }
    }
}

/// The motors on one line that use the toy protocol.
struct ToyBus {
    line: Box<dyn Line>,
    expected: Expected,
    inbox: Inbox,
    outbox: [u8; LONGEST],
    obedience: Obedience,
    /// The newest tick whose command has been answered.
    answered: Option<u32>,
    /// True if the line accepted only a part of the last command.
    cut: bool,
    /// True if the controllers have restarted since the host last asked for their description.
    started: bool,
}

impl MotorBus for ToyBus {
    fn receive(&mut self, now_ns: u64, tick: u32) -> Heard {
        let mut heard = Heard::default();
        if let Some(renewed) = self.line.renewed() {
            (heard.reopened, heard.zeros_lost) = (true, renewed.rebooted);
            (self.cut, self.inbox) = (false, Inbox::default());
        }
        let mut received = [0; LONGEST];
        let n = self.line.read(now_ns, &mut received).unwrap_or(0);
        for byte in &received[..n] {
            let Some(line) = self.inbox.take(*byte) else { continue };
            let Some(text) = line else {
                heard.damaged = heard.damaged.saturating_add(1);
                continue;
            };
            if text.starts_with("D ") {
                // They have said who they are. Their next reading makes `started` false.
                continue;
            }
            let Some((flags, reading)) = parse(text, self.expected.joints()) else {
                heard.foreign += 1;
                continue;
            };
            self.started = flags & STARTED != 0;
            heard.zeros_lost |= self.started;
            let explained = flags & (EXPIRED | STARTED) != 0;
            heard.complaints = heard.complaints.or(Complaints {
                watchdog: flags & EXPIRED != 0,
                disobeyed: self.obedience.is_broken(reading.answers, flags & ON != 0, explained),
                ..Complaints::default()
            });
            // Ticks wrap at 32 bits. A tick is newer if it is less than half of the range ahead.
            let newer = |than: u32| (reading.answers.wrapping_sub(than) as i32) > 0;
            if reading.answers == tick || newer(tick) {
                heard.foreign += 1;
            } else if self.answered.is_none_or(newer) {
                self.answered = Some(reading.answers);
                heard.reading = Some(reading);
            }
        }
        heard
    }

    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool {
        self.obedience.note(command.tick, command.enable);
        let mut rest = &mut self.outbox[..];
        if self.cut {
            // Ends the incomplete line that the controllers have received.
            let _ = rest.write_all(b"\n");
        }
        if self.started && command.tick.is_multiple_of(100) {
            // Asks the controllers who they are.
            let _ = rest.write_all(ASK);
        }
        let room = rest.len();
        let _ = write!(rest, "C {} {} {}", command.tick, u8::from(command.enable), command.watchdog_ms);
        for torque in &command.torque[..self.expected.joints()] {
            let _ = write!(rest, " {}", (torque * 1e6).round() as i64);
        }
        let (start, end) = (LONGEST - room, LONGEST - rest.len());
        let sum = checksum(&self.outbox[start..end]);
        let mut tail = &mut self.outbox[end..];
        let _ = writeln!(tail, " *{sum:02X}");
        let length = LONGEST - tail.len();
        let whole = self.line.write(now_ns, &self.outbox[..length]).is_ok_and(|written| written == length);
        self.cut = !whole;
        whole
    }

    fn release(&mut self) {
        self.line.release();
    }
}

/// A received line of text that is not complete yet.
pub struct Inbox {
    bytes: [u8; LONGEST],
    length: usize,
    /// True if the line is longer than any line of this protocol.
    too_long: bool,
}

impl Default for Inbox {
    fn default() -> Self {
        Self { bytes: [0; LONGEST], length: 0, too_long: false }
    }
}

impl Inbox {
    /// Takes one received byte. At the end of a line, returns its text without the checksum, or
    /// `Some(None)` if the line is damaged. Otherwise returns `None`. Empty lines are ignored.
    pub fn take(&mut self, byte: u8) -> Option<Option<&str>> {
        if byte != b'\n' {
            self.too_long |= self.length == LONGEST;
            if !self.too_long {
                self.bytes[self.length] = byte;
                self.length += 1;
            }
            return None;
        }
        let (length, too_long) = (std::mem::take(&mut self.length), std::mem::take(&mut self.too_long));
        let text = std::str::from_utf8(&self.bytes[..length]).ok();
        let checked = || {
            let (text, sum) = text?.rsplit_once(" *")?;
            (u8::from_str_radix(sum, 16).ok()? == checksum(text.as_bytes())).then_some(text)
        };
        (length > 0).then(|| if too_long { None } else { checked() })
    }
}

/// Returns the exclusive or of all bytes, the checksum of a line.
pub fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

/// Returns the flags and the reading in the text of a line, or `None` if the line is not a reading.
fn parse(text: &str, joints: usize) -> Option<(u32, Reading)> {
    let mut words = text.split(' ');
    words.next().filter(|word| *word == "R")?;
    let answers = words.next()?.parse().ok()?;
    let flags = words.next()?.parse().ok()?;
    let mut reading = Reading { answers, joints: [JointReading::default(); MAX_JOINTS] };
    for joint in &mut reading.joints[..joints] {
        joint.count = words.next()?.parse().ok()?;
        joint.rate = words.next()?.parse::<i32>().ok().map(|rate| f64::from(rate) * 1e-6)?;
    }
    words.next().is_none().then_some((flags, reading))
}

/// Returns the text of the command that switches the motors off.
fn off(expected: &Expected) -> String {
    format!("C 0 0 1{}", " 0".repeat(expected.joints()))
}

/// Returns the bytes of a line, after a newline that ends an incomplete line before it.
pub fn framed(text: &str) -> Vec<u8> {
    format!("\n{text} *{:02X}\n", checksum(text.as_bytes())).into_bytes()
}

/// Asks the controllers for the counts per turn of all joints, and returns them.
fn counts(line: &mut dyn Line, expected: &Expected) -> Result<Vec<u32>, MeetError> {
    ask(line, expected, "D", |words| {
        // The first number is how many follow.
        words.next().filter(|word| *word == "D").and_then(|_| words.next())?;
        words.map(|word| word.parse().ok()).collect()
    })
}

/// Sends the line `text` repeatedly until `find` returns a value for the words of an answer.
/// Returns this value.
fn ask<T>(
    line: &mut dyn Line,
    expected: &Expected,
    text: &str,
    mut find: impl FnMut(&mut std::str::Split<'_, char>) -> Option<T>,
) -> Result<T, MeetError> {
    let mut inbox = Inbox::default();
    converse(line, expected, &framed(text), |bytes| {
        bytes.iter().filter_map(|byte| find(&mut inbox.take(*byte)??.split(' '))).last()
    })
}
