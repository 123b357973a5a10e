//! The running scene: loading another one, changing parameters, and measuring the cost of effects.

use std::collections::VecDeque;
use std::sync::Arc;
use std::task::{Context, Poll};

use hbot_api::{EffectCost, ErrorBody, ErrorCode, Id, LoadSceneOk, OpName, Requester, SceneEvent, SetOk};
use hbot_config::scene::{EffectPlace, SHELF, SetError, ShelfScene, Simulate};
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::Rig;
use serde_json::{Map, Value, json};
use tokio::sync::Notify;
use tokio::task::{JoinError, JoinSet};

use super::outlook::{Outlook, Said};
use super::{SetPhenomena, cost};
use crate::recording::Notes;
use hbot_config::advice::Abilities;
use hbot_host::run_loop::bridge::ServiceEnd;
use hbot_host::run_loop::sample::Sample;

/// Largest number of scenes that are being loaded at a time.
const MAX_LOADING: usize = 4;
/// Largest length of an error message about a scene, bytes.
const MAX_MESSAGE: usize = 8192;

/// The running scene, and the scenes that are being loaded.
pub(super) struct Scenes {
    running: RunningScene,
    /// The function that gives the simulated rig the phenomena of a scene. `None` with a real rig.
    phenomena: Option<SetPhenomena>,
    /// The last scene that named phenomena, by its name, and these phenomena. The simulated rig has
    /// them until another scene names some. `None` with a real rig, and before the first such
    /// scene.
    shown: Option<(String, Simulate)>,
    /// The rig for which the computing time of effects is measured.
    rig: Rig,
    /// What the rig can make and keep stable.
    abilities: Abilities,
    /// What takes longer to say of the running scene.
    outlook: Outlook,
    /// Warnings about the running scene.
    warnings: Vec<String>,
    /// The scenes that are being loaded, in the order in which they were sent to the loop.
    loading: VecDeque<Loading>,
    measuring: JoinSet<Measured>,
    /// Passes scenes to the recorder.
    notes: Notes,
    /// Wakes the service's task when the measurement of a scene begins.
    changed: Arc<Notify>,
}

/// A scene that has been sent to the loop, and whose `load_scene` request has not been answered
/// yet.
struct Loading {
    revision: u64,
    session: u64,
    id: Option<Id>,
    by: Option<Requester>,
    name: String,
    effects: Vec<EffectCost>,
    ignored: Vec<String>,
    warnings: Vec<String>,
    measured: bool,
    /// The first tick that rendered the scene. `None` before it.
    tick: Option<u64>,
}

/// The measured computing time of each effect of a scene, ns per tick.
pub(super) struct Measured {
    revision: u64,
    costs: Vec<u64>,
}

/// A scene that has been rendered and measured, with the answer to its client and the event for all
/// clients.
pub(super) struct Loaded {
    pub(super) session: u64,
    pub(super) id: Option<Id>,
    pub(super) answer: LoadSceneOk,
    pub(super) event: SceneEvent,
}

impl Scenes {
    pub(super) fn new(
        running: RunningScene,
        phenomena: Option<SetPhenomena>,
        rig: &RigConfig,
        notes: Notes,
        changed: Arc<Notify>,
    ) -> Self {
        let abilities = Abilities::of(rig);
        let warnings = abilities.warnings(running.file());
        let outlook = Outlook::new(rig, abilities.judge.clone());
        let rig = rig.rig;
        let mut scenes = Self {
            running,
            phenomena,
            shown: None,
            rig,
            abilities,
            outlook,
            warnings,
            loading: VecDeque::new(),
            measuring: JoinSet::new(),
            notes,
            changed,
        };
        if scenes.phenomena.is_some() {
            scenes.shown = named(scenes.file());
        }
        scenes
    }

    /// Returns the scene that was loaded or changed last. The loop may not have adopted it yet.
    pub(super) fn file(&self) -> &SceneFile {
        self.running.file()
    }

    /// Returns the warnings about this scene, as in the answer to `load_scene` or `set`.
    pub(super) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns up to which stiffness the springs of this scene are stable, and its torque against
    /// angle. Asking makes it known later.
    pub(super) fn outlook(&self) -> Said {
        self.outlook.of(self.running.file(), self.running.revision())
    }

