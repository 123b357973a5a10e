//! The running scene: loading another one, changing parameters, and examining what was loaded.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::task::{Context, Poll};

use hbot_api::{
    EffectCost, ErrorBody, ErrorCode, Event, Id, LoadSceneOk, OpName, Requester, SceneEvent, SetEvent, SetOk,
};
use hbot_config::scene::{EffectPlace, SHELF, SceneEffect, SetError, ShelfScene, Simulate};
use hbot_config::{RigConfig, RunningScene, SceneFile, guess};
use hbot_core::{CompiledScene, Rig};
use serde_json::{Map, Value, json};
use tokio::sync::Notify;
use tokio::task::{JoinError, JoinSet};

use super::outlook::{Outlook, Said};
use super::{SetPhenomena, convert, cost};
use crate::recording::Notes;
use hbot_config::advice::{Abilities, Warning};
use hbot_host::run_loop::bridge::ServiceEnd;
use hbot_host::run_loop::sample::Sample;

/// Largest number of scenes and changes that the loop has not rendered yet, and of those that wait
/// for their examination too.
const MAX_WAITING: usize = 4;
const MAX_UNEXAMINED: usize = 64;
/// Largest length of an error message about a scene, bytes.
const MAX_MESSAGE: usize = 8192;

/// The running scene, and the changes that the loop does not render yet.
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
    abilities: Arc<Abilities>,
    /// What takes longer to say of the running scene.
    outlook: Outlook,
    /// Warnings about the running scene.
    warnings: Vec<Warning>,
    /// The changes whose requests have not been answered yet, in the order in which they were sent
    /// to the loop.
    waiting: VecDeque<Waiting>,
    examining: JoinSet<Examined>,
    /// Passes scenes to the recorder.
    notes: Notes,
    /// Wakes the service's task when the examination of a scene begins.
    changed: Arc<Notify>,
}

/// A scene that has been sent to the loop, and whose `load_scene` or `set` request has not been
/// answered yet.
struct Waiting {
    revision: u64,
    session: u64,
    id: Option<Id>,
    by: Option<Requester>,
    /// Whether the warnings are known, and the costs of the effects of another scene.
    examined: bool,
    warnings: Vec<Warning>,
    change: Change,
    /// The first tick that rendered the scene. `None` before it.
    tick: Option<u64>,
}

/// What a client has changed.
enum Change {
    /// Another scene: `load_scene`.
    Scene { name: String, effects: Vec<EffectCost>, ignored: Vec<String> },
    /// Parameters of an effect: `set`.
    Parameters { effect: String, parameters: Map<String, Value> },
}

/// What is found out about a scene or a change after it was given to the loop.
pub(super) struct Examined {
    revision: u64,
    /// The measured computing time of each effect of another scene, ns per tick.
    costs: Vec<u64>,
    warnings: Vec<Warning>,
}

/// A change that is rendered and examined, with the answer to its client and the event for all
/// clients.
pub(super) struct Changed {
    pub(super) session: u64,
    pub(super) id: Option<Id>,
    pub(super) answer: Value,
    pub(super) event: Event,
}

