//! Sends questions to the servos and waits for the answers. It blocks, so it is used outside the
//! loop only.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use moteus_protocol::diagnostic::{parse_server_to_client, write_client_poll, write_client_to_server};
use moteus_protocol::query::QueryFormat;
use moteus_protocol::{CanFdFrame, Resolution};

use super::codec::{self, State, Turn};
use super::text::{self, BREAK, Dialect, Inbox, Said};
use super::{BROADCAST, DIALECT, POWERED, UPTIME};
use crate::bus::{Expected, MeetError, converse};
use crate::line::Line;

/// Time without received bytes after which no more answers are expected to a question that was sent
/// to all servos.
const QUIET: Duration = Duration::from_millis(30);
/// The channel number of a servo's text console, and the largest number of console bytes in one
/// answer.
const CONSOLE: u8 = 1;
const CONSOLE_BYTES: u8 = 48;
/// How many times the driver sends the question for a setting, and how many times it then polls the
/// servo's console for the answer.
const ASKED: u32 = 3;
const LOOKED: u32 = 50;
/// Tolerance for the time at which a servo got power, ms. This time is computed from an answer: the
/// system's clock minus the servo's time since power-on. If it is later than the recorded one by
/// more than this tolerance, the servo has restarted. Clock drift and late answers cause smaller
/// differences.
const SLACK_MS: i64 = 2000;

/// Exchanges frames with the servos of a line outside the control loop, and waits for their
/// answers.
pub(super) struct Talk<'a> {
    line: &'a mut dyn Line,
    expected: &'a Expected,
    dialect: Dialect,
}

impl<'a> Talk<'a> {
    /// Opens the conversation on a line, and finds out whether lines of text need checksums. It
    /// sends a line that is not a valid command. An adapter answers with an error without a
    /// checksum, and a servo's UART with an error that has one.
    pub(super) fn open(line: &'a mut dyn Line, expected: &'a Expected) -> Result<Self, MeetError> {
        let mut inbox = Inbox::new(Dialect::Fdcanusb);
        let checked = converse(line, expected, BREAK, |bytes| {
            let lines = bytes.iter().filter_map(|byte| inbox.take(*byte));
            lines.filter(|(said, _)| *said != Said::Damaged).map(|(_, checked)| checked).last()
        })?;
        let dialect = if checked { Dialect::Uart } else { Dialect::Fdcanusb };
        expected.note(DIALECT).store(i64::from(checked), Ordering::Relaxed);
        Ok(Self { line, expected, dialect })
    }

    fn failed(&self, error: std::io::Error) -> MeetError {
        MeetError::Line { port: self.expected.port().to_owned(), error }
    }

    /// Returns the line of text that carries `frame`, preceded by bytes that end an incomplete line
    /// if one was sent before.
    fn line_of(&self, frame: &CanFdFrame) -> Vec<u8> {
        let mut bytes = BREAK.to_vec();
        text::push(&mut bytes, frame, self.dialect);
        bytes
    }

    /// Sends a frame repeatedly until servo `id` sends an answer in which `find` finds a value, and
    /// returns this value. Fails if no such answer arrives.
    fn ask<T>(
        &mut self,
        id: u8,
        frame: &CanFdFrame,
        mut find: impl FnMut(&[u8]) -> Option<T>,
    ) -> Result<T, MeetError> {
        let (question, mut inbox) = (self.line_of(frame), Inbox::new(self.dialect));
        let expected = self.expected;
        converse(self.line, expected, &question, |bytes| {
            let lines = bytes.iter().filter_map(|byte| inbox.take(*byte));
            lines.filter_map(|(said, _)| from(&said, id).and_then(&mut find)).last()
        })
        .map_err(|error| match error {
            MeetError::Silent { port } => {
                MeetError::Setting { port, reason: format!("no answer from the moteus of id {id}: {HELP}") }
            }
            other => other,
        })
    }

    /// Sends the query `frame` and returns the state that servo `id` reports in its answer.
    pub(super) fn state(&mut self, id: u8, frame: &CanFdFrame) -> Result<State, MeetError> {
        self.ask(id, frame, codec::state)
    }

