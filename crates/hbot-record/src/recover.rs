//! Makes a file with an index and an end of a recording that was cut off or damaged.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use mcap::McapError;
use prost::Message as _;

use crate::messages::hbot::State;
use crate::reader::{Item, ReadError, Reader};
use crate::ticks::Ticks;
use crate::topic::Topic;
use crate::writer::Writer;

/// What was found in a recording and copied.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recovered {
    /// Number of messages that were copied.
    pub messages: u64,
    /// The ticks that were copied, and those that are missing between them.
    pub ticks: Ticks,
    /// Whether the file ended before the end of the recording.
    pub cut: bool,
    /// Parts that could not be read, each with the reason. Their messages are lost.
    pub damaged: Vec<String>,
}

/// The reason why a recording cannot be recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// The recording cannot be read at all.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new recording cannot be written.
    #[error("the new recording cannot be written: {0}")]
    Write(#[from] McapError),
    /// The file has no message and no metadata of hbot.
    #[error("nothing of a recording of hbot is in it")]
    Empty,
}

/// Copies everything of the recording `from` that can be read to a new one with an index and an
/// end. Messages, their times and the metadata keep their bytes, so the new recording replays as
/// far as the old one. Where something is lost, the new recording says so.
///
/// # Errors
/// Fails if `from` is no MCAP file or has nothing of a recording of hbot, or if `into` cannot be
/// written.
pub fn recover<W: Write + Seek>(from: impl Read + Seek, into: W) -> Result<Recovered, RecoverError> {
    let mut reader = Reader::new(from)?;
    let mut found = Recovered::default();
    // The metadata come first, unless they are damaged.
    let mut waiting = Some(into);
    let mut writer = None;
    // The losses that the new recording must name.
    let mut lost: Vec<Option<String>> = Vec::new();
    loop {
        let item = match reader.next() {
            // What was read before a bad block of the disk is kept.
            Err(error) if writer.is_some() => Item::Damaged(error.to_string()),
            read => match read? {
                Some(item) => item,
                None => break,
            },
        };
        match item {
            Item::Cut => {
                found.cut = true;
                lost.push(None);
            }
            Item::Damaged(why) => {
                found.ticks.damaged();
                found.damaged.push(why.clone());
                lost.push(Some(why));
            }
            Item::About(about) => {
                if let Some(into) = waiting.take() {
                    writer = Some(Writer::begin(into, about, Vec::new())?);
                }
            }
            Item::Message { topic, log_time, data } => {
                let Some(topic) = Topic::ALL.into_iter().find(|known| known.name() == topic) else {
                    let why = format!("messages of the unknown topic {topic:?}");
                    if !found.damaged.contains(&why) {
                        lost.push(Some(why.clone()));
                        found.damaged.push(why);
                    }
                    continue;
                };
                if let Some(into) = waiting.take() {
                    writer = Some(Writer::begin(into, BTreeMap::new(), Vec::new())?);
                }
                let Some(writer) = &mut writer else { continue };
                writer.put(topic, log_time, &data)?;
                if topic == Topic::State
                    && let Ok(state) = State::decode(data.as_slice())
                {
                    found.ticks.state(&state);
                }
                found.messages += 1;
            }
        }
        if let Some(writer) = &mut writer {
            lost.drain(..).try_for_each(|why| writer.lost(why.as_deref()))?;
        }
    }
    writer.ok_or(RecoverError::Empty)?.finish()?;
    Ok(found)
}
