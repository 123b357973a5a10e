//! Writes recordings.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use hbot_api::{Event, StateEvent};
use hbot_core::{CompiledScene, Controller, Inputs, Outputs};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions};

use crate::exact;
use crate::messages::DESCRIPTORS;
use crate::public::Encoder;
use crate::topic::Topic;

/// Name of the metadata record that says what a recording is of.
pub const METADATA: &str = "hbot";

/// Name of the metadata record that [`recover`](crate::recover) writes in the place of what it
/// could not read. It has the reason as `damaged`, or nothing where the recording was cut off.
pub(crate) const LOST: &str = "hbot.lost";

/// Largest size of a chunk before compression, bytes. [`Writer::flush`] also ends a chunk.
const CHUNK_BYTES: u64 = 1 << 20;

/// What a recording is of. It is stored in the metadata record [`METADATA`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct About {
    /// Names of the joints, in the order steer, drive of each wheel.
    pub joints: Vec<String>,
    /// Further entries of the metadata record, such as the rig file.
    pub entries: BTreeMap<String, String>,
}

/// Writes a recording to `W`. Nothing is in the file before [`flush`](Self::flush), which writes a
/// chunk that is readable even if the program dies immediately afterwards.
pub struct Writer<W: Write + Seek> {
    mcap: mcap::Writer<W>,
    /// The channel of each topic that has been written to, and the number of its messages.
    channels: [Option<(u16, u32)>; Topic::ALL.len()],
    encoder: Encoder,
}

impl<W: Write + Seek> Writer<W> {
    /// Begins a recording with its metadata.
    ///
    /// # Errors
    /// Fails if `into` cannot be written.
    pub fn new(into: W, about: &About) -> Result<Self, McapError> {
        let mut metadata = about.entries.clone();
        metadata.insert("format".to_owned(), exact::FORMAT.to_string());
        metadata.insert("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
        metadata.insert("joints".to_owned(), about.joints.join(" "));
        Self::begin(into, metadata, about.joints.clone())
    }

    /// Begins a recording with the metadata record `metadata`, which can be that of another one.
    pub(crate) fn begin(
        into: W,
        metadata: BTreeMap<String, String>,
        joints: Vec<String>,
    ) -> Result<Self, McapError> {
        // A chunk is written only when it is complete, so that a file that ends anywhere has at
        // most one chunk that cannot be read.
        let options = WriteOptions::new()
            .profile("")
            .library(concat!("hbot ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true);
        let mut mcap = options.create(into)?;
        mcap.write_metadata(&Metadata { name: METADATA.to_owned(), metadata })?;
        mcap.flush()?;
        Ok(Self { mcap, channels: [None; _], encoder: Encoder::new(joints) })
    }

    /// Notes that a part of the other recording is lost here: the reason, or `None` for its end.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub(crate) fn lost(&mut self, damaged: Option<&str>) -> Result<(), McapError> {
        let metadata = damaged.map(|why| ("damaged".to_owned(), why.to_owned())).into_iter().collect();
        self.mcap.write_metadata(&Metadata { name: LOST.to_owned(), metadata })
    }

    /// Writes the state of a tick to the public topics of every tick. `unix_ns` is the Unix time of
    /// the tick's deadline, ns.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn state(&mut self, state: &StateEvent, unix_ns: u64) -> Result<(), McapError> {
        self.encoded(|writer, encoder| {
            encoder.state(state, unix_ns, |topic, data| writer.put(topic, unix_ns, data))
        })
    }

    /// Writes the torque of `state` as that of another scene.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn other_torque(&mut self, state: &StateEvent, unix_ns: u64) -> Result<(), McapError> {
        self.encoded(|writer, encoder| {
            writer.put(Topic::OtherTorque, unix_ns, encoder.torque(state, unix_ns))
        })
    }

    /// Writes an event of the TCP API.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn event(&mut self, event: &Event, unix_ns: u64) -> Result<(), McapError> {
        self.encoded(|writer, encoder| writer.put(Topic::Event, unix_ns, encoder.event(event, unix_ns)))
    }

    /// Writes that the scene `name` is rendered from `tick` on. `json` is its file as JSON.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn scene(&mut self, tick: u64, name: &str, json: &str, unix_ns: u64) -> Result<(), McapError> {
        self.encoded(|writer, encoder| {
            writer.put(Topic::Scene, unix_ns, encoder.scene(tick, name, json, unix_ns))
        })
    }

    /// Writes the inputs and outputs of a tick to the private topic.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn exact_tick(&mut self, inputs: &Inputs, outputs: &Outputs, unix_ns: u64) -> Result<(), McapError> {
        self.put(Topic::Exact, unix_ns, &exact::of_tick(inputs, outputs))
    }

    /// Writes the compiled scene that is rendered from `tick` on to the private topic.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn exact_scene(&mut self, tick: u64, scene: &CompiledScene, unix_ns: u64) -> Result<(), McapError> {
        self.put(Topic::Exact, unix_ns, &exact::of_scene(tick, scene))
    }

    /// Writes the state of the control law after `tick` to the private topic.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn exact_controller(&mut self, tick: u64, law: &Controller, unix_ns: u64) -> Result<(), McapError> {
        self.put(Topic::Exact, unix_ns, &exact::of_controller(tick, law))
    }

    /// Marks that `ticks` ticks are missing before `tick`.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn gap(&mut self, tick: u64, ticks: u64, unix_ns: u64) -> Result<(), McapError> {
        self.put(Topic::Exact, unix_ns, &exact::of_gap(tick, ticks))
    }

    /// Ends the present chunk and passes everything to the operating system.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn flush(&mut self) -> Result<(), McapError> {
        self.mcap.flush()
    }

    /// Ends the recording with its index, and returns what it was written to.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. What was flushed before is readable.
    pub fn finish(mut self) -> Result<W, McapError> {
        self.mcap.finish()?;
        Ok(self.mcap.into_inner())
    }

    /// Calls `write` with the encoder, whose buffer the messages are in while they are written.
    fn encoded(
        &mut self,
        write: impl FnOnce(&mut Self, &mut Encoder) -> Result<(), McapError>,
    ) -> Result<(), McapError> {
        let mut encoder = std::mem::take(&mut self.encoder);
        let written = write(self, &mut encoder);
        self.encoder = encoder;
        written
    }

    /// Writes a message in the encoding of its topic.
    pub(crate) fn put(&mut self, topic: Topic, unix_ns: u64, data: &[u8]) -> Result<(), McapError> {
        let (channel_id, sequence) = match self.channels[topic as usize] {
            Some(channel) => channel,
            None => {
                let schema = self.mcap.add_schema(topic.schema(), "protobuf", DESCRIPTORS)?;
                (self.mcap.add_channel(schema, topic.name(), "protobuf", &BTreeMap::new())?, 0)
            }
        };
        self.channels[topic as usize] = Some((channel_id, sequence.wrapping_add(1)));
        let header = MessageHeader { channel_id, sequence, log_time: unix_ns, publish_time: unix_ns };
        self.mcap.write_to_known_channel(&header, data)
    }
}
