//! `hbot scene kinds`: lists the kinds of effects and the phenomena that a scene can contain.

use hbot_config::scene::{Listed, kinds, phenomena};
use serde_json::json;

use super::{say, style, tell, unknown};

pub(super) fn run(only: Option<&str>, as_json: bool) -> anyhow::Result<()> {
    if as_json {
        say!("{}", json!({"effects": kinds(), "phenomena": phenomena()}))?;
        return Ok(());
    }
    if let Some(name) = only {
        let all: Vec<Listed> = kinds().into_iter().chain(phenomena()).collect();
        let Some(listed) = all.iter().find(|listed| listed.name == name) else {
            let legal: Vec<&str> = all.iter().map(|listed| listed.name).collect();
            return Err(unknown(name, "no kind and no phenomenon", &legal));
        };
        return describe(listed);
    }
    let [kinds, phenomena] = [kinds(), phenomena()];
    let width = widest(kinds.iter().chain(&phenomena).map(|listed| listed.name));
    let summarize = |listed: &Listed| summarize(listed, width);
    kinds.iter().try_for_each(summarize)?;
    tell!("\n{}The table [simulate], for the simulated rig alone:{}", style::NAME, style::OFF)?;
    phenomena.iter().try_for_each(summarize)?;
    tell!("\n`hbot scene kinds KIND` shows one of them with its parameters")
}

/// Returns the width of a column with these names.
fn widest<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    names.map(str::len).max().unwrap_or_default()
}

/// Prints the name of a kind or phenomenon, `width` characters wide, and the first sentence of its
/// description.
fn summarize(listed: &Listed, width: usize) -> anyhow::Result<()> {
    let sentence = listed.description.split_inclusive(". ").next().unwrap_or_default();
    tell!("  {}{:width$}{} {}", style::GOOD, listed.name, style::OFF, sentence.trim_end())
}

fn describe(listed: &Listed) -> anyhow::Result<()> {
    tell!("{}{}{}  {}", style::GOOD, listed.name, style::OFF, listed.description)?;
    let parameters = listed.parameters();
    let width = widest(parameters.iter().map(|parameter| parameter.name.as_ref()));
    for parameter in parameters {
        tell!(
            "  {}{:width$}{} {}; default {}",
            style::NAME,
            parameter.name,
            style::OFF,
            parameter.legal,
            parameter.default
        )?;
        tell!("  {:width$} {}{}{}", "", style::DIM, parameter.description, style::OFF)?;
    }
    tell!("")
}
