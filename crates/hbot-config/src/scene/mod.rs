//! The scene file: it describes what the sphere feels like, and which imperfections of a real rig
//! the simulated rig shows.

mod catalogue;
mod files;
mod kinds;
mod running;
mod shelf;
pub mod simulate;

use std::path::Path;
use std::sync::LazyLock;

use hbot_core::render::effects::Kind;
use hbot_core::render::scene::{MAX_EFFECTS, MAX_NUMBERS};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

pub use self::catalogue::{Listed, Parameter, kinds, phenomena};
pub use self::kinds::IdleKey;
use self::kinds::{Common, Compiled, EFFECT_SCHEMA, KINDS, KindEntry, unit_vector};
pub use self::running::{EffectPlace, RunningScene, SetError};
pub use self::shelf::{SHELF, ShelfScene};
pub use self::simulate::*;
use crate::angle::to_radians;
use crate::decode::decode;
use crate::diagnostic::{Diagnostics, LoadError};
use crate::document::{Document, Report, join};
use crate::legal::did_you_mean;
use crate::text::read_text;
use crate::validate::validate;

/// Text of the default scene file, compiled into the program.
const DEFAULT: &str = include_str!("../../../../scenes/spring.toml");

/// A scene file, read from TOML or JSON, that has been checked. Every number in it is in range.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    name: String,
    description: String,
    effects: Vec<SceneEffect>,
    simulate: Option<Simulate>,
}

/// One effect of a scene file, such as a spring.
#[derive(Debug, Clone)]
pub struct SceneEffect {
    id: String,
    kind_name: &'static str,
    common: Common,
    /// The parameters of the effect's kind, including those that have their default.
    parameters: Map<String, Value>,
    kind: Kind,
    /// The positions, orientations or points of the effect as a list of numbers. A compiled scene
    /// stores these lists of all effects in one table.
    numbers: Vec<f64>,
    /// The parameters that have no effect because of the values of others.
    idle: Vec<IdleKey>,
    /// Those of `idle` that the file names in vain.
    in_vain: Vec<IdleKey>,
}

impl PartialEq for SceneEffect {
    /// Compares what the file says about two effects. All else follows from it. Whether the file
    /// names a parameter that has its default makes no difference.
    fn eq(&self, other: &Self) -> bool {
        (&self.id, self.kind_name, self.common, &self.parameters)
            == (&other.id, other.kind_name, other.common, &other.parameters)
    }
}

/// The top level of a scene file. Its effects are checked later, each against the schema of its
/// kind.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Top {
    /// Name of the scene, shown to people.
    #[schemars(length(min = 1, max = 100))]
    name: String,
    /// One sentence that says what the sphere feels like, shown to people. An empty text is the
    /// same as none.
    #[schemars(length(max = 300))]
    #[serde(skip_serializing_if = "String::is_empty")]
    description: String,
    /// The effects of the scene. Their torques are added in this order.
    #[schemars(length(max = MAX_EFFECTS))]
    effect: Vec<Map<String, Value>>,
    /// Phenomena of the simulated rig that the scene switches on. Absent: the simulated rig has no
    /// such phenomenon.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Simulate")]
    simulate: Option<Simulate>,
}

