//! The op `load_scene`, which loads another scene.

use super::{Op, OpRow, Who, must};
use crate::fields::{Fields, bad, illegal};
use crate::{Client, ClientError, ErrorBody};
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(super) const ROW: OpRow = OpRow::new(Who::Holder, &[must("scene")]).weighing(250).long();

/// The answer to the op `load_scene`, with which a client loads a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoadSceneOk {
    /// Effects of the loaded scene, in the order of the scene.
    pub effects: Vec<EffectCost>,
    /// Simulated phenomena in the scene that have no effect because the rig is real.
    pub ignored: Vec<String>,
    /// What the rig cannot make of the scene or may not keep stable, what has no effect in the
    /// scene, and what the simulated rig keeps of an earlier scene: one sentence each, for people.
    /// Empty if a server does not send it.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// An effect of a scene, with the computing time that it needs in each tick.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EffectCost {
    /// Id of the effect in the scene.
    pub id: String,
    /// Kind of the effect, such as `spring`.
    pub kind: String,
    /// Computing time of the effect in each tick, ns.
    pub cost_ns: u64,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    let legal = "a map of the shape of a scene file, or the name of a ready-made scene";
    match fields.remove("scene") {
        Some(scene @ (Value::Object(_) | Value::String(_))) => Ok(Op::LoadScene { scene }),
        Some(other) => Err(illegal("scene", &other, legal)),
        None => Err(bad(format!("field \"scene\" is missing; legal: {legal}"))),
    }
}

impl Client {
    /// Loads another scene and starts to render it. `scene` is a map with the structure of a scene
    /// file, or the name of a ready-made scene.
    pub fn load_scene(&mut self, scene: Value) -> Result<LoadSceneOk, ClientError> {
        self.ask(Op::LoadScene { scene })
    }
}
