//! What the study `stability` found, in short.

use hbot_plot::short;

use super::search::RESOLUTION;
use crate::report::Report;

/// Adds the conclusions to the report.
pub(super) fn conclude(report: &mut Report) {
    let formula = format!(
        "A spring on a sampled loop is stable up to K = (b + B)/(h (1/2 + D)). Over all cases one axis is off that by {} at most and the whole loop by {}, found to {} %.",
        percent(off(report, "border_linear_", "predicted")),
        percent(off(report, "border_rig_", "predicted")),
        100.0 * RESOLUTION
    );
    let exact = format!(
        "The eigenvalues of an inertia on a spring and damper one tick late give the border of the whole loop to {:.3} %.",
        100.0 * off(report, "border_rig_", "eigenvalues")
    );
    let at_1_khz = report.value("border_rig_1000hz_damping10000");
    let size = format!(
        "At 1 kHz this is {} N m/rad for 0.01 N m s/rad of damping. Twice the rate allows twice the stiffness.",
        short(at_1_khz)
    );
    let ratios = |guard: &str| -> Vec<f64> {
        let plain =
            |id: &str| id.starts_with("border_guard_") && id.ends_with(&format!("_step1_coulomb0_{guard}"));
        let found = report.figures().iter().filter(|figure| plain(&figure.id));
        found.filter_map(|figure| Some(figure.value / figure.more.get("predicted")?.as_f64()?)).collect()
    };
    let least = ratios("on").into_iter().fold(f64::INFINITY, f64::min);
    let stage = format!(
        "With `passivity = {{ strict = true }}` a tap comes to rest on springs at least {least:.1} times as stiff, if friction and counts are small."
    );
    let given = |guard: &str| short(1.0e3 * report.value(&format!("energy_given_60_tenths_{guard}")));
    let energy = format!(
        "On a spring 6 times too stiff the motors give out {} mJ after a tap without that stage, and {} mJ with it. Over {} s of simulated time the energy of the ideal plant never grows by more than {:.1e} of it.",
        given("off"),
        given("on"),
        short(report.value("long_day_ticks") * 1.0e-3),
        report.value("long_day_energy_most") - 1.0
    );
    report.in_short("border_linear", [formula, exact, size, stage, energy]);
}

/// Returns the largest relative difference between measured stability limits and the limits by
/// `theory`, a property of the figures, over all figures whose ids begin with `start`.
fn off(report: &Report, start: &str, theory: &str) -> f64 {
    let found = report.figures().iter().filter(|figure| figure.id.starts_with(start));
    let off = |theory: f64, measured: f64| (measured / theory - 1.0).abs();
    found.filter_map(|figure| Some(off(figure.more.get(theory)?.as_f64()?, figure.value))).fold(0.0, f64::max)
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}
