//! The scene file: what the sphere shall feel like, and what the simulated rig shows of a real one.

mod files;
mod kinds;
mod running;
mod simulate;

use std::path::Path;
use std::sync::LazyLock;

use hbot_core::effects::Kind;
use hbot_core::scene::{MAX_EFFECTS, MAX_FIGURES};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use self::kinds::{Common, Compiled, EFFECT_SCHEMA, KINDS, KindEntry};
pub use self::running::{EffectPlace, RunningScene, SetError};
pub use self::simulate::{
    CageFriction, Eccentric, Encoder, Gear, Hand, JointFriction, Link, Motor, Pivoting, Simulate, Slip,
    WheelModules,
};
use crate::decode::decode;
use crate::diagnostic::{Diagnostics, LoadError};
use crate::document::{Document, Report, join};
use crate::text::read_text;
use crate::validate::validate;

/// The scene that is built in.
const DEFAULT: &str = include_str!("../../../../scenes/spring.toml");

/// A legal scene. Made from text or JSON; every figure in it is in range.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    name: String,
    effects: Vec<SceneEffect>,
    simulate: Option<Simulate>,
}

/// One effect of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneEffect {
    id: String,
    kind_name: &'static str,
    common: Common,
    /// The kind's own, defaults written out.
    parameters: Map<String, Value>,
    kind: Kind,
    /// What it finds in the scene's table.
    figures: Vec<f64>,
}

/// What there is to choose from: a kind of effect, or a phenomenon of the simulated rig.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// What files call it.
    pub name: &'static str,
    /// What it is, a sentence or two.
    pub description: String,
    /// JSON schema of its parameters, with `description`, `default`, range and `unit` of each; for a kind, of what `set`
    /// takes.
    pub schema: Value,
}

/// All kinds of effects.
#[must_use]
pub fn kinds() -> Vec<Listed> {
    KINDS.iter().map(|kind| Listed::new(kind.name, &kind.schema)).collect()
}

/// All phenomena that `[simulate]` can name.
#[must_use]
pub fn phenomena() -> Vec<Listed> {
    /// Their names live as long as the schema that they are keys of.
    static NAMES: LazyLock<Map<String, Value>> =
        LazyLock::new(|| crate::schema::properties(&simulate::SCHEMA));
    NAMES.iter().map(|(name, schema)| Listed::new(name, schema)).collect()
}

/// One parameter of what is listed, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// What files call it.
    pub name: String,
    /// What it does.
    pub description: String,
    /// What is legal, with the unit.
    pub legal: String,
    /// Its default, as JSON.
    pub default: String,
}

impl Listed {
    /// The parameters in words, in the order of the schema.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let properties = crate::schema::properties(&self.schema);
        let words = properties.iter().map(|(name, schema)| Parameter {
            name: name.clone(),
            description: schema["description"].as_str().unwrap_or_default().replace('\n', " "),
            legal: crate::legal::legal_with_elements(schema),
            default: crate::legal::short(&schema["default"]),
        });
        words.collect()
    }

    fn new(name: &'static str, schema: &Value) -> Self {
        let description = schema["description"].as_str().unwrap_or_default().to_owned();
        Self { name, description, schema: schema.clone() }
    }
}

/// The top of a scene file; effects are held against the schema of their kind one by one.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Top {
    /// What people call the scene.
    #[schemars(length(min = 1, max = 100))]
    name: String,
    /// The effects, in the order of their sum.
    #[schemars(length(max = MAX_EFFECTS))]
    effect: Vec<Map<String, Value>>,
    /// Phenomena of the simulated rig. Absent: the simulated rig stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Simulate")]
    simulate: Option<Simulate>,
}

impl Default for Top {
    fn default() -> Self {
        Self { name: "unnamed".to_owned(), effect: Vec::new(), simulate: None }
    }
}

static TOP_SCHEMA: LazyLock<Value> = LazyLock::new(crate::schema::of::<Top>);

impl SceneFile {
    /// The default scene: a spring. The same as `scenes/spring.toml`.
    #[must_use]
    pub fn default_scene() -> Self {
        Self::from_toml(DEFAULT, "scenes/spring.toml")
            .unwrap_or_else(|mistakes| panic!("the scene that is built in is legal, by test:\n{mistakes}"))
    }

