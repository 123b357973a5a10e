//! The running scene, and the changes to it that the server has not answered yet.

use std::collections::BTreeMap;

use hbot_api::{EffectCost, InfoOk};
use hbot_config::SceneFile;
use hbot_config::scene::SceneEffect;
use hbot_core::render::effects::Anchor;
use serde_json::{Map, Value};

/// Identifies a parameter of an effect: the effect's id and the parameter's name.
type Place = (String, String);

/// The running scene, with changes that the user has made and the server has not confirmed yet.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scene {
    name: String,
    /// The sentence that says what the scene feels like. Empty if the scene has none.
    description: String,
    effects: Vec<Effect>,
    /// The scene's table of phenomena of the simulated rig, if it has one.
    simulate: Option<Value>,
    /// The scene as the server last reported it. Null if it has changed since.
    told: Value,
    /// The scene with the laws of its effects, if the panel knows all its kinds.
    file: Option<SceneFile>,
    /// Parameter values that were sent to the server and not answered yet. The window shows them
    /// instead of the values in use.
    pending: BTreeMap<Place, Value>,
    /// Computing time of each effect of the scene that was loaded last. The server reports it when
    /// the scene is loaded, and `info` contains the scene only later.
    costs: Vec<EffectCost>,
}

/// One effect of the running scene, such as a spring.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Effect {
    pub(crate) id: String,
    pub(crate) kind: String,
    /// All parameters of the effect that the op `set` can change.
    pub(crate) parameters: Map<String, Value>,
}

