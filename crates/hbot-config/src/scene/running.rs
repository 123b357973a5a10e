//! The running scene as seen from outside the control loop: its parameters, which `set` changes,
//! and the memory slot of each effect.

use hbot_core::render::effects::{Effect, Span};
use hbot_core::render::scene::{CompiledScene, MAX_EFFECTS, MAX_NUMBERS};
use serde_json::{Map, Value};

use super::kinds::to_matrices;
use super::{KindEntry, SceneEffect, SceneFile, check_numbers};
use crate::angle::to_radians;
use crate::diagnostic::Diagnostics;
use crate::document::Report;
use crate::legal::{did_you_mean, guess};
use crate::validate::{is_typed, validate};

/// The scene that the control loop runs. Every change returns a new [`CompiledScene`], which the
/// caller passes to the loop.
#[derive(Debug, Clone, PartialEq)]
pub struct RunningScene {
    file: SceneFile,
    /// Identifies the memory that the core's `Controller` keeps for each effect, in the order of
    /// the effects.
    memories: Vec<Memory>,
    /// Effects of the previous scene that are fading out, each with its memory in the core.
    leaving: Vec<(SceneEffect, Memory)>,
    revision: u64,
    last_epoch: u32,
}

/// Identifies the memory that the core's `Controller` keeps for one effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Memory {
    slot: u8,
    epoch: u32,
    reference_revision: u32,
}

/// Identifies the memory that the core's `Controller` keeps for one effect. The `Controller` has
/// several slots, each with one memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EffectPlace {
    /// Index of the slot that holds the effect's memory, below
    /// [`MAX_EFFECTS`](hbot_core::render::scene::MAX_EFFECTS).
    pub slot: u8,
    /// Number of the effect, counted since the server started and never 0. It tells apart effects
    /// that use the same slot one after the other.
    pub epoch: u32,
    /// Whether the effect has a reference orientation that can be moved.
    pub has_reference: bool,
}

/// The error returned when the parameters of an effect cannot be set. The scene stays unchanged.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SetError {
    /// No effect of the scene has the requested id.
    #[error("no effect has the id {id:?}{}; legal: {}", guess(meant.as_deref()), if legal.is_empty() { "none, the scene is empty".to_owned() } else { legal.join(", ") })]
    UnknownEffect {
        /// The requested id.
        id: String,
        /// The ids of the effects in the scene.
        legal: Vec<String>,
        /// The id that was probably meant: that of the first effect whose kind was named, or a
        /// similar one.
        meant: Option<String>,
    },
    /// The effect has no such parameter, or a value has the wrong type, such as a text in place of
    /// a number. The paths in the diagnostics begin at the effect.
    #[error(transparent)]
    Malformed(Diagnostics),
    /// The values have the right types, but they are not legal. The paths in the diagnostics begin
    /// at the effect.
    #[error(transparent)]
    Invalid(#[from] Diagnostics),
}

impl Default for RunningScene {
    fn default() -> Self {
        Self::new()
    }
}

impl RunningScene {
    /// Creates a scene without effects, at revision 0. It corresponds to [`CompiledScene::empty`],
    /// with which the loop starts.
    #[must_use]
    pub fn new() -> Self {
        let file = SceneFile {
            name: "empty".to_owned(),
            description: String::new(),
            effects: Vec::new(),
            simulate: None,
        };
        Self { file, memories: Vec::new(), leaving: Vec::new(), revision: 0, last_epoch: 0 }
    }

    /// Replaces the running scene by `file`. Every effect starts with a new memory. Effects of the
    /// old scene that have a fade-out time fade out, if slots and numbers are free for them.
    pub fn load(&mut self, file: SceneFile) -> CompiledScene {
        let old = std::mem::take(&mut self.file.effects).into_iter().zip(std::mem::take(&mut self.memories));
        let mut numbers: usize = file.effects.iter().map(|effect| effect.numbers.len()).sum();
        self.leaving = old
            .filter(|(effect, _)| effect.common.fade_out_s > 0.0)
            .filter(|(effect, _)| {
                numbers += effect.numbers.len();
                numbers <= MAX_NUMBERS
            })
            .take(MAX_EFFECTS - file.effects.len())
            .collect();
        let mut free =
            (0..MAX_EFFECTS as u8).filter(|slot| self.leaving.iter().all(|(_, memory)| memory.slot != *slot));
        self.memories = file
            .effects
            .iter()
            .zip(&mut free)
            .map(|(_, slot)| {
                self.last_epoch = next(self.last_epoch);
                Memory { slot, epoch: self.last_epoch, reference_revision: 0 }
            })
            .collect();
        self.file = file;
        self.compile()
    }

