//! The private topic: what a replay needs, bit for bit.
//!
//! A record of this topic is the inputs and outputs of a tick, a compiled scene, the whole state of
//! the control law, or a gap. Every number keeps its bits: a 64-bit real takes eight bytes in
//! postcard's format.

use hbot_core::render::effects::{Effect, Span};
use hbot_core::{CompiledScene, Controller, Inputs, Outputs, Real};
use prost::Message as _;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::messages::hbot::exact::Record;
use crate::messages::hbot::{Exact as Message, Tick};

/// Number of the private topic's format and of the control law that it records. It is raised when
/// the types of hbot-core change, or when the same inputs give other outputs. A kind of effect or a
/// cause of a fault that is added at the end of its list does not raise it.
pub const FORMAT: u32 = 9;
/// The oldest format that replays. The state of the control law, the inputs and the outputs of a
/// tick have fields at their ends that a recording of this format lacks. With all of their bits
/// zero the law is that of the recording.
pub const OLDEST: u32 = 3;

/// More bytes than the fields take that a type has gained since [`OLDEST`].
const GAINED: usize = 4096;

/// One record of the private topic.
#[derive(Debug, Clone)]
pub enum Exact {
    /// The inputs and outputs of a tick.
    Tick(Box<(Inputs, Outputs)>),
    /// The scene that is rendered from the next recorded tick on.
    Scene(Box<CompiledScene>),
    /// The whole state of the control law after the last recorded tick.
    Controller(Box<Controller>),
    /// Number of ticks that are missing here.
    Lost(u64),
}