    /// A scene from the text of its file; `file` is its name in messages.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, Diagnostics> {
        Self::from_document(Document::from_toml(text, file)?)
    }

    /// A scene from a JSON value of the same shape, as in `load_scene`.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn from_json(scene: Value) -> Result<Self, Diagnostics> {
        Self::from_document(Document::from_json(scene))
    }

    /// A scene from its file.
    ///
    /// # Errors
    /// The file cannot be read, or everything that is wrong with it.
    pub fn from_path(path: &Path) -> Result<Self, LoadError> {
        let text = read_text(path).map_err(|source| LoadError::Read { path: path.to_owned(), source })?;
        let mut document = Document::from_toml(&text, &path.display().to_string())?;
        files::read_points(&mut document, path.parent().unwrap_or(Path::new("")));
        Ok(Self::from_document(document)?)
    }

    fn from_document(Document { tree, mut report }: Document) -> Result<Self, Diagnostics> {
        validate(&TOP_SCHEMA, &tree, "", &mut report);
        let mut effects: Vec<SceneEffect> = Vec::new();
        // Those beyond are one mistake already, and none of theirs matters.
        for (i, value) in tree["effect"].as_array().into_iter().flatten().take(MAX_EFFECTS).enumerate() {
            let path = format!("effect[{i}]");
            let Some(effect) = SceneEffect::parse(value, &path, &mut report) else { continue };
            if let Some(other) = effects.iter().position(|e| e.id == effect.id) {
                let message = format!("{:?} is the id of effect[{other}] already", effect.id);
                report.push(&join(&path, "id"), message, "ids that differ".to_owned());
            }
            effects.push(effect);
        }
        check_figures(&effects, "effect", &mut report);
        // It is shown in other people's terminals.
        if tree["name"].as_str().is_some_and(|name| !name.chars().all(is_visible)) {
            report.push("name", "it has control or invisible characters", "text of one line".to_owned());
        }
        let top = if report.clean_under("") { decode::<Top>(&tree, "", &mut report) } else { None };
        report.finish(top.map(|top| Self { name: top.name, effects, simulate: top.simulate }))
    }

    /// The scene as JSON, with every default written out; [`from_json`](Self::from_json) makes the same scene of it.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let mut scene = json!({
            "name": self.name,
            "effect": self.effects.iter().map(SceneEffect::to_json).collect::<Vec<_>>(),
        });
        if let Some(simulate) = &self.simulate {
            scene["simulate"] = json!(simulate);
        }
        scene
    }

    /// What people call the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The effects, in the order of their sum; at most [`MAX_EFFECTS`].
    #[must_use]
    pub fn effects(&self) -> &[SceneEffect] {
        &self.effects
    }

    /// The phenomena of the simulated rig; `None` where the scene leaves them as they are.
    #[must_use]
    pub fn simulate(&self) -> Option<&Simulate> {
        self.simulate.as_ref()
    }
}

/// Whether a character shows as what it is, as the standard library's `{:?}` decides: none that controls a terminal, ends a line,
/// turns the direction of text or is invisible.
fn is_visible(c: char) -> bool {
    // Behind a letter, so that a mark which combines with one is not taken for one that stands alone.
    matches!(c, '"' | '\'' | '\\' | '\u{a0}' | '\u{3000}')
        || ['a', c].iter().collect::<String>().escape_debug().nth(1) == Some(c)
}

/// Holds the figures of all effects against the room that the core has for them.
fn check_figures(effects: &[SceneEffect], path: &str, report: &mut Report) {
    let figures: usize = effects.iter().map(|effect| effect.figures.len()).sum();
    if figures > MAX_FIGURES {
        let message = format!("positions, orientations and points take {figures} figures");
        report.push(path, message, format!("at most {MAX_FIGURES} in a scene (a point takes 5)"));
    }
}

impl SceneEffect {
    /// What `set` and `reference` call it; unique in its scene.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// What files call its kind.
    #[must_use]
    pub fn kind_name(&self) -> &'static str {
        self.kind_name
    }

    /// What the core runs.
    #[must_use]
    pub fn kind(&self) -> &Kind {
        &self.kind
    }

    /// Factor on its torque, 0 to 10.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.common.gain
    }

    /// How long it takes to fade in, s.
    #[must_use]
    pub fn fade_s(&self) -> f64 {
        self.common.fade_s
    }

    /// How long it takes to fade out once another scene is loaded, s.
    #[must_use]
    pub fn fade_out_s(&self) -> f64 {
        self.common.fade_out_s
    }

    /// The effect as JSON, with every default written out.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let mut effect = json!({"id": self.id, "kind": self.kind_name});
        if let Some(effect) = effect.as_object_mut() {
            effect.extend(self.settable());
        }
        effect
    }

    /// What `set` can change: all but id and kind.
    fn settable(&self) -> Map<String, Value> {
        let mut all = Map::new();
        all.insert("gain".to_owned(), self.common.gain.into());
        all.insert("fade_s".to_owned(), self.common.fade_s.into());
        all.insert("fade_out_s".to_owned(), self.common.fade_out_s.into());
        all.extend(self.parameters.clone());
        all
    }

    /// The effect that stands at `path`; `None` where the report says why there is none.
    fn parse(value: &Value, path: &str, report: &mut Report) -> Option<Self> {
        let table = value.as_object()?;
        let entry = table.get("kind").and_then(Value::as_str).and_then(KindEntry::named);
        validate(entry.map_or(&EFFECT_SCHEMA, |e| &e.effect_schema), value, path, report);
        let id = table.get("id").and_then(Value::as_str).unwrap_or_default();
        let at = join(path, "id");
        if report.clean_under(&at) && !id.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b)) {
            report.push(
                &at,
                format!("{id:?} has other characters"),
                "letters, digits, `_`, `-` and `.`".to_owned(),
            );
        }
        if !report.clean_under(path) {
            return None;
        }
        Self::compile(id, entry?, value, path, report)
    }

    /// An effect of values that the schema allows.
    fn compile(
        id: &str,
        entry: &'static KindEntry,
        value: &Value,
        path: &str,
        report: &mut Report,
    ) -> Option<Self> {
        let common = decode(value, path, report)?;
        let Compiled { parameters, kind, figures } = (entry.compile)(value, path, report)?;
        Some(Self { id: id.to_owned(), kind_name: entry.name, common, parameters, kind, figures })
    }
}