    /// Sets some parameters of an effect. The effect keeps its other parameters and its memory.
    /// Setting `reference` or `anchor` also moves the effect's reference back to this value,
    /// because a client can have moved it since.
    ///
    /// # Errors
    /// Fails if no effect has this id, or if the parameters are not legal; the error then lists
    /// every mistake. The scene stays unchanged.
    pub fn set(&mut self, effect: &str, parameters: &Map<String, Value>) -> Result<CompiledScene, SetError> {
        let Some(index) = self.index_of(effect) else {
            let all = &self.file.effects;
            let ids = || all.iter().map(|e| e.id.as_str());
            let of_kind = all.iter().find(|e| e.kind_name() == effect).map(|e| e.id.as_str());
            let meant = of_kind.or_else(|| did_you_mean(effect, ids())).map(str::to_owned);
            let legal = ids().map(str::to_owned).collect();
            return Err(SetError::UnknownEffect { id: effect.to_owned(), legal, meant });
        };
        let changed = self.file.effects[index].with(parameters)?;
        let before = std::mem::replace(&mut self.file.effects[index], changed);
        let mut report = Report::default();
        check_numbers(&self.file.effects, "", &mut report);
        if let Err(mistakes) = report.finish(Some(())) {
            self.file.effects[index] = before;
            return Err(mistakes.into());
        }
        if parameters.keys().any(|key| key == "reference" || key == "anchor") {
            let memory = &mut self.memories[index];
            memory.reference_revision = next(memory.reference_revision);
        }
        Ok(self.compile())
    }

    /// Identifies the memory that the core's `Controller` keeps for the effect with this id.
    /// Returns `None` if no effect has this id.
    #[must_use]
    pub fn slot_of(&self, effect: &str) -> Option<EffectPlace> {
        let index = self.index_of(effect)?;
        let has_reference = self.file.effects[index].kind.reference().is_some();
        let Memory { slot, epoch, .. } = self.memories[index];
        Some(EffectPlace { slot, epoch, has_reference })
    }

    /// Returns the id of the effect whose memory is in this slot. Returns `None` if the slot is
    /// unused.
    #[must_use]
    pub fn id_at(&self, slot: u8) -> Option<&str> {
        let index = self.memories.iter().position(|memory| memory.slot == slot)?;
        Some(&self.file.effects[index].id)
    }

    /// Returns the running scene as a scene file, including all changes made by [`set`](Self::set).
    #[must_use]
    pub fn file(&self) -> &SceneFile {
        &self.file
    }

    /// Returns the revision number of the last compiled scene. 0 if no scene has been compiled.
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.revision
    }

    fn index_of(&self, effect: &str) -> Option<usize> {
        self.file.effects.iter().position(|e| e.id == effect)
    }

    fn compile(&mut self) -> CompiledScene {
        self.revision += 1;
        let staying =
            self.file.effects.iter().zip(&self.memories).map(|(effect, memory)| (effect, memory, false));
        let leaving = self.leaving.iter().map(|(effect, memory)| (effect, memory, true));
        let mut numbers = Vec::new();
        let mut effects = Vec::new();
        for (effect, memory, leaving) in staying.chain(leaving) {
            // The effects of the running scene take precedence over those that fade out: `set` can
            // need their room.
            if leaving && numbers.len() + effect.numbers.len() > MAX_NUMBERS {
                continue;
            }
            effects.push(Effect {
                slot: memory.slot,
                epoch: memory.epoch,
                reference_revision: memory.reference_revision,
                gain: effect.common.gain,
                fade_s: effect.common.fade_s,
                fade_out_s: effect.common.fade_out_s,
                leaving,
                numbers: Span { start: numbers.len() as u16, len: effect.numbers.len() as u16 },
                kind: effect.kind,
            });
            numbers.extend_from_slice(&effect.numbers);
        }
        CompiledScene::with_numbers(self.revision, &effects, &numbers)
            .unwrap_or_else(|error| unreachable!("a legal scene file fits a compiled scene: {error}"))
    }
}

/// Returns the number after `n`. The largest number is followed by 1, because 0 means none.
fn next(n: u32) -> u32 {
    n.wrapping_add(1).max(1)
}

impl SceneEffect {
    /// Returns a copy of this effect with some parameters changed. Fails if the parameters are not
    /// legal; the error lists every mistake.
    fn with(&self, parameters: &Map<String, Value>) -> Result<Self, SetError> {
        let mut report = Report::default();
        let mut all = self.settable();
        for (key, value) in parameters {
            if key == "id" || key == "kind" {
                let legal = all.keys().cloned().collect::<Vec<_>>().join(", ");
                report.push_key(key, "cannot be set while the scene runs", legal);
            } else {
                all.insert(key.clone(), value.clone());
            }
        }
        let mut all = Value::Object(all);
        let entry = KindEntry::named(self.kind_name)
            .unwrap_or_else(|| unreachable!("effects are made of listed kinds alone"));
        to_radians(&entry.schema, &mut all, "", &mut report);
        to_matrices(&entry.schema, &mut all);
        validate(&entry.schema, &mut all, "", &mut report);
        let properties = &entry.schema["properties"];
        let are_typed = parameters
            .keys()
            .all(|key| properties.get(key).is_some_and(|property| is_typed(property, &all[key])));
        let changed =
            if report.clean_under("") { Self::compile(&self.id, entry, &all, "", &mut report) } else { None };
        report.finish(changed).map_err(|mistakes| {
            if are_typed { SetError::Invalid(mistakes) } else { SetError::Malformed(mistakes) }
        })
    }
}