    /// Returns the name of the earlier scene whose hand moves the simulated rig. Returns `None` if
    /// the last loaded scene names the phenomena itself, or if no scene has named a hand.
    pub(super) fn earlier_hand(&self) -> Option<&str> {
        let (name, simulate) = self.kept(self.file())?;
        simulate.hand.map(|_| name.as_str())
    }

    /// Returns the earlier scene whose phenomena the simulated rig keeps while it runs `file`, by
    /// its name, and these phenomena. Returns `None` if `file` names phenomena itself.
    fn kept(&self, file: &SceneFile) -> Option<&(String, Simulate)> {
        self.shown.as_ref().filter(|_| file.simulate().is_none())
    }

    /// Returns the id of the effect in a slot of the scene.
    pub(super) fn id_at(&self, slot: u8) -> Option<&str> {
        self.running.id_at(slot)
    }

    /// Returns the place of the effect `id` among the effects of the scene. The effect must have a
    /// reference.
    ///
    /// # Errors
    /// Fails if the scene has no such effect, or if the effect has no reference.
    #[inline(never)]
    pub(super) fn reference(&self, id: &str) -> Result<EffectPlace, ErrorBody> {
        let place = self.running.slot_of(id);
        if let Some(place) = place.filter(|place| place.has_reference) {
            return Ok(place);
        }
        let ids = self.file().effects().iter().map(|effect| effect.id());
        let legal: Vec<&str> =
            ids.filter(|id| self.running.slot_of(id).is_some_and(|place| place.has_reference)).collect();
        let what = if place.is_some() { "has no reference" } else { "is not in the scene" };
        let legal = if legal.is_empty() { "none, no effect has one".to_owned() } else { legal.join(", ") };
        Err(ErrorBody::new(ErrorCode::UnknownEffect, format!("effect {id:?} {what}; legal: {legal}")))
    }

    /// Sends a new scene to the loop for a client, and starts to measure its effects on another
    /// thread. When the scene has been rendered and measured, [`next_loaded`](Self::next_loaded)
    /// returns the answer.
    ///
    /// # Errors
    /// Fails if the scene is not legal, or if too many scenes are being loaded.
    // Not inlined: a scene takes about 20 KB of stack, several times over. The same is true of
    // `set`.
    #[inline(never)]
    pub(super) fn load(
        &mut self,
        end: &mut ServiceEnd,
        session: u64,
        id: Option<Id>,
        scene: Value,
        by: Option<Requester>,
    ) -> Result<(), ErrorBody> {
        if self.loading.len() >= MAX_LOADING || !end.can_install() {
            return Err(busy(OpName::LoadScene));
        }
        let file = read(scene)?;
        let ignored = match (file.simulate(), &mut self.phenomena) {
            (None, _) => Vec::new(),
            (Some(simulate), None) => names(&json!(simulate)),
            (Some(simulate), Some(set)) => {
                set(simulate);
                self.shown = named(&file);
                Vec::new()
            }
        };
        let mut warnings = self.abilities.warnings(&file);
        warnings.extend(self.kept(&file).map(|(name, simulate)| keeps(name, simulate)));
        let compiled = self.running.load(file);
        let (rig, parts) = (self.rig, compiled.clone());
        self.notes.scene(&compiled, self.running.file());
        end.install(Box::new(compiled)).map_err(|_| busy(OpName::LoadScene))?;
        self.warnings.clone_from(&warnings);

        let (file, revision) = (self.running.file(), self.running.revision());
        let effects = file.effects().iter().map(|effect| EffectCost {
            id: effect.id().to_owned(),
            kind: effect.kind_name().to_owned(),
            cost_ns: 0,
        });
        let (name, effects) = (file.name().to_owned(), effects.collect());
        tracing::info!(session, name, "scene loaded");
        self.loading.push_back(Loading {
            revision,
            session,
            id,
            by,
            name,
            effects,
            ignored,
            warnings,
            measured: false,
            tick: None,
        });
        self.measuring.spawn_blocking(move || Measured { revision, costs: cost::measure(&rig, &parts) });
        self.changed.notify_one();
        Ok(())
    }

