//! The study `stability`: how stiff a wall can be, compared with theory, and what stays constant
//! over a simulated day.

mod compliance;
mod friction;
mod given;
mod guarded;
pub(crate) mod lag;
mod linear;
mod long;
mod passive;
mod random;
mod rig;
mod scenes;
mod search;
mod short;
mod wall;

use hbot_config::RigConfig;
use hbot_core::Vec3;
use hbot_sim::plant::Plant;

use crate::context::Context;
use crate::report::{Figure, Report, row};
use crate::whole::inertia;

/// Runs the study `stability` and returns its report.
pub(crate) fn study(context: &Context) -> Report {
    let mut report = Report::new("stability", context.quick);
    let device = RigConfig::prototype().rig.device;
    let Ok(plant) = Plant::new(&device) else { unreachable!("the prototype is a plant") };
    let inertia = inertia(&device, Vec3::X);
    context.expect(9);
    report.say(&format!(
        "How stiff a virtual wall or spring may be before it buzzes, by simulation, beside the bounds of the literature (physics.md, section 9). h is the loop's \
         period, b the device's own viscous damping, B and K the wall's, D whole ticks of delay. One axis is simulated exactly, with the prototype's apparent inertia \
         about n1, {inertia:.2e} kg m², where nothing else is said; and the whole loop, controller, line and simulated rig, once."
    ));
    // The simulated day and the search take as long as everything else, so they run in parallel.
    let (day, found) = std::thread::scope(|scope| {
        let long = scope.spawn(|| (long::day(context.quick, &plant), random::measure(context.quick)));
        linear::study(context, &mut report, inertia);
        passive::study(context, &mut report);
        friction::study(context, &mut report, inertia);
        rig::study(context, &mut report);
        lag::study(context, &mut report);
        compliance::study(context, &mut report);
        guarded::study(context, &mut report);
        scenes::study(context, &mut report);
        long.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    context.part("many ticks of odometry");
    long::study(context.quick, &mut report, &device, &day);
    random::study(&mut report, &found);
    short::conclude(&mut report);
    report
}

/// Stability limit of a virtual wall on one axis, as a stiffness in N m/rad: `measured` in
/// simulation and `predicted` by the literature.
struct Border {
    id: String,
    rate: u32,
    delay: usize,
    own: f64,
    damping: f64,
    measured: f64,
    predicted: f64,
}

/// Reports a measured stability limit together with the predicted one, both in N m/rad. Returns the
/// figure, to which further properties can be added.
fn border(report: &mut Report, id: String, measured: f64, predicted: f64) -> &mut Figure {
    report.figure(id, measured).note("measured", measured).note("predicted", predicted)
}

/// Reports all stability limits as figures, and those at 1 kHz as a table. Returns the largest
/// relative difference between measured and predicted limits.
fn borders(report: &mut Report, borders: &[Border]) -> f64 {
    let mut table = vec![row(["Hz", "D", "b", "B", "measured, N m/rad", "predicted", "ratio"])];
    let mut worst = 0.0_f64;
    for Border { id, rate, delay, own, damping, measured, predicted } in borders {
        border(report, id.clone(), *measured, *predicted);
        worst = worst.max((measured / predicted - 1.0).abs());
        if *rate == 1000 {
            let numbers = [*own, *damping, *measured, *predicted, measured / predicted].map(hbot_plot::short);
            table.push(row([rate.to_string(), delay.to_string()].into_iter().chain(numbers)));
        }
    }
    report.table(&table);
    worst
}

/// Returns `x` in millionths, rounded to a whole number, for use in the id of a figure.
fn micro(x: f64) -> u32 {
    (x * 1.0e6).round() as u32
}
