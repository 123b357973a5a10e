//! `hbot set`: changes parameters of an effect while a server renders it.

use std::process::ExitCode;

use anyhow::{anyhow, bail};
use clap::Args;
use hbot_api::InfoOk;
use hbot_config::advice::{Abilities, Told, Warning};
use hbot_config::scene::{SetError, kinds};
use hbot_config::{RunningScene, SceneFile, decimal_point};
use hbot_server::service::set_refusal;
use serde_json::{Map, Value};

use super::out::{WrongLine, foreign, tell};
use super::{Commanding, orders, show, style};

/// Options of `hbot set`.
#[derive(Debug, Args)]
pub(crate) struct SetArgs {
    /// Id of the effect in the running scene, such as `spring`
    #[arg(value_parser = id)]
    effect: String,
    /// Parameters, such as `stiffness=2`, `cone="35 deg"` or `axis=[0,0,1]`
    #[arg(required = true, value_name = "KEY=VALUE", value_parser = assignment, allow_negative_numbers = true)]
    values: Vec<(String, Value)>,
    #[command(flatten)]
    to: Commanding,
}

/// Refuses a parameter where the id of the effect is missing.
fn id(text: &str) -> Result<String, String> {
    let Some((place, value)) = text.split_once('=') else { return Ok(text.to_owned()) };
    Err(match place.rsplit_once('.') {
        Some((effect, key)) => format!("write the effect by itself: hbot set {effect} {key}={value}"),
        None => format!("name the effect first: hbot set EFFECT {text}; `hbot scene show` prints the ids"),
    })
}

/// Parses `KEY=VALUE`. A value that is no JSON is a text, so that texts need no quotes.
fn assignment(text: &str) -> Result<(String, Value), String> {
    let (key, value) = text.split_once('=').ok_or("KEY=VALUE without spaces, such as stiffness=2")?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || value.is_empty() {
        return Err("KEY=VALUE without spaces, such as stiffness=2".to_owned());
    }
    if let Some(right) = decimal_point(value) {
        return Err(format!("write a decimal point: {key}={right}"));
    }
    let value = match serde_json::from_str(value) {
        Err(_) if value.starts_with('[') => {
            return Err(format!("{key}: {value} is no list (is a `]` or a comma missing?)"));
        }
        parsed => parsed.unwrap_or_else(|_| Value::from(value)),
    };
    Ok((key.to_owned(), value))
}

pub(crate) fn run(args: &SetArgs) -> anyhow::Result<ExitCode> {
    let typed = once(&args.values)?;
    let mut client = orders::connect(&args.to.address, "hbot set")?;
    let before = client.info().map_err(orders::remedied)?;
    let kind = effect(&before, &args.effect)["kind"].as_str().unwrap_or_default().to_owned();
    let units: Map<String, Value> =
        typed.keys().filter_map(|key| Some((key.clone(), unit(&kind, key)?.into()))).collect();
    let unit_of = |key: &str| units.get(key).and_then(Value::as_str).unwrap_or_default();
    let parameters: Map<String, Value> =
        typed.iter().map(|(key, value)| (key.clone(), alone(value, unit_of(key)))).collect();
    check(&before, &args.effect, &parameters)?;
    orders::holding(&mut client, args.to.steal, |client| client.set(&args.effect, parameters.clone()))?;
    let after = client.info().map_err(orders::remedied)?;
    let [old, new] = [&before, &after].map(|info| effect(info, &args.effect));
    for (key, typed) in &typed {
        let unit = unit_of(key);
        tell!(
            "{}{}{}: {} = {} (before: {})",
            style::NAME,
            args.effect,
            style::OFF,
            key,
            foreign(&shown(&new[key], typed, unit)),
            foreign(&shown(&old[key], typed, unit))
        )?;
    }
    super::scene::warn(&warnings(&after));
    show::note_without_torque(&after);
    Ok(ExitCode::SUCCESS)
}