    /// Changes parameters of an effect in the running scene. Returns warnings about the changed
    /// scene, as in the answer to `load_scene`.
    ///
    /// # Errors
    /// Fails if the effect or a parameter does not exist, if a value is not legal, or if the loop
    /// has not yet taken the scenes given to it before.
    #[inline(never)]
    pub(super) fn set(
        &mut self,
        end: &mut ServiceEnd,
        effect: &str,
        parameters: &Map<String, Value>,
    ) -> Result<SetOk, ErrorBody> {
        if !end.can_install() {
            return Err(busy(OpName::Set));
        }
        let compiled = self.running.set(effect, parameters).map_err(|error| {
            let code = match &error {
                SetError::UnknownEffect { .. } => ErrorCode::UnknownEffect,
                SetError::Malformed(_) => ErrorCode::BadRequest,
                SetError::Invalid(_) => ErrorCode::OutOfRange,
            };
            ErrorBody::new(code, shortened(set_refusal(effect, &error)))
        })?;
        self.notes.scene(&compiled, self.running.file());
        end.install(Box::new(compiled)).map_err(|_| busy(OpName::Set))?;
        self.warnings = self.abilities.warnings(self.running.file());
        Ok(SetOk { warnings: self.warnings.clone() })
    }

    /// Returns whether a scene is being loaded.
    pub(super) fn is_loading(&self) -> bool {
        !self.loading.is_empty()
    }

    /// Records which of the scenes that are being loaded have been rendered, according to a sample.
    pub(super) fn rendered(&mut self, sample: &Sample) {
        for loading in &mut self.loading {
            if loading.tick.is_none() && sample.scene >= loading.revision {
                loading.tick = Some(sample.state.tick);
            }
        }
    }

    /// Polls for the next scene whose effects have been timed. Stays pending while no measurement
    /// is running.
    pub(super) fn poll_measured(&mut self, context: &mut Context<'_>) -> Poll<Result<Measured, JoinError>> {
        match self.measuring.poll_join_next(context) {
            Poll::Ready(Some(measured)) => Poll::Ready(measured),
            Poll::Ready(None) | Poll::Pending => Poll::Pending,
        }
    }

    /// Records the measured computing time of a scene's effects. If the measurement failed, the
    /// reported time is zero.
    pub(super) fn measured(&mut self, measured: Result<Measured, JoinError>) {
        match measured {
            Ok(Measured { revision, costs }) => {
                if let Some(loading) = self.loading.iter_mut().find(|loading| loading.revision == revision) {
                    loading.measured = true;
                    for (effect, cost) in loading.effects.iter_mut().zip(costs) {
                        effect.cost_ns = cost;
                    }
                }
            }
            Err(error) => {
                tracing::error!(%error, "effects could not be measured");
                if let Some(loading) = self.loading.iter_mut().find(|loading| !loading.measured) {
                    loading.measured = true;
                }
            }
        }
    }

    /// Removes and returns the oldest scene that is being loaded, if it has been rendered and
    /// measured.
    pub(super) fn next_loaded(&mut self) -> Option<Loaded> {
        let front = self.loading.front()?;
        let tick = front.tick.filter(|_| front.measured)?;
        let Loading { session, id, by, name, effects, ignored, warnings, .. } = self.loading.pop_front()?;
        let answer = LoadSceneOk { effects: effects.clone(), ignored, warnings };
        Some(Loaded { session, id, answer, event: SceneEvent { tick, name, effects, by } })
    }
}

fn busy(op: OpName) -> ErrorBody {
    ErrorBody::new(
        ErrorCode::Busy,
        format!("op {op}: the loop has not yet taken the scenes it was given before"),
    )
}

/// Returns the error message for a `set` that is refused. It names the effect in every line.
#[must_use]
pub fn set_refusal(effect: &str, error: &SetError) -> String {
    match error {
        SetError::UnknownEffect { .. } => error.to_string(),
        SetError::Malformed(mistakes) | SetError::Invalid(mistakes) => {
            let lines = mistakes.iter().map(|mistake| format!("effect {effect:?}: {mistake}"));
            lines.collect::<Vec<_>>().join("\n")
        }
    }
}

