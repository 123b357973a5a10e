//! Reads recordings, also those that are cut off or damaged.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::io::{ErrorKind, Read, Seek, SeekFrom};

use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use mcap::{MAGIC, McapError};

use crate::writer::METADATA;

/// Largest record that is read, bytes. It is far above the chunks that [`Writer`](crate::Writer)
/// writes, and keeps a damaged length from filling the memory.
const MAX_RECORD: u64 = 256 << 20;

/// A part of a recording, in the order of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Item {
    /// The metadata record that says what the recording is of.
    About(BTreeMap<String, String>),
    /// A message.
    Message {
        /// Name of the topic.
        topic: String,
        /// Unix time of the message, ns.
        log_time: u64,
        /// The message in the encoding of its topic.
        data: Vec<u8>,
    },
    /// A chunk or record that cannot be read, with the reason. The messages in it are lost.
    Damaged(String),
    /// The file ends before the end of the recording, for example because the program was killed.
    Cut,
}

/// The reason why a file cannot be read as a recording.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The operating system could not read the file.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// The file is not an MCAP file.
    #[error("not an MCAP file")]
    Foreign,
    /// The file is damaged outside of its chunks, so the rest cannot be read.
    #[error("damaged: {0}")]
    Damaged(String),
}

/// Reads a recording from its beginning to its end.
pub struct Reader<R> {
    from: R,
    /// The topic of each channel.
    channels: HashMap<u16, String>,
    waiting: VecDeque<Item>,
    over: bool,
}

impl<R: Read + Seek> Reader<R> {
    /// Begins to read a recording. First it reads the index at the end, which repeats what each
    /// channel is. So messages can be read even if the chunk that says it first is damaged.
    ///
    /// # Errors
    /// Fails if `from` cannot be read or is not an MCAP file.
    pub fn new(mut from: R) -> Result<Self, ReadError> {
        let channels = indexed_channels(&mut from).unwrap_or_default();
        from.rewind()?;
        let mut magic = [0; MAGIC.len()];
        match from.read_exact(&mut magic) {
            Ok(()) if magic == *MAGIC => Ok(Self { from, channels, waiting: VecDeque::new(), over: false }),
            Err(error) if error.kind() != ErrorKind::UnexpectedEof => Err(error.into()),
            _ => Err(ReadError::Foreign),
        }
    }

    /// Returns the next part of the recording, or `None` at its end.
    ///
    /// # Errors
    /// Fails if the rest of the file cannot be read. The next call returns `None`.
    #[allow(clippy::should_implement_trait, reason = "a method that fails is no iterator")]
    pub fn next(&mut self) -> Result<Option<Item>, ReadError> {
        while !self.over && self.waiting.is_empty() {
            let read = self.record();
            self.over |= read.is_err();
            read?;
        }
        Ok(self.waiting.pop_front())
    }

    /// Reads one record of the file.
    fn record(&mut self) -> Result<(), ReadError> {
        let mut head = [0; 9];
        if !filled(&mut self.from, &mut head)? {
            return self.cut();
        }
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > MAX_RECORD {
            return Err(ReadError::Damaged(format!("a record of {length} bytes")));
        }
        let mut body = Vec::new();
        if (&mut self.from).take(length).read_to_end(&mut body)? as u64 != length {
            return self.cut();
        }
        if opcode == op::CHUNK {
            if let Err(error) = self.chunk(&body) {
                self.waiting.push_back(Item::Damaged(error.to_string()));
            }
            return Ok(());
        }
        match parse_record(opcode, &body) {
            Ok(Record::Metadata(metadata)) if metadata.name == METADATA => {
                self.waiting.push_back(Item::About(metadata.metadata));
            }
            // The index follows, which repeats what has been read.
            Ok(Record::DataEnd(_)) => self.over = true,
            // No version of hbot writes other kinds, so it may be what is left of a chunk.
            Ok(Record::Unknown { opcode, .. }) => {
                self.waiting.push_back(Item::Damaged(format!("a record of the unknown kind {opcode}")));
            }
            Ok(record) => self.plain(record),
            Err(error) => return Err(ReadError::Damaged(error.to_string())),
        }
        Ok(())
    }

    fn cut(&mut self) -> Result<(), ReadError> {
        self.over = true;
        self.waiting.push_back(Item::Cut);
        Ok(())
    }

    /// Takes the messages of the chunk record `body`. If the chunk is damaged, none of them is
    /// taken.
    fn chunk(&mut self, body: &[u8]) -> Result<(), McapError> {
        let begin = self.waiting.len();
        let taken = self.records_of(body);
        if taken.is_err() {
            self.waiting.truncate(begin);
        }
        taken
    }

    /// Takes the records of the chunk record `body`, up to the first error. The sum of the chunk is
    /// checked before any length in it is believed, so that damage cannot ask for much memory.
    fn records_of(&mut self, body: &[u8]) -> Result<(), McapError> {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD as usize);
        let mut reader = LinearReader::new_with_options(options);
        let mut bytes = vec![op::CHUNK];
        bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
        bytes.extend_from_slice(body);
        let mut rest = bytes.as_slice();
        while let Some(event) = reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let (now, later) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    rest = later;
                }
                LinearReadEvent::Record { opcode, data } => self.plain(parse_record(opcode, data)?),
            }
        }
        Ok(())
    }

    fn plain(&mut self, record: Record<'_>) {
        match record {
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel.topic);
            }
            Record::Message { header, data } => {
                let topic = self.channels.get(&header.channel_id).cloned().unwrap_or_default();
                let (log_time, data) = (header.log_time, data.into_owned());
                self.waiting.push_back(Item::Message { topic, log_time, data });
            }
            _ => {}
        }
    }
}

/// Returns the topics of the channels in the index at the end of a recording.
fn indexed_channels(from: &mut (impl Read + Seek)) -> Result<HashMap<u16, String>, McapError> {
    let options = SummaryReaderOptions::default()
        .with_file_size(from.seek(SeekFrom::End(0))?)
        .with_record_length_limit(MAX_RECORD as usize);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            SummaryReadEvent::ReadRequest(wanted) => {
                let read = from.read(reader.insert(wanted))?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(from.seek(to)?),
        }
    }
    let channels = reader.finish().map(|summary| summary.channels).unwrap_or_default();
    Ok(channels.iter().map(|(id, channel)| (*id, channel.topic.clone())).collect())
}

/// Fills `bytes`. Returns false if the file ends before.
fn filled(from: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<bool> {
    match from.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
