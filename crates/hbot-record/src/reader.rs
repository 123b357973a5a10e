//! Reads recordings, also those that are cut off or damaged.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::io::{ErrorKind, Read, Seek, SeekFrom};

use crc32fast::Hasher;
use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

use crate::index;
use crate::writer::{LOST, METADATA};

/// Largest record that is read, bytes. It is far above the chunks that [`Writer`](crate::Writer)
/// writes, and keeps a damaged length from filling the memory.
pub(crate) const MAX_RECORD: u64 = 256 << 20;

/// Largest size of a chunk before compression that is read, bytes.
///
/// It is 16 times the size at which [`Writer`](crate::Writer) ends a chunk, and more than the
/// largest scene file. A few bytes of a compressed chunk can stand for gigabytes of zeros, which
/// would take minutes to read.
const MAX_CHUNK: u64 = 16 << 20;

/// Bytes of a chunk record before its messages, without the name of the compression: two times, a
/// length, a check code, the lengths of the name and of the compressed messages.
const CHUNK_HEADER: usize = 8 + 8 + 8 + 4 + 4 + 8;

/// Bytes of a chunk up to its check code, with its kind and its length.
const CHUNK_HEAD: usize = 1 + 8 + 8 + 8 + 8 + 4;

/// Bytes that a search for an intact chunk reads at a time.
const BLOCK: usize = 1 << 13;

/// Bytes that are read in vain for each byte of the file, beyond [`MAX_RECORD`], before the search
/// for intact chunks ends. Without this limit, a file full of false lengths would take for ever.
/// Chunks of hbot are compressed by far less.
const VAIN: u64 = 32;

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
    /// A part that cannot be read, with the reason. The messages in it are lost.
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
}

/// Reads a recording from its beginning to its end.
pub struct Reader<R> {
    from: R,
    /// Check code of all bytes until here.
    sum: Hasher,
    /// Number of bytes before the present record.
    at: u64,
    /// The topic of each channel.
    channels: HashMap<u16, String>,
    /// Whether the channels of the index at the end are among them.
    indexed: bool,
    waiting: VecDeque<Item>,
    /// Whether anything was damaged until here.
    damaged: bool,
    /// Whether a record that is strange or damaged has been told of since the last chunk.
    strange: bool,
    /// Place of the chunk that the last search has found. `u64::MAX`: none is left.
    intact: u64,
    /// Number of bytes that were read in vain because of false lengths.
    vain: u64,
    over: bool,
}

impl<R: Read + Seek> Reader<R> {
    /// Begins to read a recording from a file or a pipe. In a file, the index at the end is read if
    /// the chunk that says which topic a message belongs to was damaged, and the next intact chunk
    /// is searched for behind a record whose length or content is wrong.
    ///
    /// # Errors
    /// Fails if `from` cannot be read or is not an MCAP file.
    pub fn new(mut from: R) -> Result<Self, ReadError> {
        let mut magic = [0; MAGIC.len()];
        match from.read_exact(&mut magic) {
            Ok(()) if magic == *MAGIC => {}
            Err(error) if error.kind() != ErrorKind::UnexpectedEof => return Err(error.into()),
            _ => return Err(ReadError::Foreign),
        }
        let mut sum = Hasher::new();
        sum.update(&magic);
        Ok(Self {
            from,
            sum,
            at: MAGIC.len() as u64,
            channels: HashMap::new(),
            indexed: false,
            waiting: VecDeque::new(),
            damaged: false,
            strange: false,
            intact: 0,
            vain: 0,
            over: false,
        })
    }

