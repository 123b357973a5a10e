//! A conversation with the axes of a line outside the loop. It sends questions, and records what
//! the axes report in answer or without being asked.

use super::message::{Command, Message, decode};
use super::slcan::{Decoder, OPEN, Word};
use crate::bus::{Expected, MeetError};
use crate::line::Line;

/// Number of possible ids of an axis.
pub(super) const IDS: usize = 64;
/// Time at the start of a conversation in which answers to another program can still arrive, ms.
const STALE_MS: u64 = 50;

/// Numbers and latest contents of the messages that have arrived from the axis with one id.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Met {
    /// Major version, minor version and variant of the board.
    pub(super) hardware: [u8; 3],
    /// Major version, minor version and revision of the firmware.
    pub(super) firmware: Option<[u8; 3]>,
    /// Number of times that the axis was asked for its version.
    pub(super) asked: u32,
    /// Number of versions received. If it exceeds `asked`, two axes have this id.
    pub(super) answered: u32,
    /// Number of heartbeats received.
    pub(super) heartbeats: u32,
    /// Number of positions received.
    pub(super) estimates: u32,
    /// Errors in the last heartbeat.
    pub(super) error: u32,
    /// State in the last heartbeat.
    pub(super) state: u8,
    /// Last position, in turns of the encoder. `None` also if it was not a number.
    pub(super) position: Option<f64>,
    /// Supply voltage, in V.
    pub(super) supply: Option<f64>,
    /// Numbers of currents and temperatures received, for which bring-up does not ask. Those of the
    /// first [`STALE_MS`] may answer a program that has ended.
    pub(super) unasked: [u32; 2],
}

impl Met {
    /// Returns whether any message has arrived from this id.
    pub(super) fn is_there(&self) -> bool {
        self.heartbeats + self.estimates + self.answered > 0
    }
}

/// A conversation with the axes of a line before the first tick. It counts its own time from 0,
/// which a line in memory uses as its clock.
pub(super) struct Talk<'a> {
    line: &'a mut dyn Line,
    port: &'a str,
    decoder: Decoder,
    /// Time since the start of the conversation, in ms.
    pub(super) now_ms: u64,
    /// What has been received from each axis, indexed by its id.
    pub(super) met: [Met; IDS],
}

impl<'a> Talk<'a> {
    /// Starts a conversation and opens the CAN channel of the adapter.
    pub(super) fn open(line: &'a mut dyn Line, expected: &'a Expected) -> Result<Self, MeetError> {
        let met = [Met::default(); IDS];
        let mut talk = Self { line, port: expected.port(), decoder: Decoder::default(), now_ms: 0, met };
        talk.write(OPEN)?;
        Ok(talk)
    }

    /// Returns the name of the port, for messages.
    pub(super) fn port(&self) -> String {
        self.port.to_owned()
    }

    fn write(&mut self, mut bytes: &[u8]) -> Result<(), MeetError> {
        while !bytes.is_empty() {
            let written =
                self.line.write(self.now_ms * 1_000_000, bytes).map_err(|error| self.failed(error))?;
            bytes = &bytes[written..];
            if !bytes.is_empty() {
                self.listen(1)?;
            }
        }
        Ok(())
    }

    fn failed(&self, error: std::io::Error) -> MeetError {
        MeetError::Line { port: self.port(), error }
    }

    /// Sends a command to one axis.
    pub(super) fn say(&mut self, id: u8, command: Command) -> Result<(), MeetError> {
        let mut bytes = Vec::new();
        command.write(id, &mut bytes);
        self.write(&bytes)
    }

    /// Sends a command to several axes.
    pub(super) fn say_all(&mut self, ids: &[u8], command: Command) -> Result<(), MeetError> {
        ids.iter().try_for_each(|id| self.say(*id, command))
    }

    /// Receives messages for `ms` milliseconds, and records them in `met`.
    pub(super) fn listen(&mut self, ms: u64) -> Result<(), MeetError> {
        let mut buffer = [0; 512];
        for _ in 0..ms {
            self.line.pause();
            self.now_ms += 1;
            loop {
                let read = self.line.read(self.now_ms * 1_000_000, &mut buffer);
                let n = read.map_err(|error| self.failed(error))?;
                for byte in &buffer[..n] {
                    if let Some(Ok(Word::Frame(frame))) = self.decoder.push(*byte)
                        && let Some((id, message)) = decode(&frame)
                    {
                        self.hear(id, &message);
                    }
                }
                if n < buffer.len() {
                    break;
                }
            }
        }
        Ok(())
    }

    fn hear(&mut self, id: u8, message: &Message) {
        let met = &mut self.met[usize::from(id) % IDS];
        match *message {
            Message::Version { hardware, firmware, .. } => {
                met.answered += 1;
                (met.hardware, met.firmware) = (hardware, Some(firmware));
            }
            Message::Heartbeat { error, state, .. } => {
                met.heartbeats += 1;
                (met.error, met.state) = (error, state);
            }
            Message::Estimates { position, .. } => {
                met.estimates += 1;
                met.position = Some(f64::from(position)).filter(|position| position.is_finite());
            }
            Message::Supply { voltage, .. } => met.supply = Some(f64::from(voltage)),
            Message::Current { .. } => met.unasked[0] += u32::from(self.now_ms > STALE_MS),
            Message::Temperature { .. } => met.unasked[1] += u32::from(self.now_ms > STALE_MS),
            Message::Errors { .. } => {}
        }
    }

    /// Returns the ids of all axes from which a message has arrived.
    pub(super) fn there(&self) -> Vec<u8> {
        (0..IDS as u8).filter(|id| self.of(*id).is_there()).collect()
    }

    /// Returns what has been received from the axis with this id.
    pub(super) fn of(&self, id: u8) -> &Met {
        &self.met[usize::from(id) % IDS]
    }

    /// Receives messages until `right` holds for all of `ids`, for at most `ms` milliseconds.
    /// Returns the first id for which it does not hold, if any.
    pub(super) fn until(
        &mut self,
        ms: u64,
        ids: &[u8],
        right: impl Fn(&Met) -> bool,
    ) -> Result<Option<u8>, MeetError> {
        let wrong = |talk: &Self| ids.iter().copied().find(|id| !right(talk.of(*id)));
        for _ in 0..ms {
            if wrong(self).is_none() {
                return Ok(None);
            }
            self.listen(1)?;
        }
        Ok(wrong(self))
    }
}