impl Scenes {
    pub(super) fn new(
        running: RunningScene,
        phenomena: Option<SetPhenomena>,
        rig: &RigConfig,
        notes: Notes,
        changed: Arc<Notify>,
    ) -> Self {
        let abilities = Arc::new(Abilities::of(rig));
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
            waiting: VecDeque::new(),
            examining: JoinSet::new(),
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

    /// Returns the warnings about this scene, as in the answer to `load_scene` or `set`. Before
    /// this answer there are none.
    pub(super) fn warnings(&self) -> &[Warning] {
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

    /// Sends a new scene to the loop for a client, and starts to examine it on another thread. When
    /// the scene has been rendered and examined, [`next_changed`](Self::next_changed) returns the
    /// answer.
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
        self.admit(end, OpName::LoadScene)?;
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
        let compiled = self.running.load(file);
        let parts = compiled.clone();
        self.notes.scene(&compiled, self.running.file());
        end.install(Box::new(compiled)).map_err(|_| busy(OpName::LoadScene))?;
        self.warnings.clear();

        let file = self.running.file();
        let effects = file.effects().iter().map(|effect| EffectCost {
            id: effect.id().to_owned(),
            kind: effect.kind_name().to_owned(),
            cost_ns: 0,
        });
        let (name, effects) = (file.name().to_owned(), effects.collect());
        tracing::info!(session, name, "scene loaded");
        let change = Change::Scene { name, effects, ignored };
        self.examine(session, id, by, change, Some(parts));
        Ok(())
    }

    /// Examines the running scene on another thread, because that can take longer than a stop may
    /// wait. `parts` is another scene, whose effects' computing time is measured too.
    #[inline(never)]
    fn examine(
        &mut self,
        session: u64,
        id: Option<Id>,
        by: Option<Requester>,
        change: Change,
        parts: Option<CompiledScene>,
    ) {
        let (file, revision, rig) = (self.running.file().clone(), self.running.revision(), self.rig);
        let kept = self.kept(&file).and_then(|(name, simulate)| keeps(name, simulate));
        let abilities = Arc::clone(&self.abilities);
        let (examined, warnings, tick) = (false, Vec::new(), None);
        self.waiting.push_back(Waiting { revision, session, id, by, examined, warnings, change, tick });
        self.examining.spawn_blocking(move || {
            let found = catch_unwind(AssertUnwindSafe(|| {
                let mut warnings = abilities.warnings(&file);
                warnings.extend(kept);
                (parts.map(|parts| cost::measure(&rig, &parts)).unwrap_or_default(), warnings)
            }));
            let (costs, warnings) = found.unwrap_or_default();
            Examined { revision, costs, warnings }
        });
        self.changed.notify_one();
    }

    /// Changes parameters of an effect in the running scene for a client, and starts to examine it
    /// on another thread. When the change has been rendered and examined,
    /// [`next_changed`](Self::next_changed) returns the answer.
    ///
    /// # Errors
    /// Fails if the effect or a parameter does not exist, if a value is not legal, or if the loop
    /// has not yet taken the scenes given to it before.
    #[inline(never)]
    pub(super) fn set(
        &mut self,
        end: &mut ServiceEnd,
        session: u64,
        id: Option<Id>,
        (effect, mut parameters): (String, Map<String, Value>),
        by: Option<Requester>,
    ) -> Result<(), ErrorBody> {
        self.admit(end, OpName::Set)?;
        let compiled = self.running.set(&effect, &parameters).map_err(|error| {
            let code = match &error {
                SetError::UnknownEffect { .. } => ErrorCode::UnknownEffect,
                SetError::Malformed(_) => ErrorCode::BadRequest,
                SetError::Invalid(_) => ErrorCode::OutOfRange,
            };
            ErrorBody::new(code, shortened(set_refusal(&effect, &error)))
        })?;
        self.notes.scene(&compiled, self.running.file());
        end.install(Box::new(compiled)).map_err(|_| busy(OpName::Set))?;
        self.warnings.clear();
        let changed = self.file().effects().iter().find(|e| e.id() == effect).map(SceneEffect::to_json);
        for (name, value) in &mut parameters {
            if let Some(new) = changed.as_ref().and_then(|changed| changed.get(name)) {
                value.clone_from(new);
            }
        }
        self.examine(session, id, by, Change::Parameters { effect, parameters }, None);
        Ok(())
    }

    /// Checks that the loop can take another scene.
    fn admit(&self, end: &mut ServiceEnd, op: OpName) -> Result<(), ErrorBody> {
        let unrendered = self.waiting.iter().filter(|waiting| waiting.tick.is_none()).count();
        let admits = unrendered < MAX_WAITING && self.waiting.len() < MAX_UNEXAMINED;
        if admits && end.can_install() { Ok(()) } else { Err(busy(op)) }
    }

    /// Returns whether a change has not been answered yet.
    pub(super) fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Records which of the changes have been rendered, according to a sample.
    pub(super) fn rendered(&mut self, sample: &Sample) {
        for waiting in &mut self.waiting {
            if waiting.tick.is_none() && sample.scene >= waiting.revision {
                waiting.tick = Some(sample.state.tick);
            }
        }
    }

    /// Polls for the next scene that has been examined. Stays pending while none is.
    pub(super) fn poll_examined(&mut self, context: &mut Context<'_>) -> Poll<Result<Examined, JoinError>> {
        match self.examining.poll_join_next(context) {
            Poll::Ready(Some(examined)) => Poll::Ready(examined),
            Poll::Ready(None) | Poll::Pending => Poll::Pending,
        }
    }

    /// Records what was found out about a scene. If the examination has panicked, the reported
    /// times are zero and there are no warnings.
    pub(super) fn examined(&mut self, result: Result<Examined, JoinError>) {
        // A task that is aborted belongs to a service that ends.
        let Ok(Examined { revision, costs, warnings }) = result else { return };
        let Some(waiting) = self.waiting.iter_mut().find(|waiting| waiting.revision == revision) else {
            return;
        };
        if let Change::Scene { effects, .. } = &mut waiting.change {
            effects.iter_mut().zip(costs).for_each(|(effect, cost)| effect.cost_ns = cost);
        }
        if revision == self.running.revision() {
            self.warnings.clone_from(&warnings);
        }
        (waiting.examined, waiting.warnings) = (true, warnings);
    }

    /// Removes and returns the oldest change, if it has been rendered and examined.
    pub(super) fn next_changed(&mut self) -> Option<Changed> {
        let tick = self.waiting.front().filter(|front| front.examined)?.tick?;
        let Waiting { session, id, by, warnings, change, .. } = self.waiting.pop_front()?;
        let (answer, event) = match change {
            Change::Scene { name, effects, ignored, .. } => (
                json!(LoadSceneOk {
                    effects: effects.clone(),
                    ignored,
                    warnings: convert::sentences(&warnings)
                }),
                Event::Scene(SceneEvent { tick, name, effects, by }),
            ),
            Change::Parameters { effect, parameters } => (
                json!(SetOk { warnings: convert::sentences(&warnings) }),
                Event::Set(SetEvent {
                    tick,
                    effect,
                    parameters,
                    warnings: convert::sentences(&warnings),
                    advice: warnings.iter().map(Into::into).collect(),
                    by,
                }),
            ),
        };
        Some(Changed { session, id, answer, event })
    }
}

fn busy(op: OpName) -> ErrorBody {
    ErrorBody::new(
        ErrorCode::Busy,
        format!("op {op}: the scenes given before are not yet rendered and examined"),
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
/// the earlier scene `name`. A hand alone is no reason for one: without it, nothing would be felt.
fn keeps(name: &str, simulate: &Simulate) -> Option<Warning> {
    let all = names(&json!(simulate));
    if all == ["hand"] {
        return None;
    }
    let all = if all.is_empty() { "no hand and no other phenomenon".to_owned() } else { all.join(", ") };
    Some(Warning::plain(format!(
        "simulate: this scene has no such table, so the simulated rig keeps that of the scene {name:?}: {all}. \
         A table with `hand = {{}}` alone (`hbot scene load NAME --ideal`) gives back the default hand on an ideal rig, which \
         holds the sphere where it is then"
    )))
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
        let hint = guess(ShelfScene::similar(&name));
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
    use hbot_api::EventName;
    use hbot_host::run_loop::bridge::{LoopEnd, bridge};

    /// Returns the default scene of a real rig, with both ends of the bridge to its loop.
    fn scenes() -> (LoopEnd, ServiceEnd, Scenes) {
        let (loop_end, end) = bridge().unwrap();
        let mut running = RunningScene::new();
        let _ = running.load(SceneFile::default_scene());
        let rig = RigConfig::prototype();
        (loop_end, end, Scenes::new(running, None, &rig, Notes::default(), Arc::default()))
    }

    #[tokio::test]
    async fn a_scene_is_answered_once_it_is_rendered_and_examined() {
        let (_loop_end, mut end, mut scenes) = scenes();
        let scene = json!({"name": "Air", "effect": [{"id": "air", "kind": "damper", "damping": 0.1}]});
        let ann = Some(Requester { name: "ann".to_owned(), session: Some(3) });
        scenes.load(&mut end, 3, None, scene, ann.clone()).unwrap();
        let first = scenes.running.revision();
        let damping = Map::from_iter([("damping".to_owned(), json!(0.2))]);
        scenes.set(&mut end, 4, None, ("air".to_owned(), damping.clone()), ann.clone()).unwrap();
        let second = scenes.running.revision();
        scenes.rendered(&Sample { scene: first - 1, ..crate::still::still(6) });
        let shakes = || vec![Warning::plain("it shakes".to_owned())];
        scenes.examined(Ok(Examined { revision: first, costs: vec![42], warnings: shakes() }));
        assert!(scenes.next_changed().is_none(), "examined and not rendered");
        assert!(scenes.warnings().is_empty(), "those of the change, which is not examined");
        scenes.rendered(&Sample { scene: first, ..crate::still::still(7) });
        let loaded = scenes.next_changed().expect("both");
        assert_eq!((loaded.session, &loaded.answer["effects"][0]["cost_ns"]), (3, &json!(42)));
        assert_eq!(loaded.answer["warnings"], json!(["it shakes"]));
        let Event::Scene(event) = loaded.event else { panic!("a scene") };
        assert_eq!((event.tick, event.by), (7, ann.clone()));
        assert!(scenes.next_changed().is_none(), "the loop has the scene and not its change");
        scenes.rendered(&Sample { scene: second, ..crate::still::still(8) });
        assert!(scenes.next_changed().is_none(), "the change is not examined");
        scenes.examined(Ok(Examined { revision: second, costs: Vec::new(), warnings: shakes() }));
        assert_eq!(scenes.warnings(), shakes());
        let set = scenes.next_changed().expect("both");
        assert_eq!((set.session, &set.answer), (4, &json!({"warnings": ["it shakes"]})));
        let (tick, effect) = (8, "air".to_owned());
        let (warnings, advice) = (vec!["it shakes".to_owned()], shakes().iter().map(Into::into).collect());
        let event = SetEvent { tick, effect, parameters: damping, warnings, advice, by: ann };
        assert_eq!(set.event, Event::Set(event));
        assert!(!scenes.is_waiting());
    }

    #[tokio::test]
    async fn a_change_waits_for_the_scene_before_it_that_is_not_examined() {
        let (_loop_end, mut end, mut scenes) = scenes();
        let spring = json!({"id": "s", "kind": "spring", "stiffness": 300, "damping": 0});
        scenes.load(&mut end, 3, None, json!({"effect": [spring]}), None).unwrap();
        assert!(scenes.warnings().is_empty(), "another thread looks for them");
        let first = scenes.running.revision();
        let id = scenes.file().effects()[0].id().to_owned();
        scenes.set(&mut end, 3, None, (id, Map::from_iter([("gain".to_owned(), json!(0.5))])), None).unwrap();
        scenes.rendered(&Sample { scene: scenes.running.revision(), ..crate::still::still(7) });
        assert!(scenes.next_changed().is_none(), "the event of the scene comes before that of its change");
        let examined = |revision| Ok(Examined { revision, costs: Vec::new(), warnings: Vec::new() });
        scenes.examined(examined(scenes.running.revision()));
        assert!(scenes.next_changed().is_none(), "only the change is examined");
        scenes.examined(examined(first));
        let events =
            [scenes.next_changed(), scenes.next_changed()].map(|change| change.unwrap().event.name());
        assert_eq!(events, [EventName::Scene, EventName::Set].map(Some));
    }
}