/// Returns the parameters. Fails if one is given twice.
fn once(values: &[(String, Value)]) -> anyhow::Result<Map<String, Value>> {
    let mut parameters = Map::new();
    for (key, value) in values {
        if parameters.insert(key.clone(), value.clone()).is_some() {
            bail!(WrongLine(format!("{key} is given twice")));
        }
    }
    Ok(parameters)
}

/// Returns the unit of a parameter of a kind of effect, if it has one and this program knows it.
fn unit(kind: &str, key: &str) -> Option<String> {
    let kind = kinds().into_iter().find(|known| known.name == kind)?;
    kind.schema["properties"][key]["unit"].as_str().map(str::to_owned)
}

/// Returns a value without the unit of its key, if it is a text of a number with it. An angle keeps
/// its unit, which says whether it is in degrees.
fn alone(value: &Value, unit: &str) -> Value {
    let text = value.as_str().filter(|_| !["", "rad"].contains(&unit));
    let number = text.and_then(|text| text.trim_end().strip_suffix(unit)?.trim().parse().ok());
    number.map_or_else(|| value.clone(), Value::Number)
}

/// Returns a number for people: a long fraction is rounded.
fn short(x: f64) -> String {
    let six = show::number(x);
    if six.parse() == Ok(x) || x.abs() >= 1.0e3 {
        return six;
    }
    let three: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    three.to_string()
}

