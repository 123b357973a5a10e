//! Loading and changing the scene.

use hbot_api::{EffectCost, ErrorBody, ErrorCode, Event, Id, LoadSceneOk, SceneEvent};
use hbot_config::SceneFile;
use hbot_config::scene::SetError;
use serde_json::{Map, Value, json};
use tokio::task::JoinError;

use super::cost;
use super::hub::Hub;
use hbot_host::sample::Sample;

/// Scenes that may be on their way at a time.
const MAX_LOADING: usize = 4;
/// The longest message of an error, bytes.
const MAX_MESSAGE: usize = 8192;

/// A scene that has been handed to the loop and not been answered.
pub(super) struct Loading {
    revision: u64,
    session: u64,
    id: Option<Id>,
    name: String,
    effects: Vec<EffectCost>,
    ignored: Vec<String>,
    measured: bool,
    /// The first tick that rendered it.
    tick: Option<u64>,
}

/// What the effects of a scene cost, ns.
pub(super) struct Measured {
    revision: u64,
    costs: Vec<u64>,
}

impl Hub {
    /// Renders another scene; answered once the loop has it and its effects are measured.
    // A scene takes some 20 KB of stack, several times over; so it does in `set`.
    #[inline(never)]
    pub(super) fn load_scene(&mut self, session: u64, id: Option<Id>, scene: Value) -> Result<(), ErrorBody> {
        if self.loading.len() >= MAX_LOADING || !self.end.can_install() {
            return Err(busy("load_scene"));
        }
        let file = SceneFile::from_json(scene)
            .map_err(|mistakes| ErrorBody::new(ErrorCode::BadRequest, shortened(mistakes.to_string())))?;
        let ignored = match (file.simulate(), &mut self.setup.phenomena) {
            (None, _) => Vec::new(),
            (Some(simulate), None) => names(&json!(simulate)),
            (Some(simulate), Some(set)) => {
                set(simulate);
                Vec::new()
            }
        };
        let compiled = self.setup.scene.load(file);
        let (rig, parts) = (self.setup.rig.rig, compiled.clone());
        self.end.install(Box::new(compiled)).map_err(|_| busy("load_scene"))?;

        let (file, revision) = (self.setup.scene.file(), self.setup.scene.revision());
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
            name,
            effects,
            ignored,
            measured: false,
            tick: None,
        });
        self.measuring.spawn_blocking(move || Measured { revision, costs: cost::measure(&rig, &parts) });
        self.changed.notify_one();
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.owed += 1;
        }
        self.tell_status();
        Ok(())
    }

    /// Changes parameters of an effect.
    #[inline(never)]
    pub(super) fn set(&mut self, effect: &str, parameters: &Map<String, Value>) -> Result<(), ErrorBody> {
        if !self.end.can_install() {
            return Err(busy("set"));
        }
        let compiled = self.setup.scene.set(effect, parameters).map_err(|error| {
            let code = match &error {
                SetError::UnknownEffect { .. } => ErrorCode::UnknownEffect,
                SetError::Invalid(_) if self.knows(effect, parameters) => ErrorCode::OutOfRange,
                SetError::Invalid(_) => ErrorCode::BadRequest,
            };
            ErrorBody::new(code, shortened(error.to_string()))
        })?;
        self.end.install(Box::new(compiled)).map_err(|_| busy("set"))
    }

    /// Whether an effect has parameters of these names.
    fn knows(&self, effect: &str, parameters: &Map<String, Value>) -> bool {
        let effects = self.setup.scene.file().effects();
        let Some(effect) = effects.iter().find(|e| e.id() == effect) else { return false };
        let kinds = hbot_config::scene::kinds();
        kinds
            .iter()
            .find(|kind| kind.name == effect.kind_name())
            .is_some_and(|kind| parameters.keys().all(|name| kind.schema["properties"].get(name).is_some()))
    }

    /// Notes which scene a sample was rendered with.
    pub(super) fn rendered(&mut self, sample: &Sample) {
        for loading in &mut self.loading {
            if loading.tick.is_none() && sample.scene >= loading.revision {
                loading.tick = Some(sample.state.tick);
            }
        }
        self.loaded();
    }

    /// Notes what effects cost. Where the measurement has failed they are said to cost nothing.
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
        self.loaded();
    }

    /// Answers the loads that are complete, in their order.
    fn loaded(&mut self) {
        while let Some((tick, Loading { session, id, name, effects, ignored, .. })) = self.next_loaded() {
            self.paid_after(session, |hub| {
                hub.answer_with(session, id, LoadSceneOk { effects: effects.clone(), ignored });
                hub.broadcast(&Event::Scene(SceneEvent { tick, name, effects }));
            });
        }
    }

    fn next_loaded(&mut self) -> Option<(u64, Loading)> {
        let front = self.loading.front()?;
        let tick = front.tick.filter(|_| front.measured)?;
        self.loading.pop_front().map(|loading| (tick, loading))
    }
}

fn busy(op: &str) -> ErrorBody {
    ErrorBody::new(
        ErrorCode::Busy,
        format!("op {op}: the loop has not yet taken the scenes it was given before"),
    )
}

fn names(table: &Value) -> Vec<String> {
    table.as_object().into_iter().flatten().map(|(name, _)| name.clone()).collect()
}

/// A message of bounded length.
fn shortened(mut message: String) -> String {
    if message.len() > MAX_MESSAGE {
        message.truncate(message.floor_char_boundary(MAX_MESSAGE));
        message.push_str("\n... and more");
    }
    message
}
