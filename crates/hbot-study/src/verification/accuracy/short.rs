//! What the study `accuracy` found, in short.

use super::sci;
use super::tick::Found;
use crate::report::Report;

/// Adds the conclusions to the report. `ticks` are the whole ticks with each method, `fast` first.
pub(super) fn conclude(report: &mut Report, ticks: &[Found]) {
    let error = |name: &str| sci(report.value(&format!("tick_{name}_error_rad")));
    let part = |name: &str, part: &str| sci(report.value(&format!("tick_{name}_{part}_part_rad")));
    let errors = format!(
        "In 10 s of brisk motion at 1 kHz the orientation errs by {} rad with `fast`, {} with `balanced` and {} with `exact`. Rounding to the prototype's counts alone makes {}.",
        error("fast"),
        error("balanced"),
        error("exact"),
        part("balanced", "counts")
    );
    let finer = format!(
        "With exact readings `balanced` would err by {} rad and `exact` by {}: a better method pays where the encoders are finer.",
        part("balanced", "method_and_path"),
        part("exact", "method_and_path")
    );
    let cost = |name: &str| {
        ticks.iter().find(|found| found.name == name).map_or(String::new(), |found| more(found, &ticks[0]))
    };
    let first = match ticks[0].instructions {
        Some(count) => format!("{count:.0} instructions"),
        None => "an amount of instructions that could not be counted here".to_owned(),
    };
    let costs = format!(
        "A tick with `fast` takes {first}, {:.0} ns in the median. `balanced` takes {} more, `exact` {}.",
        report.value("tick_fast_ns"),
        cost("balanced"),
        cost("exact")
    );
    let rest = format!(
        "In f32, magnus4 at constant joint rates errs by {} rad in 0.6 s at 1 kHz. The simulated rig's plant errs by {} rad by rk4 at 1 ms.",
        sci(report.value("odometry_segments_magnus4_f32_1000hz_drift_rad")),
        sci(report.value("plant_rk4_1000us_error_rad"))
    );
    report.in_short("tick", [errors, finer, costs, rest]);
}

/// Returns what a tick costs more than the tick `than`: instructions, if they were counted, and
/// time.
fn more(found: &Found, than: &Found) -> String {
    let time = found.longer.told();
    match (found.instructions, than.instructions) {
        (Some(count), Some(less)) => format!("{:.0} instructions ({time})", count - less),
        _ => time,
    }
}