/// Returns numbers as JSON for people.
fn rounded(value: &Value) -> String {
    match value {
        Value::Number(number) => short(number.as_f64().unwrap_or_default()),
        Value::Array(elements) => {
            format!("[{}]", elements.iter().map(rounded).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

/// Returns whether a value is a number or a list of numbers.
fn is_number(value: &Value) -> bool {
    match value {
        Value::Array(elements) => elements.first().is_some_and(is_number),
        value => value.is_number(),
    }
}

/// Returns a value of the running scene for people with its unit, in degrees if the user has typed
/// degrees.
fn shown(value: &Value, typed: &Value, unit: &str) -> String {
    let degrees = match typed {
        Value::String(text) => ["deg", "°"].iter().any(|unit| text.trim_end().ends_with(unit)),
        Value::Array(elements) => {
            return shown(value, elements.first().unwrap_or(&Value::Null), unit);
        }
        _ => false,
    };
    match value {
        Value::Number(number) if degrees => {
            format!("{} deg", show::number(number.as_f64().unwrap_or_default().to_degrees()))
        }
        Value::Array(elements) if degrees => {
            let shown: Vec<_> = elements.iter().map(|element| shown(element, typed, unit)).collect();
            format!("[{}]", shown.join(", "))
        }
        value if is_number(value) => format!("{} {unit}", rounded(value)).trim_end().to_owned(),
        _ => value.to_string(),
    }
}

/// Checks a change as the server does, before the lease is taken from another client for a change
/// that the server would refuse. A scene of a later server can have kinds that this program does
/// not know. Then only the server checks the change. Legal values are those of this program; a
/// later server may allow more, but this refuses them.
fn check(info: &InfoOk, effect: &str, parameters: &Map<String, Value>) -> anyhow::Result<()> {
    let Ok(scene) = SceneFile::from_json(info.scene.clone()) else { return Ok(()) };
    let mut running = RunningScene::new();
    let _ = running.load(scene);
    running.set(effect, parameters).map(drop).map_err(|error| {
        let refusal = set_refusal(effect, &error);
        match error {
            SetError::UnknownEffect { .. } => anyhow!("{refusal}; {}", orders::SHOW_SCENE),
            SetError::Malformed(_) | SetError::Invalid(_) => anyhow!(refusal),
        }
    })
}

/// Returns the effect with the id `id` in the running scene, or null if there is none.
fn effect(info: &InfoOk, id: &str) -> Value {
    let mut effects = info.scene["effect"].as_array().into_iter().flatten();
    effects.find(|effect| effect["id"] == id).cloned().unwrap_or_default()
}

/// Returns what the rig cannot make of the running scene or may not keep stable, and what has no
/// effect in it, as the answer to `load_scene` says it. A scene with kinds that this program does
/// not know has none. An older server does not tell its loop. Then stability is not judged.
fn warnings(info: &InfoOk) -> Vec<Warning> {
    let Ok(scene) = SceneFile::from_json(info.scene.clone()) else { return Vec::new() };
    Abilities::told(Told::from(info)).warnings(&scene)
}

#[cfg(test)]
mod tests {
    use hbot_api::{LimitsInfo, PassivityInfo, RenderInfo, RigInfo};
    use hbot_config::RigConfig;
    use hbot_config::advice::StiffnessBound;
    use serde_json::json;

    use super::*;

    /// Returns what a server of the prototype answers to `info` while it renders `scene`.
    fn info(scene: &SceneFile) -> InfoOk {
        let rig = RigConfig::prototype();
        let sampled = StiffnessBound::of(&rig).unwrap().sampled().into();
        let limits = &rig.rig.limits;
        InfoOk {
            rig: RigInfo { rate_hz: rig.rate_hz, simulated: true, ..RigInfo::default() },
            limits: LimitsInfo {
                torque: limits.torque,
                torque_rate: limits.torque_rate,
                speed: limits.speed,
                passivity: rig.rig.methods.passivity.map(|_| PassivityInfo::default()),
                ..LimitsInfo::default()
            },
            render: Some(RenderInfo { sampled: Some(sampled), ..RenderInfo::default() }),
            scene: scene.to_json(),
            ..InfoOk::default()
        }
    }

    #[test]
    fn a_changed_scene_has_the_warnings_of_one_that_is_loaded() {
        let spring = "[[effect]]\nid = 's'\nkind = 'spring'\nstiffness = ";
        let matrix = "[[300, 0, 0], [0, 2, 0], [0, 0, 1]]\n";
        let air = "[[effect]]\nid = 'air'\nkind = 'damper'\ndamping = 0.08\n";
        let honey = "[[effect]]\nid = 'honey'\nkind = 'damper'\ndamping = 2\n";
        let push = "[[effect]]\nid = 'p'\nkind = 'constant'\ntorque = [2, 1, 0]\n";
        let rubber = "[[effect]]\nid = 'f'\nkind = 'friction'\n";
        for (text, count) in [
            (format!("{spring}2\ndamping = 0.02\n"), 0),
            (format!("{spring}2\ndamping = 20\n"), 1),
            // Each of the two dampings is named.
            (format!("{spring}2\ndamping = 2\n{honey}"), 2),
            (format!("{spring}300\n"), 1),
            (format!("{spring}{matrix}"), 1),
            (format!("{spring}{}{air}", matrix.replace("300", "150")), 0),
            (format!("{spring}100\ngain = 9\n{air}{push}"), 2),
            (format!("{rubber}{push}"), 1),
            (
                "[[effect]]\nid = 'd'\nkind = 'detents'\npositions = [0, 1]\nend_stiffness = 600\ndamping = 0.02\n"
                    .to_owned(),
                1,
            ),
        ] {
            let scene = SceneFile::from_toml(&text, "x.toml").unwrap_or_else(|error| panic!("{error}"));
            let told = warnings(&info(&scene));
            assert_eq!(told, Abilities::of(&RigConfig::prototype()).warnings(&scene), "{text}");
            assert_eq!(told.len(), count, "{text}: {told:?}");
        }
    }

    #[test]
    fn a_change_is_checked_with_the_scene_that_runs() {
        let info = info(&SceneFile::default_scene());
        let checked = |id: &str, key: &str, value: Value| {
            check(&info, id, &[(key.to_owned(), value)].into_iter().collect())
                .map_err(|error| error.to_string())
        };
        assert_eq!(checked("spring", "stiffness", json!(2)), Ok(()));
        assert_eq!(checked("spring", "deadband", json!("5 deg")), Ok(()));
        let refused = |id, key, value| checked(id, key, value).unwrap_err();
        assert!(refused("sprung", "stiffness", json!(2)).contains("legal: spring; `hbot scene show`"));
        assert!(refused("sprong", "stiffness", json!(2)).contains("(did you mean `spring`?)"));
        assert!(refused("spring", "stifness", json!(2)).contains("did you mean `stiffness`"));
        assert!(refused("spring", "stiffness", json!(-1)).contains("-1 is out of range"));
        let later = InfoOk { scene: json!({"effect": [{"id": "x", "kind": "of tomorrow"}]}), ..info.clone() };
        assert!(check(&later, "x", &Map::new()).is_ok(), "the server knows its kinds");
    }

    #[test]
    fn an_angle_is_shown_in_the_unit_in_which_it_was_typed() {
        let five = 5.0_f64.to_radians();
        for (value, typed, text) in [
            (json!(five), json!("5deg"), "5 deg"),
            (json!(five), json!("5°"), "5 deg"),
            (json!(0.5), json!("0.5 rad"), "0.5 rad"),
            (json!(0.0), json!(0), "0 rad"),
            (json!(five), json!(five), "0.0873 rad"),
            (json!([five, 1.0]), json!([five, 1]), "[0.0873, 1] rad"),
            (json!([five, 0.0]), json!(["5 deg", 0]), "[5 deg, 0 deg]"),
            (json!("geodesic"), json!("geodesic"), "\"geodesic\""),
            (json!(null), json!("5 deg"), "null"),
        ] {
            assert_eq!(shown(&value, &typed, "rad"), text, "{typed}");
        }
        assert_eq!(shown(&json!(2.0), &json!(2), ""), "2");
        for (x, text) in [(1.234, "1.234"), (1.0 / 3.0, "0.333"), (12_345.678, "12345.7")] {
            assert_eq!(short(x), text);
        }
    }

    #[test]
    fn a_number_may_have_the_unit_of_its_key() {
        let stiffness = unit("spring", "stiffness").expect("it has one");
        for (typed, value) in [
            (json!("2 N m/rad"), json!(2)),
            (json!("2.5N m/rad "), json!(2.5)),
            (json!("2 N m"), json!("2 N m")),
            (json!("N m/rad"), json!("N m/rad")),
            (json!(2), json!(2)),
        ] {
            assert_eq!(alone(&typed, &stiffness), value, "{typed}");
        }
        assert_eq!(alone(&json!("0.5 rad"), "rad"), json!("0.5 rad"), "hbot-config reads angles");
        assert_eq!(alone(&json!("2"), ""), json!("2"));
    }

    #[test]
    fn a_value_is_json_or_a_text() {
        for (text, key, value) in [
            ("stiffness=2", "stiffness", json!(2)),
            (" stiffness = 2.5 ", "stiffness", json!(2.5)),
            ("axis=[0, 0, 1]", "axis", json!([0, 0, 1])),
            ("repeat=true", "repeat", json!(true)),
            ("law=geodesic", "law", json!("geodesic")),
            ("law=\"geodesic\"", "law", json!("geodesic")),
            ("cone=35 deg", "cone", json!("35 deg")),
        ] {
            assert_eq!(assignment(text), Ok((key.to_owned(), value)), "{text}");
        }
        assert_eq!(assignment("stiffness=2,5").unwrap_err(), "write a decimal point: stiffness=2.5");
        assert!(
            assignment("stiffness=[[1,0,0],[0,2,0]").unwrap_err().contains("is a `]` or a comma missing")
        );
        for wrong in ["stiffness", "=2", "stiffness="] {
            assert!(assignment(wrong).unwrap_err().contains("KEY=VALUE"), "{wrong}");
        }
    }
}
