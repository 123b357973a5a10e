//! Checks the values of one wheel against each other.

use hbot_core::design::rig as core;

use super::file;
use super::settings::Protocol;
use crate::document::Report;

/// A steering axis is refused if all its components are smaller than this, because it then has no
/// usable direction.
const LEAST_AXIS: f64 = 1.0e-9;

/// Checks the values of one wheel against each other, and adds mistakes to the report. If
/// `protocol` is `None`, the values that depend on the protocol are not checked.
pub(super) fn check_wheel(wheel: &file::Wheel, protocol: Option<Protocol>, path: &str, report: &mut Report) {
    if wheel.axis.iter().all(|x| x.abs() < LEAST_AXIS) {
        report.push(
            &format!("{path}.axis"),
            "the axis has no direction",
            "[x, y, z], not all zero".to_owned(),
        );
    }
    for (name, joint) in [("steer", &wheel.steer), ("drive", &wheel.drive)] {
        let at = |key: &str| format!("{path}.{name}.{key}");
        if let Some(protocol) = protocol {
            check_controller(joint, protocol, &at, report);
        }
        if joint.motor {
            for (key, value) in [("peak", joint.peak), ("continuous", joint.continuous)] {
                if value.is_none() {
                    report.push(
                        &at(key),
                        "missing",
                        "a number, > 0 and <= 1000 N m; or motor = false".to_owned(),
                    );
                }
            }
        }
        if !joint.cogging.is_empty() && joint.gear.fract() != 0.0 {
            let message =
                format!("cogging repeats with the turns of the encoder, and gear is {}", joint.gear);
            report.push(&at("cogging"), message, "a whole gear, or no cogging".to_owned());
        }
        // An absent `peak` counts as 0, which is legal for a joint without motor. For a joint with
        // a motor it was reported above.
        let peak = joint.peak.unwrap_or(0.0);
        let continuous = joint.continuous.unwrap_or(peak);
        let stated = core::Joint { peak, continuous, ..joint.encoder(protocol.unwrap_or(Protocol::Hbot)) };
        // The counts of a turn depend on the protocol.
        let known = |mistake: &core::RigError| protocol.is_some() || mistake.field != "counts";
        for mistake in stated.mistakes().filter(known) {
            let core::RigError { field, value, range, .. } = mistake;
            let (key, message) = match field {
                "counts" => {
                    let gear = joint.gear;
                    ("gear", format!("{gear} times counts_per_turn is {value} counts a turn of the joint"))
                }
                "continuous" => (field, format!("{value} is more than peak")),
                _ => (field, format!("{value} is out of range")),
            };
            report.push(&at(key), message, range.to_string());
        }
    }
}

/// Checks the keys of a joint that depend on the protocol of its controller. `at` returns the path
/// of a key.
fn check_controller(
    joint: &file::Joint,
    protocol: Protocol,
    at: &dyn Fn(&str) -> String,
    report: &mut Report,
) {
    check_counts(joint, protocol, &at("counts_per_turn"), report);
    check_id(joint, protocol, &at("controller"), report);
    if protocol.ids().is_some() && joint.zero == core::Zero::Index {
        let message = format!("controllers that speak {} report no index", protocol.name());
        report.push(&at("zero"), message, "\"absolute\", \"assume\" or \"calibrate\"".to_owned());
    }
}

/// Checks who counts the turns of an encoder: the file says it, or the protocol.
fn check_counts(joint: &file::Joint, protocol: Protocol, at: &str, report: &mut Report) {
    match (joint.counts_per_turn, protocol.counts_per_turn()) {
        (None, None) => {
            let core::Range { least, most, .. } = core::legal::COUNTS_PER_TURN;
            report.push(at, "missing", format!("a whole number, {least} to {most}"));
        }
        (Some(counts), Some(fixed)) if counts != fixed => {
            let name = protocol.name();
            let message = format!("{counts} counts a turn, and controllers that speak {name} report turns");
            report.push(at, message, format!("{fixed}; best leave it out"));
        }
        _ => {}
    }
}

/// Checks the id of a controller where the protocol has ids.
fn check_id(joint: &file::Joint, protocol: Protocol, at: &str, report: &mut Report) {
    let Some(ids) = protocol.ids() else { return };
    let too = if joint.motor { "" } else { "; its encoder is read there, also without a motor" };
    let words = || format!("the id of its controller on the bus, {} to {}{too}", ids.start(), ids.end());
    match joint.controller {
        None => report.push(at, "missing", words()),
        Some(id) if !ids.contains(&id) => {
            report.push(
                at,
                format!("{id} is no id of a controller that speaks {}", protocol.name()),
                words(),
            );
        }
        Some(_) => {}
    }
}
