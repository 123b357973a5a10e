//! `hbot scene kinds`: lists the kinds of effects and the phenomena that a scene can contain.

use anyhow::bail;
use hbot_config::scene::{Listed, kinds, phenomena};
use serde_json::json;

use super::{say, style};

pub(super) fn run(only: Option<&str>, as_json: bool) -> anyhow::Result<()> {
    if as_json {
        say!("{}", json!({"effects": kinds(), "phenomena": phenomena()}))?;
        return Ok(());
    }
    if let Some(name) = only {
        let all: Vec<Listed> = kinds().into_iter().chain(phenomena()).collect();
        let Some(listed) = all.iter().find(|listed| listed.name == name) else {
            let legal: Vec<&str> = all.iter().map(|listed| listed.name).collect();
            bail!("{name:?} is no kind and no phenomenon; legal: {}", legal.join(", "));
        };
        return describe(listed);
    }
    for kind in kinds() {
        describe(&kind)?;
    }
    say!("{}The table [simulate], for the simulated rig alone:{}\n", style::NAME, style::OFF)?;
    for phenomenon in phenomena() {
        describe(&phenomenon)?;
    }
    Ok(())
}

fn describe(listed: &Listed) -> anyhow::Result<()> {
    say!("{}{}{}  {}", style::GOOD, listed.name, style::OFF, listed.description)?;
    for parameter in listed.parameters() {
        say!(
            "  {}{:14}{} {}; default {}",
            style::NAME,
            parameter.name,
            style::OFF,
            parameter.legal,
            parameter.default
        )?;
        say!("  {:14} {}{}{}", "", style::DIM, parameter.description, style::OFF)?;
    }
    say!("")
}
