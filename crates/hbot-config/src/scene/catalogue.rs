//! The catalogue of what a scene can contain: the kinds of effects, and the phenomena of the
//! simulated rig, with their parameters.

use std::sync::LazyLock;

use serde::Serialize;
use serde_json::{Map, Value};

use super::kinds::KINDS;
use super::simulate::SCHEMA;

/// Describes something that a scene can contain: a kind of effect, or a phenomenon of the simulated
/// rig.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// Name of the kind or phenomenon in scene files.
    pub name: &'static str,
    /// A description of what the kind or phenomenon does, in one or two sentences.
    pub description: String,
    /// JSON schema of the parameters, with `description`, `default`, range and `unit` of each. For
    /// a kind of effect, it covers all that the op `set` accepts.
    pub schema: Value,
}

/// The parameters that every kind has.
const COMMON: [&str; 3] = ["gain", "fade_s", "fade_out_s"];

/// Returns a description of every kind of effect that a scene can contain.
#[must_use]
pub fn kinds() -> Vec<Listed> {
    KINDS.iter().map(|kind| Listed::new(kind.name, &kind.schema)).collect()
}

/// Returns a description of every phenomenon that the table `[simulate]` of a scene can contain.
#[must_use]
pub fn phenomena() -> Vec<Listed> {
    /// A static copy of the schema's properties, so that the names of the phenomena are `&'static
    /// str`.
    static NAMES: LazyLock<Map<String, Value>> = LazyLock::new(|| crate::schema::properties(&SCHEMA));
    NAMES.iter().map(|(name, schema)| Listed::new(name, schema)).collect()
}

/// A description in words of one parameter of an effect or phenomenon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// Name of the parameter in scene files.
    pub name: String,
    /// A description of what the parameter does.
    pub description: String,
    /// The legal values of the parameter, with the unit.
    pub legal: String,
    /// The default value of the parameter, as JSON.
    pub default: String,
}

impl Listed {
    /// Returns a description of each parameter, in the order of the schema.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let properties = crate::schema::properties(&self.schema);
        let words = properties.iter().map(|(name, schema)| Parameter {
            name: name.clone(),
            description: schema["description"].as_str().unwrap_or_default().to_owned(),
            legal: crate::legal::legal_with_elements(schema),
            default: crate::legal::short(&schema["default"]),
        });
        words.collect()
    }

    /// Returns the text of an effect of this kind for a scene file, with all parameters of the kind
    /// at their defaults, each with its unit. Parameters that are absent by default are left out.
    #[must_use]
    pub fn snippet(&self) -> String {
        let all = self.text_with(&[]);
        // A key that has no effect at its default would only raise a question.
        let scene = super::SceneFile::from_toml(&all, self.name).ok();
        let effect = scene.as_ref().and_then(|scene| scene.effects().first());
        let idle: Vec<&str> =
            effect.map(|effect| effect.in_vain().iter().map(|key| key.name).collect()).unwrap_or_default();
        self.text_with(&idle)
    }

    /// Returns an effect of this kind with its defaults as TOML, without the keys `left_out`.
    fn text_with(&self, left_out: &[&str]) -> String {
        let mut text = format!("[[effect]]\nid = \"{0}\"\nkind = \"{0}\"\n", self.name);
        for (key, property) in crate::schema::properties(&self.schema) {
            let default = &property["default"];
            let common = COMMON.contains(&key.as_str()) || left_out.contains(&key.as_str());
            if common || default.is_null() || default.as_array().is_some_and(Vec::is_empty) {
                continue;
            }
            let unit = property["unit"].as_str().map_or_else(String::new, |unit| format!(" # {unit}"));
            text.push_str(&format!("{key} = {}{unit}\n", crate::legal::short(default)));
        }
        text
    }

    fn new(name: &'static str, schema: &Value) -> Self {
        let description = schema["description"].as_str().unwrap_or_default().to_owned();
        Self { name, description, schema: schema.clone() }
    }
}