    /// Returns the next part of the recording, or `None` at its end.
    ///
    /// # Errors
    /// Fails if the operating system cannot read the file. The next call returns `None`.
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
            return self.unreadable(0, false);
        }
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > MAX_RECORD {
            return self.unreadable(0, true);
        }
        let mut body = Vec::new();
        let read = (&mut self.from).take(length).read_to_end(&mut body)? as u64;
        if read != length {
            return self.unreadable(read, false);
        }
        let before = self.sum.clone().finalize();
        self.sum.update(&head);
        self.sum.update(&body);
        let taken = match opcode {
            op::CHUNK => {
                self.strange = false;
                self.chunk(&body)
            }
            op::METADATA => self.metadata(&body).map_err(reason),
            op::DATA_END if body.len() == 4 => {
                // The index follows.
                self.over = true;
                let right = u32::from_le_bytes([body[0], body[1], body[2], body[3]]);
                if right != 0 && right != before && !self.damaged {
                    self.damaged("the check code of the file is wrong, those of its chunks are right");
                }
                Ok(())
            }
            op::HEADER | op::ATTACHMENT => Ok(()),
            op::MESSAGE_INDEX if index::is_of_chunk(&body) => Ok(()),
            // It may be what is left of a chunk.
            _ => Err(format!("an unexpected record of kind {opcode}")),
        };
        let behind = self.at + head.len() as u64 + length;
        if let Err(why) = taken {
            // If its length is wrong too, it has swallowed chunks.
            if let Some(place) = self.search(length)?.filter(|place| *place < behind) {
                return self.skip(place, length);
            }
            // The first of several between two chunks is told.
            if opcode == op::CHUNK || !std::mem::replace(&mut self.strange, true) {
                self.damaged(&why);
            }
        }
        self.at = behind;
        Ok(())
    }

    /// Goes on at the next intact chunk behind the beginning of a record whose end is unknown, of
    /// which `read` bytes were read. If there is none, the recording ends here: it was cut off if
    /// the file has no end, and is damaged if it has one or the length of the record is `wrong`.
    fn unreadable(&mut self, read: u64, wrong: bool) -> Result<(), ReadError> {
        if let Some(place) = self.search(read)? {
            return self.skip(place, read);
        }
        self.over = true;
        let ends = index::has_end(&mut self.from);
        if ends || wrong {
            self.damaged = true;
            let why = format!("nothing from byte {} on can be read", self.at);
            self.waiting.push_back(Item::Damaged(why));
        }
        if !ends {
            self.waiting.push_back(Item::Cut);
        }
        Ok(())
    }

    /// Goes on at the chunk at `place`, inside of a record of which `read` bytes were read.
    fn skip(&mut self, place: u64, read: u64) -> Result<(), ReadError> {
        self.vain += read;
        self.damaged = true;
        let why = format!("bytes {} to {} cannot be read", self.at, place - 1);
        self.waiting.push_back(Item::Damaged(why));
        self.from.seek(SeekFrom::Start(place))?;
        self.at = place;
        Ok(())
    }

    /// Returns whether `more` bytes can be read in vain at `place` of the file.
    fn affords(&self, more: u64, place: u64) -> bool {
        self.vain + more <= MAX_RECORD + VAIN * place
    }

    /// Returns the place of the first intact chunk behind the beginning of the present record, of
    /// which `read` bytes were read. There is none in a pipe. The position stays as it was.
    fn search(&mut self, read: u64) -> std::io::Result<Option<u64>> {
        let Ok(here) = self.from.stream_position() else { return Ok(None) };
        if !self.affords(read, self.at) {
            return Ok(None);
        }
        // What was searched is not searched again.
        if self.intact <= self.at {
            self.intact = self.intact_from(self.at + 1)?.unwrap_or(u64::MAX);
            self.from.seek(SeekFrom::Start(here))?;
        }
        Ok(Some(self.intact).filter(|place| *place != u64::MAX))
    }

    fn intact_from(&mut self, mut begin: u64) -> std::io::Result<Option<u64>> {
        let mut block = Vec::new();
        loop {
            block.clear();
            self.from.seek(SeekFrom::Start(begin))?;
            (&mut self.from).take(BLOCK as u64).read_to_end(&mut block)?;
            for (place, head) in (begin..).zip(block.array_windows()) {
                if head[0] == op::CHUNK && self.is_intact(place, head)? {
                    return Ok(Some(place));
                }
            }
            if block.len() < BLOCK {
                return Ok(None);
            }
            begin += (BLOCK - CHUNK_HEAD + 1) as u64;
        }
    }

    /// Returns whether a chunk with the right check code begins with `head` at `place` of the file.
    fn is_intact(&mut self, place: u64, head: &[u8; CHUNK_HEAD]) -> std::io::Result<bool> {
        let number = |at: usize, bytes: usize| {
            head[at..at + bytes].iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
        };
        let [length, size, sum] = [number(1, 8), number(25, 8), number(33, 4)];
        // Without a sum it can be anything.
        let fits = sum != 0 && size <= MAX_CHUNK && length <= 2 * MAX_CHUNK;
        if !fits || !self.affords(length + size, place) {
            return Ok(false);
        }
        let mut body = Vec::new();
        self.from.seek(SeekFrom::Start(place + 9))?;
        (&mut self.from).take(length).read_to_end(&mut body)?;
        let waiting = self.waiting.len();
        let intact = body.len() as u64 == length && self.chunk(&body).is_ok();
        self.waiting.truncate(waiting);
        self.vain += if intact { 0 } else { length + size };
        Ok(intact)
    }

    fn damaged(&mut self, why: &str) {
        self.damaged = true;
        self.waiting.push_back(Item::Damaged(format!("{why} (at byte {})", self.at)));
    }

    fn metadata(&mut self, body: &[u8]) -> Result<(), McapError> {
        let Record::Metadata(mut metadata) = parse_record(op::METADATA, body)? else { return Ok(()) };
        match metadata.name.as_str() {
            METADATA => self.waiting.push_back(Item::About(metadata.metadata)),
            LOST => {
                self.waiting.push_back(metadata.metadata.remove("damaged").map_or(Item::Cut, Item::Damaged))
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes the messages of the chunk record `body`. If the chunk is damaged, none of them is
    /// taken, and the reason is returned.
    fn chunk(&mut self, body: &[u8]) -> Result<(), String> {
        if let Record::Chunk { header, data } = parse_record(op::CHUNK, body).map_err(reason)? {
            if body.len() != CHUNK_HEADER + header.compression.len() + data.len() {
                return Err("a chunk that is longer than its messages".to_owned());
            }
            let size = header.uncompressed_size;
            if size > MAX_CHUNK {
                return Err(format!("a chunk of {size} bytes, at most {MAX_CHUNK} are read"));
            }
        }
        let begin = self.waiting.len();
        let taken = self.records_of(body);
        if taken.is_err() {
            self.waiting.truncate(begin);
        }
        taken.map_err(reason)
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
                LinearReadEvent::Record { opcode, data } => self.take(opcode, data)?,
            }
        }
        Ok(())
    }

    /// Takes what a record of a chunk says, if it is a channel or a message.
    fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), McapError> {
        if opcode != op::CHANNEL && opcode != op::MESSAGE {
            return Ok(());
        }
        match parse_record(opcode, body)? {
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel.topic);
            }
            Record::Message { header, data } => {
                let topic = self.topic(header.channel_id);
                let (log_time, data) = (header.log_time, data.into_owned());
                self.waiting.push_back(Item::Message { topic, log_time, data });
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the topic of a channel. The index at the end is read if no chunk has said it.
    fn topic(&mut self, channel: u16) -> String {
        if !self.indexed && !self.channels.contains_key(&channel) {
            self.indexed = true;
            for (id, topic) in index::channels(&mut self.from).unwrap_or_default() {
                self.channels.entry(id).or_insert(topic);
            }
        }
        self.channels.get(&channel).cloned().unwrap_or_default()
    }
}

/// Says why a record cannot be read.
fn reason(error: McapError) -> String {
    match error {
        // The library's words are about itself.
        McapError::Io(_) | McapError::DecompressionError(_) | McapError::BadChunkCrc { .. } => {
            "a part that cannot be unpacked".to_owned()
        }
        _ => error.to_string(),
    }
}

/// Fills `bytes`. Returns false if the file ends before.
fn filled(from: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<bool> {
    match from.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
