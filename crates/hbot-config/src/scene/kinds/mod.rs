//! The kinds of effects as files write them: one file a kind, and one list, [`KINDS`].

mod constant;
mod damper;
mod detents;
mod end_stop;
mod friction;
mod guide;
mod impedance;
mod inertia;
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

use hbot_core::effects::Kind;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::decode::decode;
use crate::document::Report;
use crate::schema;

pub(in crate::scene) use track::MAX_POINTS;

/// Every kind that a scene can name. A new one: a file here, and its line in this list.
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

/// A kind's own parameters. Its doc comment describes the kind, its fields' doc comments, ranges and units the parameters.
/// `id`, `op`, `effect`, `kind`, `gain`, `fade_s` and `fade_out_s` are not free as names of parameters.
pub(super) trait EffectKind: Serialize + DeserializeOwned + JsonSchema {
    /// What files call it.
    const NAME: &'static str;

    /// Checks what the schema cannot say, and compiles. `path` is the effect's; `None` where the report says why.
    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind>;

    /// What goes into the scene's table of figures for it; asked only after [`compile`](Self::compile).
    fn figures(&self) -> Vec<f64> {
        Vec::new()
    }
}

/// Parameters that every effect has.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct Common {
    /// Factor on the effect's torque.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) gain: f64,
    /// How long the effect takes to fade in.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    pub(super) fade_s: f64,
    /// How long the effect takes to fade out once another scene is loaded; 0 leaves it to the 50 ms in which any scene becomes
    /// another.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    pub(super) fade_out_s: f64,
}

impl Default for Common {
    fn default() -> Self {
        Self { gain: 1.0, fade_s: 0.05, fade_out_s: 0.0 }
    }
}

/// What is made of an effect's own parameters.
pub(super) struct Compiled {
    /// They themselves, with their defaults written out.
    pub(super) parameters: Map<String, Value>,
    /// What the core runs.
    pub(super) kind: Kind,
    /// What it finds in the scene's table.
    pub(super) figures: Vec<f64>,
}

/// A kind as the list holds it.
pub(super) struct KindEntry {
    pub(super) name: &'static str,
    /// Of what `set` takes: the common parameters and the kind's own.
    pub(super) schema: Value,
    /// Of an effect in a scene: these, `id` and `kind`.
    pub(super) effect_schema: Value,
    /// From values that the schema allows; `None` where the report says what is wrong yet.
    pub(super) compile: fn(&Value, &str, &mut Report) -> Option<Compiled>,
}

impl KindEntry {
    fn of<K: EffectKind>() -> Self {
        let own = schema::of::<K>();
        let mut properties = schema::properties(&schema::of::<Common>());
        properties.extend(schema::properties(&own));
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
        Self { name: K::NAME, schema, effect_schema, compile: compile::<K> }
    }

    /// The kind of a name.
    pub(super) fn named(name: &str) -> Option<&'static Self> {
        KINDS.iter().find(|k| k.name == name)
    }
}

fn compile<K: EffectKind>(value: &Value, path: &str, report: &mut Report) -> Option<Compiled> {
    let shared = &EFFECT_SCHEMA["properties"];
    let parameters: Map<String, Value> = value
        .as_object()?
        .iter()
        .filter(|(key, _)| shared.get(key.as_str()).is_none())
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect();
    let parameters: K = decode(&Value::Object(parameters), path, report)?;
    let kind = parameters.compile(path, report)?;
    let Ok(Value::Object(written)) = serde_json::to_value(&parameters) else { return None };
    Some(Compiled { parameters: written, kind, figures: parameters.figures() })
}

/// The most characters of an effect's id.
const ID_CHARS: usize = 64;

/// `id` and `kind`, without the list of kinds.
static HEADER_SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    json!({
        "type": "object",
        "properties": {
            "id": {
                "description": "What `set` and `reference` call the effect. Ids of a scene differ.",
                "type": "string", "minLength": 1, "maxLength": ID_CHARS, "pattern": "^[A-Za-z0-9_.-]+$"
            },
            "kind": { "description": "What the effect is.", "type": "string" }
        },
        "required": ["id", "kind"]
    })
});

/// What an effect of an unknown kind is held against: everything but the kind's own parameters.
pub(super) static EFFECT_SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    let mut schema = HEADER_SCHEMA.clone();
    schema["properties"]["kind"]["enum"] = KINDS.iter().map(|k| k.name).collect();
    if let Some(properties) = schema["properties"].as_object_mut() {
        properties.extend(schema::properties(&schema::of::<Common>()));
    }
    schema
});