impl Default for Top {
    fn default() -> Self {
        Self { name: "unnamed".to_owned(), description: String::new(), effect: Vec::new(), simulate: None }
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

    /// Reads a scene from a JSON value with the structure of a scene file, such as clients send in
    /// the op `load_scene`.
    ///
    /// # Errors
    /// Fails if the value is not a legal scene. The error lists every mistake.
    pub fn from_json(scene: Value) -> Result<Self, Diagnostics> {
        Self::from_document(Document::from_json(scene))
    }

    /// Reads a scene from a scene file, and the recorded paths that it names from their own files.
    ///
    /// # Errors
    /// Fails if a file cannot be read or the scene is not legal. In the second case the error lists
    /// every mistake.
    pub fn from_path(path: &Path) -> Result<Self, LoadError> {
        let text = read_text(path).map_err(|source| LoadError::Read { path: path.to_owned(), source })?;
        let mut document = Document::from_toml(&text, &path.display().to_string())?;
        files::read_points(&mut document, path.parent().unwrap_or(Path::new("")));
        Ok(Self::from_document(document)?)
    }

    fn from_document(Document { mut tree, mut report }: Document) -> Result<Self, Diagnostics> {
        if refuse_rig(&tree, &mut report) {
            return report.finish(None);
        }
        if let Some(simulate) = tree.get_mut("simulate") {
            to_radians(&simulate::SCHEMA, simulate, "simulate", &mut report);
        }
        if tree["effect"].is_object() {
            let legal = "[[effect]] with two brackets, once for each effect".to_owned();
            report.push_key("effect", "this is one table, and a scene has a list of effects", legal);
            return report.finish(None);
        }
        validate(&TOP_SCHEMA, &mut tree, "", &mut report);
        let mut effects: Vec<SceneEffect> = Vec::new();
        let mut ids: Vec<Option<&str>> = Vec::new();
        // A list that is too long has already been reported. Mistakes in the surplus effects do not
        // matter.
        for (i, value) in tree["effect"].as_array().into_iter().flatten().take(MAX_EFFECTS).enumerate() {
            let path = format!("effect[{i}]");
            effects.extend(SceneEffect::parse(value, &path, &mut report));
            let (id, at) = (value["id"].as_str(), join(&path, "id"));
            if let Some(id) = id.filter(|_| report.clean_under(&at))
                && let Some(other) = ids.iter().position(|earlier| *earlier == Some(id))
            {
                let message = format!("{id:?} is the id of effect[{other}] already");
                report.push(&at, message, "ids that differ".to_owned());
            }
            ids.push(id);
        }
        check_numbers(&effects, "effect", &mut report);
        // Other users see these texts in their terminals, so they must not contain control
        // characters.
        for key in ["name", "description"] {
            if tree[key].as_str().is_some_and(|text| !text.chars().all(is_visible)) {
                report.push(key, "it has control or invisible characters", "text of one line".to_owned());
            }
        }
        let top = if report.clean_under("") { decode::<Top>(&tree, "", &mut report) } else { None };
        if let Some(hand) = top.as_ref().and_then(|top| top.simulate?.hand) {
            unit_vector(hand.axis, "simulate.hand.axis", &mut report);
        }
        report.finish(top.map(|top| Self {
            name: top.name,
            description: top.description,
            effects,
            simulate: top.simulate,
        }))
    }

    /// Returns the scene as JSON, including all parameters that have their default.
    /// [`from_json`](Self::from_json) restores an equal scene from it.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let mut scene = json!({
            "name": self.name,
            "effect": self.effects.iter().map(SceneEffect::to_json).collect::<Vec<_>>(),
        });
        if !self.description.is_empty() {
            scene["description"] = self.description.clone().into();
        }
        if let Some(simulate) = &self.simulate {
            scene["simulate"] = json!(simulate);
        }
        scene
    }

    /// Returns the scene as the text of a scene file, including all parameters that have their
    /// default.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(&without_null(self.to_json())).unwrap_or_else(|error| {
            unreachable!("a legal scene has no null and no map without text keys: {error}")
        })
    }

    /// Returns the name of the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the sentence that says what the scene feels like. Empty if the scene has none.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Returns the effects of the scene, at most [`MAX_EFFECTS`]. Their torques are added in this
    /// order.
    #[must_use]
    pub fn effects(&self) -> &[SceneEffect] {
        &self.effects
    }

    /// Returns the phenomena of the simulated rig that the scene switches on. Returns `None` if the
    /// scene has no such table.
    #[must_use]
    pub fn simulate(&self) -> Option<&Simulate> {
        self.simulate.as_ref()
    }
}

/// Removes keys without a value, which TOML cannot write, from all tables in `value`.
fn without_null(value: Value) -> Value {
    match value {
        Value::Object(table) => table
            .into_iter()
            .filter(|(_, value)| !value.is_null())
            .map(|(key, value)| (key, without_null(value)))
            .collect(),
        other => other,
    }
}

/// Returns whether the file is a rig file, which a command line can confuse with a scene file. Then
/// adds a mistake to the report. The other mistakes of such a file would only hide this one.
fn refuse_rig(tree: &Value, report: &mut Report) -> bool {
    let Some(key) = ["sphere", "wheel"].into_iter().find(|key| tree.get(key).is_some()) else { return false };
    let message = match report.file() {
        Some(file) => {
            format!(
                "this is a rig file, not a scene file. `hbot server --rig {file}` runs it, and `hbot rig check {file}` \
                 checks it"
            )
        }
        None => "this is a rig, not a scene".to_owned(),
    };
    report.push_key(key, message, "a file with [[effect]]".to_owned());
    true
}

/// Returns whether a character can be shown as it is, by the rules of the standard library's
/// `{:?}`. False for characters that control a terminal, end a line, change the direction of text
/// or are invisible.
fn is_visible(c: char) -> bool {
    // `escape_debug` escapes a combining mark only at the start of a string, so a letter precedes
    // `c`.
    matches!(c, '"' | '\'' | '\\' | '\u{a0}' | '\u{3000}')
        || ['a', c].iter().collect::<String>().escape_debug().nth(1) == Some(c)
}

/// Checks that the positions, orientations and points of all effects together have at most
/// [`MAX_NUMBERS`] numbers. If they have more, adds a mistake at `path` to the report.
fn check_numbers(effects: &[SceneEffect], path: &str, report: &mut Report) {
    let numbers: usize = effects.iter().map(|effect| effect.numbers.len()).sum();
    if numbers > MAX_NUMBERS {
        let message = format!("positions, orientations and points take {numbers} numbers");
        report.push(path, message, format!("at most {MAX_NUMBERS} in a scene (a point takes 5)"));
    }
}

