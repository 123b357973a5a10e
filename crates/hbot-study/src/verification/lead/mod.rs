//! The study `lead`: what rendering the scene ahead of its reading changes: how stiff a spring may
//! be, what a wall gives out, and what late readings leave of it.

mod axis;
mod borders;
mod kinds;
mod plane;
mod wall;

use crate::context::Context;
use crate::report::Report;

/// Damping of the springs, N m s/rad.
const DAMPING: f64 = 0.01;
/// Inertia of one axis, kg m².
const INERTIA: f64 = 3.4e-3;
/// The factor that `lead = true` stands for.
const FACTOR: f64 = 1.1;

/// Runs the study `lead` and returns its report.
pub(crate) fn study(context: &Context) -> Report {
    let mut report = Report::new("lead", context.quick);
    context.expect(4);
    report.say(
        "What the lead (`lead` in `[loop]`) changes: the scene is rendered at the pose that the sphere will have when the torque acts, a lead of the factor c times the delay from a reading to its torque.",
    );
    borders::study(context, &mut report);
    plane::study(context, &mut report);
    wall::study(context, &mut report);
    kinds::study(context, &mut report);
    conclude(&mut report);
    report
}

fn conclude(report: &mut Report) {
    let pair = |id: &str| [0, 110].map(|factor| report.value(&format!("{id}_factor{factor}")));
    let [free, free_led] =
        [0, 110].map(|c| report.value(&format!("lead_border_1000hz_lag500us_factor{c}_grip0")));
    let [lost, lost_led] = pair("lead_plane_10___lost");
    let [any, any_led] = pair("lead_plane_passive_without_lag");
    let [gain, gain_led] = pair("lead_wall_stiffness100_speed20").map(|gain| 100.0 * gain);
    let found = [
        format!(
            "At 1 kHz, with motors that lag by 0.5 ms and a damping of {DAMPING} N m s/rad, a free sphere rests on springs up to {free:.1} N m/rad without the lead and up to {free_led:.0} with it.",
        ),
        format!("With a tenth of all exchanges lost it is {lost:.1} and {lost_led:.0} N m/rad."),
        format!(
            "What the lead costs: a spring that gives no energy to any hand has at most {any:.1} N m/rad without it and {any_led:.1} with it, in motors without a lag.",
        ),
        format!(
            "A wall of 100 N m/rad without damping changes the energy of a sphere that hits it at 2 rad/s by {gain:+.0} %; with the lead by {gain_led:+.0} %.",
        ),
    ];
    report.in_short("lead_plane", found);
}
