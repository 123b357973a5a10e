//! The kinds of effects as scene files write them. Each kind has a file here and a line in the list
//! [`KINDS`].

mod constant;
mod damper;
mod detents;
mod end_stop;
mod friction;
mod guide;
mod impedance;
mod inertia;
mod knock;
mod magnet;
mod pendulum;
mod pulse;
mod snaps;
mod spring;
mod target;
mod texture;
mod track;
mod vibration;

use std::sync::LazyLock;

use hbot_core::render::effects::Kind;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::decode::decode;
use crate::document::Report;
use crate::schema;

pub(in crate::scene) use impedance::to_matrices;
pub(in crate::scene) use target::{check_directions, unit_vector};
pub(in crate::scene) use track::MAX_POINTS;

/// Every kind of effect that a scene can contain. To add a kind, add a file in this folder and a
/// line in this list.
pub(super) static KINDS: LazyLock<Vec<KindEntry>> = LazyLock::new(|| {
    vec![
        KindEntry::of::<constant::Constant>(),
        KindEntry::of::<spring::Spring>(),
        KindEntry::of::<damper::Damper>(),
        KindEntry::of::<inertia::Inertia>(),
        KindEntry::of::<friction::Friction>(),
        KindEntry::of::<detents::Detents>(),
        KindEntry::of::<snaps::Snaps>(),
        KindEntry::of::<end_stop::EndStop>(),
        KindEntry::of::<guide::Guide>(),
        KindEntry::of::<texture::Texture>(),
        KindEntry::of::<vibration::Vibration>(),
        KindEntry::of::<pendulum::Pendulum>(),
        KindEntry::of::<magnet::Magnet>(),
        KindEntry::of::<pulse::Pulse>(),
        KindEntry::of::<track::Track>(),
    ]
});

/// Implemented by the parameters of each kind of effect. The doc comments of the type and its
/// fields, with the fields' ranges and units, become the description that users read. No parameter
/// can be called `id`, `op`, `effect`, `kind`, `gain`, `fade_s` or `fade_out_s`.
pub(super) trait EffectKind: Serialize + DeserializeOwned + JsonSchema {
    /// Name of the kind in scene files, such as `spring`.
    const NAME: &'static str;

    /// Checks what the schema cannot express, and creates the core's effect. `path` is the path of
    /// the effect in the file. If the parameters are not legal, adds mistakes to the report and
    /// returns `None`.
    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind>;

    /// Returns the positions, orientations or points of the effect as a list of numbers. A compiled
    /// scene stores these lists of all effects in one table. Called only after
    /// [`compile`](Self::compile) has succeeded.
    fn numbers(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Returns the parameters that have no effect because of the values of others, including those
    /// that the file does not name.
    fn idle(&self) -> Vec<IdleKey> {
        Vec::new()
    }
}

/// A parameter of an effect that has no effect, because of the values of other parameters. An
/// example is the `twist` of an end stop that has only the wall of the cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IdleKey {
    /// Name of the parameter in scene files.
    pub name: &'static str,
    /// Name of the parameter whose value deprives this one of its effect.
    pub because_of: &'static str,
    /// What a user has to do to give the parameter an effect, such as `set free = "plane"`.
    pub remedy: &'static str,
}

/// Returns idle parameters with the same cause and remedy.
fn idle_keys(names: &[&'static str], because_of: &'static str, remedy: &'static str) -> Vec<IdleKey> {
    names.iter().map(|&name| IdleKey { name, because_of, remedy }).collect()
}

/// The parameters that every kind of effect has.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Common {
    /// Factor by which the effect's torque is multiplied.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) gain: f64,
    /// Time in which the effect fades in.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    pub(super) fade_s: f64,
    /// Time in which the effect fades out after another scene is loaded. 0: it ends with the blend
    /// of 50 ms between the scenes.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    pub(super) fade_out_s: f64,
}

impl Default for Common {
    fn default() -> Self {
        Self { gain: 1.0, fade_s: 0.05, fade_out_s: 0.0 }
    }
}

