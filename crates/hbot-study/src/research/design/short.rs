//! What the study `design` found, in short.

use super::space::WHEELS;
use crate::report::Report;

/// Adds the conclusions to the report.
pub(super) fn conclude(report: &mut Report) {
    let value = |id: &str| report.value(id);
    let each = |figure: &dyn Fn(usize) -> f64, decimals: usize| {
        WHEELS.map(|wheels| format!("{:.decimals$}", figure(wheels))).join(", ")
    };
    let beaten: f64 = WHEELS.iter().map(|wheels| value(&format!("design_front_{wheels}w_dominating"))).sum();
    let better = WHEELS
        .map(|wheels| value(&format!("design_front_{wheels}w_better_by")))
        .into_iter()
        .fold(0.0, f64::max);
    let prototype = if beaten > 0.0 {
        format!(
            "{beaten:.0} designs that were found beat the prototype in all four figures, the best by {:.1} % in each.",
            100.0 * (better - 1.0)
        )
    } else {
        "No design that was found beats the prototype in conditioning, torque, inertia and steering speed at once: it lies on the front of designs with two wheels.".to_owned()
    };
    let found: f64 = WHEELS.iter().map(|wheels| value(&format!("design_front_{wheels}w_designs"))).sum();
    let front = format!(
        "{found:.0} designs with 2, 3 and 4 wheels are on the three fronts: each is better than any other of its kind in something."
    );
    let of = |which: &'static str, what: &'static str| {
        move |wheels: usize| value(&format!("design_best_{wheels}w_{which}_{what}"))
    };
    let conditioning = format!(
        "The best conditioning with 2, 3 and 4 wheels is {}, and the highest peak torque {} N m.",
        each(&of("conditioning", "gci"), 2),
        each(&of("torque", "torque"), 2)
    );
    let inertia = of("inertia", "inertia");
    let inertia = format!(
        "The least inertia is {} g m², and the prototype's is {:.2}: each wheel adds its own.",
        each(&|wheels| 1.0e3 * inertia(wheels), 2),
        1.0e3 * value("design_prototype_inertia")
    );
    let slip = format!(
        "Contacts limit the torque before motors do: the prototype's slip from {:.2} N m in the worst direction, where its motors make {:.2}.",
        value("design_prototype_slip_torque"),
        value("design_prototype_torque")
    );
    report.in_short("front_conditioning_torque", [prototype, front, conditioning, inertia, slip]);
}