    /// Returns the states of all servos that answer a query, sorted by id. If two servos have the
    /// same id, it occurs twice.
    pub(super) fn everybody(&mut self) -> Result<Vec<(u8, State)>, MeetError> {
        let mut frame = codec::frame_to(BROADCAST, true);
        identity().serialize(&mut frame);
        let (question, mut inbox) = (self.line_of(&frame), Inbox::new(self.dialect));
        let (mut found, mut buffer) = (Vec::new(), [0; 512]);
        self.line.write(0, &question).map_err(|error| self.failed(error))?;
        let mut heard = Instant::now();
        while heard.elapsed() < QUIET {
            let got = self.line.read(0, &mut buffer).map_err(|error| self.failed(error))?;
            for byte in &buffer[..got] {
                let Some((Said::Frame(frame), _)) = inbox.take(*byte) else { continue };
                let sender = codec::sender(&frame);
                found.extend(sender.zip(codec::state(frame.payload()).filter(|s| s.model.is_some())));
            }
            if got > 0 {
                heard = Instant::now();
            } else {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        found.sort_by_key(|(id, _)| *id);
        Ok(found)
    }

    /// Returns the value of a setting of servo `id`, as the text that its console prints.
    pub(super) fn setting(&mut self, id: u8, name: &str) -> Result<String, MeetError> {
        for _ in 0..ASKED {
            // Discard the answers to earlier questions, possibly of other programs.
            for _ in 0..LOOKED {
                if self.poll(id)?.is_empty() {
                    break;
                }
            }
            let mut frame = codec::frame_to(id, true);
            frame.size =
                write_client_to_server(CONSOLE, format!("conf get {name}\n").as_bytes(), &mut frame.data);
            let mut said = self.ask(id, &frame, stream)?;
            for _ in 0..LOOKED {
                if let Some(end) = said.iter().position(|byte| *byte == b'\n') {
                    return Ok(String::from_utf8_lossy(&said[..end]).trim().to_owned());
                }
                said.extend(self.poll(id)?);
            }
        }
        let reason = format!("the moteus of id {id} does not say what its setting {name} is: {HELP}");
        Err(MeetError::Setting { port: self.expected.port().to_owned(), reason })
    }

    /// Returns the text that waits in the console of servo `id`, as bytes. The result is empty if
    /// no text waits.
    fn poll(&mut self, id: u8) -> Result<Vec<u8>, MeetError> {
        let mut frame = codec::frame_to(id, true);
        frame.size = write_client_poll(CONSOLE, CONSOLE_BYTES, &mut frame.data);
        self.ask(id, &frame, stream)
    }

    /// Sends the command that switches off all motors of the line, and does not wait for answers.
    pub(super) fn stop(&mut self) -> Result<(), MeetError> {
        let bytes = self.line_of(&codec::stop_all());
        self.line.write(0, &bytes).map(drop).map_err(|error| self.failed(error))
    }

    /// Switches off all motors of the rig and waits for each servo's answer. Returns whether any
    /// servo has lost power since [`note_power`](Self::note_power) recorded its time of power-on.
    pub(super) fn switch_off(&mut self) -> Result<bool, MeetError> {
        self.stop()?;
        let mut lost = false;
        for at in 0..self.expected.joints() {
            let Some(joint) = self.expected.joint(at) else { continue };
            let mut frame = codec::stop_frame(joint.id, codec::stamp(1, 0));
            codec::state_query(Turn::Uptime).serialize(&mut frame);
            let uptime = self.ask(joint.id, &frame, |data| codec::state(data)?.uptime_ms)?;
            let before = self.expected.note(POWERED + at).load(Ordering::Relaxed);
            lost |= later_by(powered(uptime), before) > SLACK_MS;
        }
        Ok(lost)
    }

    /// Records the time at which a servo got power, so that a later restart can be detected. `at`
    /// is the joint's index on the bus, and `uptime_ms` is the time since power-on that the servo
    /// reported, in ms.
    pub(super) fn note_power(&self, at: usize, uptime_ms: i32) {
        self.expected.note(POWERED + at).store(powered(uptime_ms), Ordering::Relaxed);
        self.expected.note(UPTIME + at).store(i64::from(uptime_ms as u32), Ordering::Relaxed);
    }

    pub(super) fn expected(&self) -> &'a Expected {
        self.expected
    }
}

/// Advice in the error message for a servo that does not answer.
const HELP: &str = "check its power, its id and the wiring of the bus";

/// Returns a query for the registers that identify a servo: home state, time since power-on, model,
/// firmware and register map.
fn identity() -> QueryFormat {
    let mut query = QueryFormat::default();
    (query.position, query.velocity) = (Resolution::Ignore, Resolution::Ignore);
    query.torque = Resolution::Ignore;
    query.home_state = Resolution::Int8;
    for register in [0x070, 0x100, 0x101, 0x102] {
        query.add_extra(register, Resolution::Int32);
    }
    query
}

/// Returns the data of the frame in a received line if servo `id` sent it, otherwise `None`.
fn from(said: &Said, id: u8) -> Option<&[u8]> {
    match said {
        Said::Frame(frame) if codec::sender(frame) == Some(id) => Some(frame.payload()),
        _ => None,
    }
}

fn stream(data: &[u8]) -> Option<Vec<u8>> {
    parse_server_to_client(data, CONSOLE).map(<[u8]>::to_vec)
}

/// Returns by how much the time of power-on `now` is later than the time `before`, ms. A servo
/// counts the time since power-on to 2^32 ms, about 50 days. When it begins again at 0, it seems to
/// have got power that much later. Clocks that drift apart, by a hundred millionths at most, can
/// make a servo seem to have got power up to 10 minutes earlier.
pub(super) fn later_by(now: i64, before: i64) -> i64 {
    const WHOLE_MS: i64 = 1 << 32;
    const DRIFT_MS: i64 = 600_000;
    let later = (now - before).rem_euclid(WHOLE_MS);
    if later > WHOLE_MS - DRIFT_MS { later - WHOLE_MS } else { later }
}

/// Returns the time at which a servo got power, in ms since the start of the system. `uptime_ms` is
/// the time since power-on that the servo has just reported, in ms.
pub(super) fn powered(uptime_ms: i32) -> i64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    now.tv_sec * 1000 + now.tv_nsec / 1_000_000 - i64::from(uptime_ms as u32)
}
