//! The rigs under test: the prototype with the motor controllers of each protocol.

use hbot_config::rig::Protocol;
use hbot_config::{Override, RigConfig};
use serde_json::json;

use crate::Outcome;

pub(crate) fn protocol(name: &str) -> Outcome<Protocol> {
    let all = [Protocol::Hbot, Protocol::Moteus, Protocol::Odrive];
    let found = all.into_iter().find(|protocol| protocol.name() == name);
    Ok(found.ok_or(format!("{name}: legal protocols are hbot, moteus and odrive"))?)
}

/// Returns the text of the rig file for `protocol`. All joints are on one line, because a simulated
/// rig has only one.
pub(crate) fn text(protocol: Protocol) -> String {
    let text = match protocol {
        Protocol::Hbot => include_str!("../../../rigs/prototype.toml"),
        Protocol::Moteus => include_str!("../../../rigs/prototype-moteus.toml"),
        Protocol::Odrive => include_str!("../../../rigs/prototype-odrive.toml"),
    };
    let of_joint = |line: &&str| ["port = 0", "port = 1"].iter().any(|port| line.starts_with(port));
    text.lines().filter(|line| !of_joint(line)).map(|line| format!("{line}\n")).collect()
}

/// Returns the rig as the server reads it if `--port` names a serial device.
pub(crate) fn on_device(protocol: Protocol) -> Outcome<RigConfig> {
    let port = Override { path: "link.port", value: json!("device"), from: "--port" };
    Ok(RigConfig::from_toml_with(&text(protocol), protocol.name(), &[port])?)
}