impl SceneEffect {
    /// Returns the id of the effect, which is unique in its scene. The ops `set` and `reference`
    /// name effects by their id.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Returns the name of the effect's kind in scene files, such as `spring`.
    #[must_use]
    pub fn kind_name(&self) -> &'static str {
        self.kind_name
    }

    /// Returns the effect's kind with its parameters, in the form that the core computes.
    #[must_use]
    pub fn kind(&self) -> &Kind {
        &self.kind
    }

    /// Returns the positions (rad), orientations or points of the effect as a list of numbers, in
    /// the form that the core computes. Empty for kinds without such a list.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Returns the parameters that have no effect because of the values of others, including those
    /// that the file does not name.
    #[must_use]
    pub fn idle(&self) -> &[IdleKey] {
        &self.idle
    }

    /// Returns the parameters that the file names although they have no effect. A parameter that
    /// has its default is left out if the file also names the one that deprives it of its effect: a
    /// scene that was written by a program names all parameters.
    #[must_use]
    pub fn in_vain(&self) -> &[IdleKey] {
        &self.in_vain
    }

    /// Returns the factor by which the effect's torque is multiplied, 0 to 10.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.common.gain
    }

    /// Returns the time in which the effect fades in, s.
    #[must_use]
    pub fn fade_s(&self) -> f64 {
        self.common.fade_s
    }

    /// Returns the time in which the effect fades out after another scene is loaded, s.
    #[must_use]
    pub fn fade_out_s(&self) -> f64 {
        self.common.fade_out_s
    }

    /// Returns the effect as JSON, including all parameters that have their default.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let mut effect = json!({"id": self.id, "kind": self.kind_name});
        if let Some(effect) = effect.as_object_mut() {
            effect.extend(self.settable());
        }
        effect
    }

    /// Returns all keys and values of the effect that a client can change with the op `set`: all
    /// except `id` and `kind`.
    fn settable(&self) -> Map<String, Value> {
        let mut all = self.parameters.clone();
        all.insert("gain".to_owned(), self.common.gain.into());
        all.insert("fade_s".to_owned(), self.common.fade_s.into());
        all.insert("fade_out_s".to_owned(), self.common.fade_out_s.into());
        all
    }

    /// Reads an effect from the JSON value at `path`. If it is not legal, adds mistakes to the
    /// report and returns `None`.
    fn parse(value: &Value, path: &str, report: &mut Report) -> Option<Self> {
        let table = value.as_object()?;
        let kind = table.get("kind").and_then(Value::as_str).unwrap_or_default();
        let entry = KindEntry::named(kind).or_else(|| {
            // The other keys of a misspelt kind are checked as those of the kind that is meant.
            let meant = did_you_mean(kind, KINDS.iter().map(|entry| entry.name))?;
            let kinds = &EFFECT_SCHEMA["properties"]["kind"];
            validate(kinds, &mut kind.into(), &join(path, "kind"), report);
            KindEntry::named(meant)
        });
        let schema = entry.map_or(&*EFFECT_SCHEMA, |e| &e.effect_schema);
        let mut value = value.clone();
        to_radians(schema, &mut value, path, report);
        kinds::to_matrices(schema, &mut value);
        validate(schema, &mut value, path, report);
        let id = value["id"].as_str().unwrap_or_default();
        let at = join(path, "id");
        if report.clean_under(&at) && !id.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b)) {
            report.push(
                &at,
                format!("{id:?} has other characters"),
                "letters, digits, `_`, `-` and `.`".to_owned(),
            );
        }
        let entry = entry?;
        if !report.clean_under(path) {
            // An effect with mistakes is not compiled, which would find these too.
            kinds::check_directions(&value, path, report);
            return None;
        }
        Self::compile(id, entry, &value, path, report)
    }

    /// Creates an effect from values that its schema allows. If the values are not legal together,
    /// adds mistakes to the report and returns `None`.
    fn compile(
        id: &str,
        entry: &'static KindEntry,
        value: &Value,
        path: &str,
        report: &mut Report,
    ) -> Option<Self> {
        let common = decode(value, path, report)?;
        let Compiled { parameters, kind, numbers, idle } = (entry.compile)(value, path, report)?;
        let is_named = |name: &str| value.get(name).is_some();
        let is_default = |name: &str| parameters.get(name) == entry.schema["properties"][name].get("default");
        let is_in_vain =
            |key: &IdleKey| is_named(key.name) && !(is_default(key.name) && is_named(key.because_of));
        let in_vain = idle.iter().copied().filter(is_in_vain).collect();
        Some(Self {
            id: id.to_owned(),
            kind_name: entry.name,
            common,
            parameters,
            kind,
            numbers,
            idle,
            in_vain,
        })
    }
}
