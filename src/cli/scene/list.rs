//! `hbot scene list`: lists the kinds of effects and the phenomena that a scene can contain.

use hbot_config::scene::{Listed, kinds, phenomena};
use serde_json::json;

use super::{say, style};

pub(super) fn run(as_json: bool) -> anyhow::Result<()> {
    if as_json {
        say!("{}", json!({"effects": kinds(), "phenomena": phenomena()}))?;
        return Ok(());
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
    say!("{}{}{}  {}", style::GOOD, listed.name, style::OFF, listed.description.replace('\n', " "))?;
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
