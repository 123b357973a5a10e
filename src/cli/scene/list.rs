//! `hbot scene list`: what a scene can be made of.

use hbot_config::scene::{Listed, kinds, phenomena};
use serde_json::json;

use super::style;

pub(super) fn run(as_json: bool) -> anyhow::Result<()> {
    if as_json {
        anstream::println!("{}", json!({"effects": kinds(), "phenomena": phenomena()}));
        return Ok(());
    }
    for kind in kinds() {
        describe(&kind);
    }
    anstream::println!("{}The table [simulate], for the simulated rig alone:{}\n", style::NAME, style::OFF);
    for phenomenon in phenomena() {
        describe(&phenomenon);
    }
    Ok(())
}

fn describe(listed: &Listed) {
    anstream::println!(
        "{}{}{}  {}",
        style::GOOD,
        listed.name,
        style::OFF,
        listed.description.replace('\n', " ")
    );
    for parameter in listed.parameters() {
        anstream::println!(
            "  {}{:14}{} {}; default {}",
            style::NAME,
            parameter.name,
            style::OFF,
            parameter.legal,
            parameter.default
        );
        anstream::println!("  {:14} {}{}{}", "", style::DIM, parameter.description, style::OFF);
    }
    anstream::println!();
}