impl Scene {
    /// Replaces the scene by the one in an answer to the op `info`. Returns whether the effects of
    /// the scene are others than the panel knew.
    pub(crate) fn take(&mut self, told: &Value) -> bool {
        if *told == self.told {
            return false;
        }
        self.name = told["name"].as_str().unwrap_or("unnamed").to_owned();
        self.description = told["description"].as_str().unwrap_or_default().to_owned();
        let effects: Vec<_> = told["effect"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(|effect| Effect::read(effect.as_object()?))
            .collect();
        let changed = effects != self.effects;
        self.effects = effects;
        self.simulate = told.get("simulate").cloned();
        self.file = SceneFile::from_json(told.clone()).ok();
        self.told = told.clone();
        let ids = &self.effects;
        self.pending.retain(|(id, _), _| ids.iter().any(|effect| effect.id == *id));
        changed
    }

    /// Records the computing time of the effects of a scene that was just loaded.
    pub(crate) fn take_costs(&mut self, costs: Vec<EffectCost>) {
        self.costs = costs;
    }

    /// Returns the computing time of an effect in each tick, ns, or `None` if the server has not
    /// reported it.
    pub(crate) fn cost_ns(&self, effect: &Effect) -> Option<u64> {
        self.costs.iter().find(|c| c.id == effect.id && c.kind == effect.kind).map(|c| c.cost_ns)
    }

    /// Returns whether a server has told the scene since this panel began.
    pub(crate) fn is_known(&self) -> bool {
        !self.name.is_empty()
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn description(&self) -> &str {
        &self.description
    }

    pub(crate) fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// Returns the effects with their laws, as the server computes them. Empty if the server is
    /// newer than the panel and runs a kind that the panel does not know.
    pub(crate) fn laws(&self) -> &[SceneEffect] {
        self.file.as_ref().map_or(&[], SceneFile::effects)
    }

    /// Returns the first effect with a reference, and the anchor of this reference. `None` if there
    /// is no such effect, or if the panel does not know the laws of the scene.
    pub(crate) fn first_reference(&self) -> Option<(&SceneEffect, Anchor)> {
        self.laws().iter().find_map(|effect| {
            let (_, anchor) = effect.kind().reference()?;
            Some((effect, anchor))
        })
    }

    /// Returns the longest time in which an effect of the scene fades in or out, s.
    pub(crate) fn fading_s(&self) -> f64 {
        self.laws().iter().map(|effect| effect.fade_s().max(effect.fade_out_s())).fold(0.0, f64::max)
    }

    /// Returns the value of a parameter: the one that was last requested, if it is not answered
    /// yet, otherwise the one in use.
    pub(crate) fn value<'a>(&'a self, effect: &'a Effect, key: &str) -> Option<&'a Value> {
        self.pending.get(&(effect.id.clone(), key.to_owned())).or_else(|| effect.parameters.get(key))
    }

    /// Records a parameter value that was sent to the server.
    pub(crate) fn ask(&mut self, effect: &str, key: &str, value: &Value) {
        self.pending.insert((effect.to_owned(), key.to_owned()), value.clone());
    }

    /// Records the server's answer to a parameter value. If `taken` is true, the server now uses
    /// the value.
    pub(crate) fn answered(&mut self, effect: &str, key: &str, value: &Value, taken: bool) {
        let place = (effect.to_owned(), key.to_owned());
        // Keep a newer value that is still waiting for its answer.
        if self.pending.get(&place) == Some(value) {
            self.pending.remove(&place);
        }
        if taken {
            self.set(effect, key, value);
        }
    }

    /// Records a parameter value that the server now uses.
    pub(crate) fn set(&mut self, effect: &str, key: &str, value: &Value) {
        let Some(effect) = self.effects.iter_mut().find(|e| e.id == effect) else { return };
        effect.parameters.insert(key.to_owned(), value.clone());
        self.file = SceneFile::from_json(self.to_json()).ok();
        // Makes the panel apply the next answer to `info` in any case.
        self.told = Value::Null;
    }

    /// Discards the parameter values that were not answered. Called after the connection was lost.
    pub(crate) fn forget_pending(&mut self) {
        self.pending.clear();
    }

    /// Returns the scene as JSON with the structure of a scene file.
    pub(crate) fn to_json(&self) -> Value {
        let mut effects = Vec::new();
        for effect in &self.effects {
            let mut table = Map::new();
            table.insert("id".to_owned(), effect.id.clone().into());
            table.insert("kind".to_owned(), effect.kind.clone().into());
            table.extend(
                effect.parameters.iter().filter(|(_, v)| !v.is_null()).map(|(k, v)| (k.clone(), v.clone())),
            );
            effects.push(Value::Object(table));
        }
        let mut scene = Map::new();
        scene.insert("name".to_owned(), self.name.clone().into());
        if !self.description.is_empty() {
            scene.insert("description".to_owned(), self.description.clone().into());
        }
        scene.insert("effect".to_owned(), effects.into());
        if let Some(simulate) = &self.simulate {
            scene.insert("simulate".to_owned(), simulate.clone());
        }
        Value::Object(scene)
    }

    /// Returns the scene as the window shows it: with the parameter values that were last
    /// requested.
    pub(crate) fn shown(&self) -> Value {
        let mut scene = self.to_json();
        for (k, effect) in self.effects.iter().enumerate() {
            let asked = self.pending.iter().filter(|((id, _), _)| *id == effect.id);
            asked.for_each(|((_, key), value)| scene["effect"][k][key] = value.clone());
        }
        scene
    }

    /// Returns the effects that have a parameter `stiffness`, such as springs.
    pub(crate) fn springs<'a>(&'a self, info: &'a InfoOk) -> impl Iterator<Item = &'a Effect> {
        self.effects.iter().filter(|effect| {
            let kind = info.kind(&effect.kind);
            kind.is_some_and(|kind| kind.schema["properties"].get("stiffness").is_some())
        })
    }
}

impl Effect {
    fn read(table: &Map<String, Value>) -> Option<Self> {
        let text = |key| table.get(key).and_then(Value::as_str).map(str::to_owned);
        let parameters = table
            .iter()
            .filter(|(key, _)| !matches!(key.as_str(), "id" | "kind"))
            .map(|(key, value)| (key.clone(), value.clone()))
            .collect();
        Some(Self { id: text("id")?, kind: text("kind")?, parameters })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn scene() -> Scene {
        let mut scene = Scene::default();
        scene.take(&json!({"name": "S", "description": "A test.", "effect": [
            {"id": "a", "kind": "spring", "stiffness": 1.0}]}));
        scene
    }

    fn stiffness(scene: &Scene) -> f64 {
        scene.value(&scene.effects()[0], "stiffness").and_then(Value::as_f64).expect("a number")
    }

    #[test]
    fn a_wish_shows_until_it_is_answered() {
        let mut scene = scene();
        scene.ask("a", "stiffness", &json!(2.0));
        assert_eq!(stiffness(&scene), 2.0);
        scene.answered("a", "stiffness", &json!(2.0), false);
        assert_eq!(stiffness(&scene), 1.0, "refused: what runs is shown again");
        scene.ask("a", "stiffness", &json!(3.0));
        scene.ask("a", "stiffness", &json!(4.0));
        scene.answered("a", "stiffness", &json!(3.0), true);
        assert_eq!(stiffness(&scene), 4.0, "a later wish is not undone by the answer to an earlier one");
        scene.answered("a", "stiffness", &json!(4.0), true);
        assert_eq!(stiffness(&scene), 4.0);
    }

    #[test]
    fn a_scene_is_known_once_it_was_told_and_stays_so() {
        assert!(!Scene::default().is_known());
        let mut scene = scene();
        scene.set("a", "stiffness", &json!(2.0));
        assert!(scene.is_known());
    }

    #[test]
    fn what_is_saved_is_what_was_told() {
        let scene = scene();
        assert_eq!(scene.to_json(), scene.told);
    }
}
