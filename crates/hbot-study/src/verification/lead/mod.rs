//! The study `lead`: what rendering the scene ahead of its reading changes: how stiff a spring may
//! be, what a wall gives out, and what late readings leave of it.

mod axis;
mod borders;
mod felt;
mod kinds;
mod plane;
mod wall;

use crate::context::{Context, Interrupted};
use crate::report::Report;

/// Damping of the springs, N m s/rad.
const DAMPING: f64 = 0.01;
/// Inertia of one axis, kg m².
const INERTIA: f64 = 3.4e-3;
/// The factor that `lead = true` stands for.
const FACTOR: f64 = 1.1;

/// Runs the study `lead` and returns its report.
pub(crate) fn study(context: &Context) -> Result<Report, Interrupted> {
    let mut report = Report::new("lead", context.quick);
    context.expect(4);
    report.say(
        "What the lead (`lead` in `[loop]`) changes: the scene is rendered at the pose that the sphere will have when the torque acts, a lead of the factor c times the delay from a reading to its torque.",
    );
    borders::study(context, &mut report)?;
    plane::study(context, &mut report)?;
    wall::study(context, &mut report)?;
    felt::study(&mut report);
    kinds::study(context, &mut report)?;
    Ok(report)
}