/// Returns the name of a scene and the phenomena that it names. Returns `None` if it has no table
/// `[simulate]`.
fn named(file: &SceneFile) -> Option<(String, Simulate)> {
    file.simulate().map(|simulate| (file.name().to_owned(), *simulate))
}

/// Returns the warning about a scene that names no phenomena, while the simulated rig has those of
/// the earlier scene `name`.
fn keeps(name: &str, simulate: &Simulate) -> String {
    let all = names(&json!(simulate));
    let all = if all.is_empty() { "no hand and no other phenomenon".to_owned() } else { all.join(", ") };
    format!(
        "simulate: this scene has no such table, so the simulated rig keeps that of the scene {name:?}: {all}. \
         A table with `hand = {{}}` alone gives back the default hand on an ideal rig, which holds the sphere where it is then"
    )
}

/// Reads a scene that a client has sent: a map with the structure of a scene file, or the name of a
/// ready-made scene.
fn read(scene: Value) -> Result<SceneFile, ErrorBody> {
    let bad = |message: String| ErrorBody::new(ErrorCode::BadRequest, shortened(message));
    let Value::String(name) = scene else {
        return SceneFile::from_json(scene).map_err(|mistakes| bad(mistakes.to_string()));
    };
    let found = ShelfScene::named(&name).map(ShelfScene::scene);
    found.ok_or_else(|| {
        let hint =
            ShelfScene::similar(&name).map(|name| format!("; did you mean {name:?}?")).unwrap_or_default();
        let legal: Vec<&str> = SHELF.iter().map(|scene| scene.file).collect();
        bad(format!("there is no ready-made scene {name:?}{hint}; legal: {}", legal.join(", ")))
    })
}

fn names(table: &Value) -> Vec<String> {
    table.as_object().into_iter().flatten().map(|(name, _)| name.clone()).collect()
}

/// Shortens an error message to [`MAX_MESSAGE`] bytes, and marks that it was shortened.
fn shortened(mut message: String) -> String {
    if message.len() > MAX_MESSAGE {
        message.truncate(message.floor_char_boundary(MAX_MESSAGE));
        message.push_str("\n... and more");
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_host::run_loop::bridge::bridge;

    #[tokio::test]
    async fn a_scene_is_answered_once_it_is_rendered_and_measured() {
        let (_loop_end, mut end) = bridge().unwrap();
        let mut running = RunningScene::new();
        let _ = running.load(SceneFile::default_scene());
        let mut scenes =
            Scenes::new(running, None, &RigConfig::prototype(), Notes::default(), Arc::default());
        let scene = json!({"name": "Air", "effect": [{"id": "air", "kind": "damper", "damping": 0.1}]});
        let ann = Some(Requester { name: "ann".to_owned(), session: Some(3) });
        scenes.load(&mut end, 3, None, scene.clone(), ann.clone()).unwrap();
        let first = scenes.running.revision();
        scenes.load(&mut end, 4, None, scene, None).unwrap();
        let second = scenes.running.revision();
        let measured = |revision, cost| Ok(Measured { revision, costs: vec![cost] });
        scenes.rendered(&Sample { scene: first - 1, ..crate::still::still(6) });
        scenes.measured(measured(first, 42));
        assert!(scenes.next_loaded().is_none(), "measured and not rendered");
        scenes.rendered(&Sample { scene: first, ..crate::still::still(7) });
        scenes.rendered(&Sample { scene: second, ..crate::still::still(8) });
        let loaded = scenes.next_loaded().expect("both");
        assert_eq!((loaded.session, loaded.event.tick, loaded.answer.effects[0].cost_ns), (3, 7, 42));
        assert_eq!(loaded.event.by, ann);
        assert!(scenes.next_loaded().is_none() && scenes.is_loading(), "rendered and not measured");
        scenes.measured(measured(second, 43));
        let loaded = scenes.next_loaded().expect("both");
        assert_eq!((loaded.session, loaded.event.tick, loaded.answer.effects[0].cost_ns), (4, 8, 43));
        assert!(!scenes.is_loading());
    }
}
