//! What the study `effects` found, in short.

use hbot_plot::short;

use super::{Cost, desk, not_counted};
use crate::report::Report;

/// Adds the conclusions to the report. `costs` holds first the cost of the empty setup, then of
/// each effect and phenomenon alone. `why` says why instructions were not counted, if they were
/// not.
pub(super) fn conclude(report: &mut Report, costs: &[Cost], why: Option<&String>) {
    let (none, alone) = (&costs[0], &costs[1..]);
    let (effects, phenomena): (Vec<&Cost>, Vec<&Cost>) =
        alone.iter().partition(|cost| desk::is_kind(&cost.setup.name()));
    let hidden = alone.iter().filter(|cost| !cost.longer.is_found()).count();
    let hidden = format!(
        "Of {} times that an effect or phenomenon adds, {hidden} are not larger than their spread. They are no findings, and are given as \"below N ns\".",
        alone.len()
    );
    let time = format!(
        "{} ns, half of the runs within {} to {}",
        short(none.time.median),
        short(none.time.q1),
        short(none.time.q3)
    );
    let Some(base) = none.instructions else {
        let longest = phenomena.iter().max_by(|a, b| a.longer.median.total_cmp(&b.longer.median));
        let longest = longest.map_or(String::new(), |cost| {
            format!(
                "The most expensive phenomenon of the simulated rig is {}: {}.",
                cost.setup.name(),
                cost.longer.told()
            )
        });
        let why = not_counted(why.map_or("", String::as_str));
        report.in_short(
            "effects_ns",
            [why, format!("A tick without any effect takes {time}."), longest, hidden],
        );
        return;
    };
    let more = |cost: &Cost| cost.instructions.unwrap_or(base) - base;
    let ends = |of: &[&Cost]| {
        let told = |cost: Option<&&Cost>| {
            cost.map_or(String::new(), |cost| format!("{:.0} ({})", more(cost), cost.setup.name()))
        };
        let order = |a: &&&Cost, b: &&&Cost| more(a).total_cmp(&more(b));
        (
            told(of.iter().min_by(order)),
            told(of.iter().max_by(order)),
            of.iter().copied().map(more).fold(0.0, f64::max) / base,
        )
    };
    let (least, most, share) = ends(&effects);
    let (least_of_rig, most_of_rig, times) = ends(&phenomena);
    let left = report.value("effects_dropped_left");
    report.in_short(
        "effects_instructions",
        [
            format!("A tick without any effect takes {base:.0} instructions, which are the same in every run, and {time}."),
            format!("An effect alone adds {least} to {most} instructions a tick, at most {:.0} % of that tick.", 100.0 * share),
            format!("A phenomenon of the simulated rig adds {least_of_rig} to {most_of_rig} instructions, up to {times:.1} times that tick."),
            format!("What a scene has dropped leaves at most {left:.1e} of a tick's instructions."),
            hidden,
        ],
    );
}