/// The reason why a record of the private topic cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum Unreadable {
    /// The record is not a message of this topic.
    #[error("not a record of hbot's private topic: {0}")]
    Message(#[from] prost::DecodeError),
    /// The record holds no types of this version's hbot-core, or counts that they cannot have.
    #[error("not of this version's types: {0}")]
    Types(#[from] postcard::Error),
    /// The record holds a scene that cannot exist.
    #[error("not a scene: {0}")]
    Scene(#[from] hbot_core::render::scene::SceneError),
    /// The record is empty or of a kind that a later version writes.
    #[error("a record of an unknown kind")]
    Unknown,
}

/// A compiled scene as it is stored: only the numbers that its effects use.
#[derive(Serialize, Deserialize)]
struct Scene {
    revision: u64,
    effects: Vec<Effect>,
    numbers: Vec<Real>,
}

fn bytes(value: &impl Serialize) -> Vec<u8> {
    // Writing into memory fails only for types of unknown length, of which there are none.
    postcard::to_stdvec(value).unwrap_or_default()
}

fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, postcard::Error> {
    let (value, rest) = postcard::take_from_bytes(bytes)?;
    if rest.is_empty() { Ok(value) } else { Err(postcard::Error::SerdeDeCustom) }
}

/// Reads a value to whose end fields were added after it was stored.
fn read_older<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, postcard::Error> {
    let padded = [bytes, &[0; GAINED]].concat();
    let (value, rest) = postcard::take_from_bytes(&padded)?;
    if rest.len() <= GAINED { Ok(value) } else { Err(postcard::Error::SerdeDeCustom) }
}

/// Returns the stored form of the inputs and outputs of a tick.
#[must_use]
pub(crate) fn of_tick(inputs: &Inputs, outputs: &Outputs) -> Vec<u8> {
    message(inputs.tick, Record::Run(Tick { inputs: bytes(inputs), outputs: bytes(outputs) }))
}

/// Returns the part of a scene's table of numbers that its effects use.
pub(crate) fn numbers(scene: &CompiledScene) -> &[Real] {
    // A table has at most 4096 numbers, so their count does not wrap.
    let end = |span: Span| span.start + span.len;
    let len = scene.effects().iter().map(|effect| end(effect.numbers)).max().unwrap_or(0);
    scene.numbers(Span { start: 0, len })
}

/// Returns the stored form of a scene that is rendered from `tick` on.
#[must_use]
pub(crate) fn of_scene(tick: u64, scene: &CompiledScene) -> Vec<u8> {
    let (effects, numbers) = (scene.effects().to_vec(), numbers(scene).to_vec());
    let stored = Scene { revision: scene.revision(), effects, numbers };
    message(tick, Record::Scene(bytes(&stored)))
}

/// Returns the stored form of the state of the control law after `tick`.
#[must_use]
pub(crate) fn of_controller(tick: u64, controller: &Controller) -> Vec<u8> {
    message(tick, Record::Controller(bytes(controller)))
}

/// Returns the stored form of a gap of `ticks` ticks before `tick`.
#[must_use]
pub(crate) fn of_gap(tick: u64, ticks: u64) -> Vec<u8> {
    message(tick, Record::LostTicks(ticks))
}

fn message(tick: u64, record: Record) -> Vec<u8> {
    Message { tick, record: Some(record) }.encode_to_vec()
}

impl Exact {
    /// Reads a record of this format from its stored form.
    ///
    /// # Errors
    /// Fails if the record is not one of this format.
    pub fn read(data: &[u8]) -> Result<Self, Unreadable> {
        Self::read_from(FORMAT, data)
    }

    /// Reads a record of the format `format`, [`OLDEST`] to [`FORMAT`], from its stored form.
    ///
    /// # Errors
    /// Fails if the record is not one of that format.
    pub fn read_from(format: u32, data: &[u8]) -> Result<Self, Unreadable> {
        Ok(match Message::decode(data)?.record.ok_or(Unreadable::Unknown)? {
            Record::Run(Tick { inputs, outputs }) => Self::Tick(Box::new(match format {
                FORMAT => (read(&inputs)?, read(&outputs)?),
                _ => (read_older(&inputs)?, read_older(&outputs)?),
            })),
            Record::Scene(scene) => {
                let Scene { revision, effects, numbers } = read(&scene)?;
                Self::Scene(Box::new(CompiledScene::with_numbers(revision, &effects, &numbers)?))
            }
            Record::Controller(controller) => Self::Controller(Box::new(match format {
                FORMAT => read(&controller)?,
                _ => read_older(&controller)?,
            })),
            Record::LostTicks(ticks) => Self::Lost(ticks),
        })
    }
}

/// Returns whether two outputs agree in every bit. So zeros of different sign differ, and so do
/// NaNs of different bits.
#[must_use]
pub fn same_bits(a: &Outputs, b: &Outputs) -> bool {
    bytes(a) == bytes(b)
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;
    use hbot_core::inputs::{ModelCommand, Stamp};
    use hbot_core::render::model::LocalModel;

    use super::*;

    /// A damaged count must not name elements of an array that are not there: the control law would
    /// panic.
    #[test]
    fn a_count_that_is_larger_than_its_array_is_no_record() {
        // The last byte of the inputs says that there is no model, the one before is the number of
        // commands.
        let mut inputs = bytes(&Inputs::quiet(7));
        assert_eq!(read::<Inputs>(&inputs), Ok(Inputs::quiet(7)));
        let len = inputs.len();
        inputs[len - 2] = 9;
        assert!(read::<Inputs>(&inputs).is_err(), "9 commands of at most 8");

        // The number of half-spaces is the last byte of a model.
        let mut tick = Inputs::quiet(7);
        let command = ModelCommand { valid_ticks: 1, blend_ticks: None, stamp: Stamp::default() };
        tick.commands.push_model(command, &LocalModel::NONE).unwrap();
        let mut inputs = bytes(&tick);
        assert_eq!(read::<Inputs>(&inputs), Ok(tick));
        *inputs.last_mut().unwrap() = 9;
        assert!(read::<Inputs>(&inputs).is_err(), "9 half-spaces of at most 8");

        // The number of wheels follows the sphere's radius and mass, two reals, with which the
        // state of the control law begins.
        let mut law = bytes(&Controller::new(RigConfig::prototype().rig));
        assert_eq!(law[16], 2);
        for wheels in [0, 1, 9, 127] {
            law[16] = wheels;
            assert!(read::<Controller>(&law).is_err(), "{wheels} wheels of 2 to 8");
        }
    }
}
