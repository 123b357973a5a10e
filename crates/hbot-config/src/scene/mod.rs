//! The scene file: it describes what the sphere feels like, and which imperfections of a real rig
//! the simulated rig shows.

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

/// Text of the default scene, which is compiled into the program.
const DEFAULT: &str = include_str!("../../../../scenes/spring.toml");

/// A legal scene file, read from TOML or JSON. Every number in it is in range.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    name: String,
    effects: Vec<SceneEffect>,
    simulate: Option<Simulate>,
}

/// One effect of a scene file.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneEffect {
    id: String,
    kind_name: &'static str,
    common: Common,
    /// The parameters of the effect's kind, including those that have their default.
    parameters: Map<String, Value>,
    kind: Kind,
    /// The numbers that the effect puts into the scene's table of figures.
    figures: Vec<f64>,
}

/// Describes one kind of effect, or one phenomenon of the simulated rig, that a scene can name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// Name of the kind or phenomenon in files.
    pub name: &'static str,
    /// What the kind or phenomenon does, in one or two sentences.
    pub description: String,
    /// JSON schema of the parameters, with `description`, `default`, range and `unit` of each. For
    /// a kind, it covers what the op `set` accepts.
    pub schema: Value,
}

/// Returns all kinds of effects that a scene can name.
#[must_use]
pub fn kinds() -> Vec<Listed> {
    KINDS.iter().map(|kind| Listed::new(kind.name, &kind.schema)).collect()
}

/// Returns all phenomena that the table `[simulate]` of a scene can name.
#[must_use]
pub fn phenomena() -> Vec<Listed> {
    /// A static copy of the schema's properties, so that their names are `&'static str`.
    static NAMES: LazyLock<Map<String, Value>> =
        LazyLock::new(|| crate::schema::properties(&simulate::SCHEMA));
    NAMES.iter().map(|(name, schema)| Listed::new(name, schema)).collect()
}

/// Describes one parameter of a kind or phenomenon in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// Name of the parameter in files.
    pub name: String,
    /// What the parameter does.
    pub description: String,
    /// The legal values, with the unit.
    pub legal: String,
    /// The default value, as JSON.
    pub default: String,
}

impl Listed {
    /// Returns a description of each parameter, in the order of the schema.
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

/// The top level of a scene file. Each effect is later checked against the schema of its kind.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Top {
    /// Name of the scene, for people.
    #[schemars(length(min = 1, max = 100))]
    name: String,
    /// The effects. Their torques are added in this order.
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
    /// Returns the default scene: a spring, as in `scenes/spring.toml`.
    #[must_use]
    pub fn default_scene() -> Self {
        Self::from_toml(DEFAULT, "scenes/spring.toml")
            .unwrap_or_else(|mistakes| panic!("the scene that is built in is legal, by test:\n{mistakes}"))
    }

