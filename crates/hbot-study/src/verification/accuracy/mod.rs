//! The study `accuracy`: what accuracy costs, for each stage and for the whole tick.

mod allocation;
mod caster;
mod kinematics;
mod motions;
mod order;
mod plant;
mod segments;
mod short;
mod sliding;
mod spring;
mod tick;
mod velocity;

use super::callgrind::Counter;
use crate::context::Context;
use crate::report::Report;
use crate::whole::prototype;
pub(super) use tick::job;

/// Rates at which the joints are read when the drift of odometry is measured, Hz.
const RATES: [u32; 5] = [500, 1000, 2000, 4000, 8000];
/// Duration of the motion over which the drift of odometry is measured, s.
const DRIFT_S: f64 = 0.6;

/// Runs a block of code twice: once with the stages of the computation in f64, and once in f32. In
/// the block, the given name stands for the module with these stages.
macro_rules! in_both_widths {
    ($stages:ident => $body:block) => {{
        {
            use crate::verification::double::stages as $stages;
            $body
        }
        {
            use crate::verification::single::stages as $stages;
            $body
        }
    }};
}
use in_both_widths;

/// Runs the study `accuracy` and returns its report.
pub(crate) fn study(context: &Context, counter: Option<&Counter>) -> Report {
    let mut report = Report::new("accuracy", context.quick);
    let rig = prototype(&[]).rig;
    context.expect(16);
    report.say(
        "What each choice of method costs in time and brings in accuracy, on this machine. Where a plot has time and error on its \
         axes, the front is marked: what is not on it is beaten, in both, by something that is. Errors are against adaptive \
         references at 1e-12 or better; the device is the prototype (`rigs/prototype.toml`) where nothing else is said.",
    );
    let times = motions::times(context, &mut report, &rig.device);
    segments::study(context, &mut report, &rig.device, &times);
    motions::study(context, &mut report, &rig, &times);
    caster::study(context, &mut report, &rig.device);
    plant::study(context, &mut report, &rig.device);
    sliding::study(context, &mut report, &rig.device);
    spring::study(context, &mut report);
    allocation::study(context, &mut report, &rig.device);
    kinematics::study(context, &mut report);
    velocity::study(context, &mut report, &rig);
    let ticks = tick::study(context, &mut report, counter);
    short::conclude(&mut report, &ticks);
    report
}

/// Returns the median of `values`. For an even number of values it is the upper of the middle two.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Formats a number for a table, with two significant digits.
fn sci(value: f64) -> String {
    format!("{value:.1e}")
}
