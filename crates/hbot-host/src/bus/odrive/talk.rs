//! A conversation outside the loop: what the axes of a line say when they are asked, or left alone.

use super::message::{Command, Message, decode};
use super::slcan::{Decoder, OPEN, Word};
use crate::bus::{Expected, MeetError};
use crate::line::Line;

/// Ids that an axis may have.
pub(super) const IDS: usize = 64;

/// What has been heard of one id.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Met {
    /// Major, minor, variant of the board.
    pub(super) hardware: [u8; 3],
    /// Major, minor, revision of the firmware.
    pub(super) firmware: Option<[u8; 3]>,
    /// How often the version was asked for and said: more answers than questions are of two axes.
    pub(super) asked: u32,
    pub(super) answered: u32,
    /// How often each has come.
    pub(super) heartbeats: u32,
    pub(super) estimates: u32,
    pub(super) error: u32,
    pub(super) state: u8,
    /// Turns of the encoder.
    pub(super) position: Option<f64>,
    /// V.
    pub(super) supply: Option<f64>,
}

impl Met {
    /// Somebody has this id.
    pub(super) fn is_there(&self) -> bool {
        self.heartbeats + self.estimates + self.answered > 0
    }
}

/// A conversation. It counts its own time, by which a line in memory goes.
pub(super) struct Talk<'a> {
    line: &'a mut dyn Line,
    port: &'a str,
    decoder: Decoder,
    pub(super) now_ms: u64,
    /// By id.
    pub(super) met: [Met; IDS],
}

impl<'a> Talk<'a> {
    /// Opens the channel of the adapter.
    pub(super) fn open(line: &'a mut dyn Line, expected: &'a Expected) -> Result<Self, MeetError> {
        let met = [Met::default(); IDS];
        let mut talk = Self { line, port: expected.port(), decoder: Decoder::default(), now_ms: 0, met };
        talk.write(OPEN)?;
        Ok(talk)
    }

    /// The name of the port.
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

    /// Says something to an axis.
    pub(super) fn say(&mut self, id: u8, command: Command) -> Result<(), MeetError> {
        let mut bytes = Vec::new();
        command.write(id, &mut bytes);
        self.write(&bytes)
    }

    /// Says something to several axes.
    pub(super) fn say_all(&mut self, ids: &[u8], command: Command) -> Result<(), MeetError> {
        ids.iter().try_for_each(|id| self.say(*id, command))
    }

    /// Listens for some milliseconds.
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
            Message::Errors { .. } | Message::Current { .. } | Message::Temperature { .. } => {}
        }
    }

    /// The ids that have been heard.
    pub(super) fn there(&self) -> Vec<u8> {
        (0..IDS as u8).filter(|id| self.of(*id).is_there()).collect()
    }

    /// What has been heard of an id.
    pub(super) fn of(&self, id: u8) -> &Met {
        &self.met[usize::from(id) % IDS]
    }

    /// Listens until all of `ids` are `right`, at most for `ms`. Returns the first that is not.
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
