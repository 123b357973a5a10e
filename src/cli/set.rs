//! `hbot set`: changes parameters of an effect while a server renders it.

use std::process::ExitCode;

use clap::Args;
use hbot_api::InfoOk;
use serde_json::{Map, Value};

use super::out::{foreign, say};
use super::{Commanding, orders, style};

/// Options of `hbot set`.
#[derive(Debug, Args)]
pub(crate) struct SetArgs {
    /// Id of the effect in the running scene, such as `spring`
    effect: String,
    /// Parameters, such as `stiffness=2`, `cone="35 deg"` or `axis=[0,0,1]`
    #[arg(required = true, value_name = "KEY=VALUE", value_parser = assignment)]
    values: Vec<(String, Value)>,
    #[command(flatten)]
    to: Commanding,
}

/// Parses `KEY=VALUE`. A value that is no JSON is a text, so that texts need no quotes.
fn assignment(text: &str) -> Result<(String, Value), String> {
    let (key, value) = text.split_once('=').ok_or("KEY=VALUE, such as stiffness=2")?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || value.is_empty() {
        return Err("KEY=VALUE, such as stiffness=2".to_owned());
    }
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
    Ok((key.to_owned(), value))
}

pub(crate) fn run(args: &SetArgs) -> anyhow::Result<ExitCode> {
    let mut client = orders::connect(&args.to.address, "hbot set")?;
    let parameters: Map<String, Value> = args.values.iter().cloned().collect();
    let before = effect(&client.info().map_err(orders::remedied)?, &args.effect);
    orders::holding(&mut client, args.to.steal, |client| client.set(&args.effect, parameters.clone()))?;
    let info = client.info().map_err(orders::remedied)?;
    let after = effect(&info, &args.effect);
    for key in parameters.keys() {
        say!(
            "{}{}{}: {} = {} (before: {})",
            style::NAME,
            args.effect,
            style::OFF,
            key,
            foreign(&after[key].to_string()),
            foreign(&before[key].to_string())
        )?;
    }
    if let Some(warning) = unstable(&info, &after) {
        say!("  {}warning:{} {warning}", style::WARN, style::OFF)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the effect with the id `id` in the running scene, or null if there is none.
fn effect(info: &InfoOk, id: &str) -> Value {
    let mut effects = info.scene["effect"].as_array().into_iter().flatten();
    effects.find(|effect| effect["id"] == id).cloned().unwrap_or_default()
}

/// Returns a warning if the rig cannot keep the stiffness of the effect stable with any damping.
fn unstable(info: &InfoOk, effect: &Value) -> Option<String> {
    let most = info.render.as_ref()?.stiffness_most;
    let stiffness = largest(&effect["stiffness"])?;
    (stiffness > most).then(|| {
        format!("{stiffness} N m/rad is unstable on this rig with any damping: it keeps at most {most:.0}")
    })
}

/// Returns the largest number of a value: of a stiffness itself, or of the matrix of one.
fn largest(value: &Value) -> Option<f64> {
    match value {
        Value::Array(rows) => rows.iter().filter_map(largest).max_by(f64::total_cmp),
        number => number.as_f64(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

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
        for wrong in ["stiffness", "=2", "stiffness="] {
            assert!(assignment(wrong).unwrap_err().contains("KEY=VALUE"), "{wrong}");
        }
    }
}