/// An effect after its parameters have been checked.
pub(super) struct Compiled {
    /// The parameters of the effect, including those that have their default.
    pub(super) parameters: Map<String, Value>,
    /// The kind of the effect with its parameters, as the core computes it.
    pub(super) kind: Kind,
    /// The positions, orientations or points of the effect as a list of numbers. A compiled scene
    /// stores these lists of all effects in one table.
    pub(super) numbers: Vec<f64>,
    /// The parameters that have no effect because of the values of others.
    pub(super) idle: Vec<IdleKey>,
}

/// Describes one kind of effect: its name, its schemas and the function that compiles it.
pub(super) struct KindEntry {
    pub(super) name: &'static str,
    /// JSON schema of the parameters that a client can set while a scene runs (with the op `set`):
    /// those of the kind, then the common ones.
    pub(super) schema: Value,
    /// JSON schema of an effect of this kind in a scene file: `id`, `kind` and all parameters.
    pub(super) effect_schema: Value,
    /// Creates an effect from values that the schema allows. If the values are not legal together,
    /// adds mistakes to the report and returns `None`.
    pub(super) compile: fn(&Value, &str, &mut Report) -> Option<Compiled>,
}

impl KindEntry {
    fn of<K: EffectKind>() -> Self {
        Self::new(K::NAME, &schema::of::<K>(), compile::<K>)
    }

    /// Creates the entry of a kind whose own parameters have the JSON schema `own`.
    fn new(
        name: &'static str,
        own: &Value,
        compile: fn(&Value, &str, &mut Report) -> Option<Compiled>,
    ) -> Self {
        // Panel, page and `scene kinds` show the parameters in this order.
        let mut properties = schema::properties(own);
        properties.extend(schema::properties(&schema::of::<Common>()));
        let required = own["required"].as_array().cloned().unwrap_or_default();
        let schema = json!({
            "type": "object",
            "description": own["description"],
            "properties": properties,
            "required": required,
            "additionalProperties": false,
        });
        let mut all = schema::properties(&HEADER_SCHEMA);
        all.extend(properties);
        let mut effect_schema = schema.clone();
        effect_schema["properties"] = Value::Object(all);
        effect_schema["required"] = ["id", "kind"].into_iter().map(Value::from).chain(required).collect();
        Self { name, schema, effect_schema, compile }
    }

    /// Returns the entry for the kind with this name, or `None` if there is no such kind.
    pub(super) fn named(name: &str) -> Option<&'static Self> {
        KINDS.iter().find(|k| k.name == name)
    }
}

fn compile<K: EffectKind>(value: &Value, path: &str, report: &mut Report) -> Option<Compiled> {
    let parameters: K = decode(&own_parameters(value)?, path, report)?;
    let kind = parameters.compile(path, report)?;
    let Ok(Value::Object(written)) = serde_json::to_value(&parameters) else { return None };
    let (numbers, idle) = (parameters.numbers(), parameters.idle());
    Some(Compiled { parameters: written, kind, numbers, idle })
}

/// Returns the parameters of an effect without those that every kind has.
fn own_parameters(effect: &Value) -> Option<Value> {
    let shared = &EFFECT_SCHEMA["properties"];
    let own = effect.as_object()?.iter().filter(|(key, _)| shared.get(key.as_str()).is_none());
    Some(own.map(|(key, value)| (key.clone(), value.clone())).collect())
}

/// Largest number of characters in an effect's id.
const ID_CHARS: usize = 64;

/// The JSON schema of an effect's keys `id` and `kind`. It does not list the legal kinds.
static HEADER_SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    json!({
        "type": "object",
        "properties": {
            "id": {
                "description": "What `set` and `reference` call the effect. Ids of a scene differ.",
                "type": "string", "minLength": 1, "maxLength": ID_CHARS, "pattern": "^[A-Za-z0-9_.-]+$",
                "legal": "a name of your own, such as id = \"a\""
            },
            "kind": { "description": "What the effect is.", "type": "string" }
        },
        "required": ["id", "kind"]
    })
});

/// The JSON schema used for an effect whose kind is unknown: `id`, `kind` and the parameters that
/// every effect has.
pub(super) static EFFECT_SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    let mut schema = HEADER_SCHEMA.clone();
    schema["properties"]["kind"]["enum"] = KINDS.iter().map(|k| k.name).collect();
    if let Some(properties) = schema["properties"].as_object_mut() {
        properties.extend(schema::properties(&schema::of::<Common>()));
    }
    schema
});
