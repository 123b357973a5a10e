//! The kinds of effects as files write them: one file a kind, and one list, [`KINDS`].

mod damper;
mod impedance;
mod spring;

use std::sync::LazyLock;

use hbot_core::effects::Kind;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::decode::decode;
use crate::document::Report;
use crate::schema;

/// Every kind that a scene can name. A new one: a file here, and its line in this list.
pub(super) static KINDS: LazyLock<Vec<KindEntry>> =
    LazyLock::new(|| vec![KindEntry::of::<spring::Spring>(), KindEntry::of::<damper::Damper>()]);

/// A kind's own parameters. Its doc comment describes the kind, its fields' doc comments, ranges and units the parameters.
/// `id`, `op`, `effect`, `kind`, `gain` and `fade_s` are not free as names of parameters.
pub(super) trait EffectKind: Serialize + DeserializeOwned + JsonSchema {
    /// What files call it.
    const NAME: &'static str;

    /// Checks what the schema cannot say, and compiles. `path` is the effect's; `None` where the report says why.
    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind>;
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
}

impl Default for Common {
    fn default() -> Self {
        Self { gain: 1.0, fade_s: 0.05 }
    }
}

/// A kind's own parameters with their defaults written out, and what the core runs.
pub(super) type Compiled = (Map<String, Value>, Kind);

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

fn compile<K: EffectKind>(
    value: &Value,
    path: &str,
    report: &mut Report,
) -> Option<(Map<String, Value>, Kind)> {
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
    Some((written, kind))
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