    /// Reads a scene from the text of a scene file. `file` is the name of the file in messages.
    ///
    /// # Errors
    /// Fails if the text is not a legal scene. The error lists every mistake.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, Diagnostics> {
        Self::from_document(Document::from_toml(text, file)?)
    }

    /// Reads a scene from a JSON value with the structure of a scene file, as in the op
    /// `load_scene`.
    ///
    /// # Errors
    /// Fails if the value is not a legal scene. The error lists every mistake.
    pub fn from_json(scene: Value) -> Result<Self, Diagnostics> {
        Self::from_document(Document::from_json(scene))
    }

    /// Reads a scene from a scene file, including the recorded paths that it names.
    ///
    /// # Errors
    /// Fails if the file cannot be read or is not a legal scene. The error then lists every
    /// mistake.
    pub fn from_path(path: &Path) -> Result<Self, LoadError> {
        let text = read_text(path).map_err(|source| LoadError::Read { path: path.to_owned(), source })?;
        let mut document = Document::from_toml(&text, &path.display().to_string())?;
        files::read_points(&mut document, path.parent().unwrap_or(Path::new("")));
        Ok(Self::from_document(document)?)
    }

    fn from_document(Document { tree, mut report }: Document) -> Result<Self, Diagnostics> {
        validate(&TOP_SCHEMA, &tree, "", &mut report);
        let mut effects: Vec<SceneEffect> = Vec::new();
        // A list that is too long has already been reported. Mistakes in the surplus effects do not
        // matter.
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
        // Other users see the name in their terminals, so it must not contain control characters.
        if tree["name"].as_str().is_some_and(|name| !name.chars().all(is_visible)) {
            report.push("name", "it has control or invisible characters", "text of one line".to_owned());
        }
        let top = if report.clean_under("") { decode::<Top>(&tree, "", &mut report) } else { None };
        report.finish(top.map(|top| Self { name: top.name, effects, simulate: top.simulate }))
    }

    /// Returns the scene as JSON, with all defaults written out. [`from_json`](Self::from_json)
    /// reads the equal scene from it.
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

    /// Returns the name of the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the effects, at most [`MAX_EFFECTS`]. Their torques are added in this order.
    #[must_use]
    pub fn effects(&self) -> &[SceneEffect] {
        &self.effects
    }

    /// Returns the phenomena of the simulated rig. `None` if the scene leaves the simulated rig as
    /// it is.
    #[must_use]
    pub fn simulate(&self) -> Option<&Simulate> {
        self.simulate.as_ref()
    }
}

/// Returns whether a character is displayed as itself, as the standard library's `{:?}` decides.
/// False for characters that control a terminal, end a line, change the direction of text or are
/// invisible.
fn is_visible(c: char) -> bool {
    // `escape_debug` escapes a combining mark only at the start of a string, so a letter precedes
    // `c`.
    matches!(c, '"' | '\'' | '\\' | '\u{a0}' | '\u{3000}')
        || ['a', c].iter().collect::<String>().escape_debug().nth(1) == Some(c)
}

/// Reports a mistake at `path` if the effects have more than [`MAX_FIGURES`] figures (numbers for
/// positions, orientations and points) together.
fn check_figures(effects: &[SceneEffect], path: &str, report: &mut Report) {
    let figures: usize = effects.iter().map(|effect| effect.figures.len()).sum();
    if figures > MAX_FIGURES {
        let message = format!("positions, orientations and points take {figures} figures");
        report.push(path, message, format!("at most {MAX_FIGURES} in a scene (a point takes 5)"));
    }
}

impl SceneEffect {
    /// Returns the id that the ops `set` and `reference` use for the effect. It is unique in its
    /// scene.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Returns the name of the effect's kind in files, such as `spring`.
    #[must_use]
    pub fn kind_name(&self) -> &'static str {
        self.kind_name
    }

    /// Returns the effect's kind with its parameters, as the core computes it.
    #[must_use]
    pub fn kind(&self) -> &Kind {
        &self.kind
    }

    /// Returns the factor on the effect's torque, 0 to 10.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.common.gain
    }

    /// Returns how long the effect takes to fade in, s.
    #[must_use]
    pub fn fade_s(&self) -> f64 {
        self.common.fade_s
    }

    /// Returns how long the effect takes to fade out after another scene is loaded, s.
    #[must_use]
    pub fn fade_out_s(&self) -> f64 {
        self.common.fade_out_s
    }

    /// Returns the effect as JSON, with all defaults written out.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let mut effect = json!({"id": self.id, "kind": self.kind_name});
        if let Some(effect) = effect.as_object_mut() {
            effect.extend(self.settable());
        }
        effect
    }

    /// Returns everything that the op `set` can change: all keys except `id` and `kind`.
    fn settable(&self) -> Map<String, Value> {
        let mut all = Map::new();
        all.insert("gain".to_owned(), self.common.gain.into());
        all.insert("fade_s".to_owned(), self.common.fade_s.into());
        all.insert("fade_out_s".to_owned(), self.common.fade_out_s.into());
        all.extend(self.parameters.clone());
        all
    }

    /// Reads the effect at `path`. Returns `None` and adds mistakes to the report if it is not
    /// legal.
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

    /// Makes an effect of values that its schema allows. Returns `None` and adds mistakes to the
    /// report if they are not legal together.
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
