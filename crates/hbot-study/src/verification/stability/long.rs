//! Long runs: conserved quantities must stay constant over a simulated day.

use std::time::Instant;

use hbot_core::{Device, Quat, Vec3, rotation};
use hbot_plot::short;
use hbot_sim::plant::{Method, Plant, PlantState, SpringDamper};

use crate::report::Report;
use crate::verification::double::stages::odometry::METHODS;
use crate::verification::{double, single};

/// Number of ticks in a day of simulated time at 1 kHz.
const DAY: u64 = 86_400_000;
/// Number of ticks in ten minutes of simulated time at 1 kHz, for a run with `--quick`.
const TEN_MINUTES: u64 = 600_000;
/// Largest allowed deviation of the quaternion's norm |q| from 1.
const UNIT: f64 = 1.0e-12;
/// Largest allowed gain of energy by a swing, relative to its initial energy.
///
/// It is several times the error of rk4 within one swing, 2e-8, which does not accumulate. Rounding
/// in 1e8 steps would gain as much if all rounding errors had the same sign.
const GAIN: f64 = 1.0e-7;

/// How far conserved quantities changed while the ideal plant was simulated for a day.
pub(super) struct Day {
    ticks: u64,
    seconds: f64,
    /// Largest deviation of the quaternion's norm |q| from 1.
    unit: f64,
    /// Largest energy at any time, relative to the initial energy.
    most: f64,
    /// Smallest energy at any time, relative to the initial energy.
    least: f64,
}

/// Simulates a day of the ideal plant, which swings on an undamped spring, in steps of 1 ms. With
/// `--quick` it is ten minutes.
pub(super) fn day(quick: bool, plant: &Plant) -> Day {
    let spring = SpringDamper { stiffness: 1.0, damping: 0.0, reference: Quat::IDENTITY };
    let energy = |s: &PlantState| plant.energy(s) + 0.5 * rotation::log(s.q).length_squared();
    let mut state = PlantState { q: rotation::exp(Vec3::new(0.6, -0.4, 0.3)), ..PlantState::default() };
    let start = energy(&state);
    let ticks = if quick { TEN_MINUTES } else { DAY };
    let started = Instant::now();
    let (mut unit, mut most, mut least) = (0.0_f64, 1.0_f64, 1.0_f64);
    for k in 0..ticks {
        plant.step(Method::Rk4, &mut state, k as f64 * 1.0e-3, 1.0e-3, &[0.0; 16], &spring);
        if k % 64 == 63 {
            unit = unit.max((state.q.length() - 1.0).abs());
            let now = energy(&state) / start;
            (most, least) = (most.max(now), least.min(now));
        }
    }
    Day { ticks, seconds: started.elapsed().as_secs_f64(), unit, most, least }
}

pub(super) fn study(quick: bool, report: &mut Report, device: &Device, day: &Day) {
    report.heading("A day, and a hundred million ticks");
    let hours = day.ticks as f64 / 3.6e6;
    report.say(&format!(
        "The ideal plant swings on a spring without damping for {} h of simulated time, {} ticks of 1 ms by rk4, in {:.1} s beside the rest of this study. Where it is after so long \
         nobody can say (the caster's sensitivity, `hbot-study accuracy`); what it conserves can be told: |q| stays 1 to {:.1e}, and the energy, looked at every 64 ticks, stays between {:.9} and {:.9} of what it \
         began with: rk4 errs to either side within a swing, and slowly takes energy out of it.",
        short(hours), day.ticks, day.seconds, day.unit, day.least, day.most
    ));
    report.family("long_day_ticks | 1 | ticks of 1 ms of the ideal plant");
    report.family("long_day_seconds | s | computing for them");
    report.family("long_day_unit_norm | 1 | largest ||q| - 1| on the way");
    report.family(
        "long_day_energy_{which} | 1 | largest (most) and least energy on the way, over that at the start",
    );
    report.family(
        "long_odometry_{method}_{width}_unit_norm | 1 | largest ||q| - 1| of so many ticks of odometry",
    );
    report.figure("long_day_ticks".to_owned(), day.ticks as f64);
    report.figure("long_day_seconds".to_owned(), day.seconds);
    report.figure("long_day_unit_norm".to_owned(), day.unit);
    report.figure("long_day_energy_most".to_owned(), day.most);
    report.figure("long_day_energy_least".to_owned(), day.least);
    report.check(
        format!("a day: the quaternion is unit to {UNIT:e}"),
        format!("{:.1e}", day.unit),
        day.unit <= UNIT,
    );
    report.check(
        format!("a day: the energy never grows by more than {GAIN:e}"),
        format!("{:+.1e}", day.most - 1.0),
        day.most - 1.0 <= GAIN,
    );
    if !quick && !cfg!(debug_assertions) {
        report.check("a day takes less than 180 s", format!("{:.0} s", day.seconds), day.seconds < 180.0);
    }
    odometry(quick, report, device);
}

fn odometry(quick: bool, report: &mut Report, device: &Device) {
    let ticks = if quick { 2_000_000 } else { 100_000_000 };
    let narrow_device = single::stages::device(device);
    for (method, (name, _)) in METHODS.iter().enumerate() {
        // Only the midpoint method runs all ticks and the others a tenth of them, because they
        // share the code that keeps q unit.
        let ticks = if *name == "midpoint" { ticks } else { ticks / 10 };
        let wide = double::stages::odometry::unit_norm_after(device, method, ticks);
        let narrow = single::stages::odometry::unit_norm_after(&narrow_device, method, ticks / 10);
        report.figure(format!("long_odometry_{name}_f64_unit_norm"), wide).note("ticks", ticks);
        report.figure(format!("long_odometry_{name}_f32_unit_norm"), narrow).note("ticks", ticks / 10);
        report.check(
            format!("{ticks} ticks of odometry, {name}, f64: unit to {UNIT:e}"),
            format!("{wide:.1e}"),
            wide <= UNIT,
        );
        // Some roundings of 1.2e-7.
        report.check(
            format!("{} ticks of odometry, {name}, f32: unit to 1e-6", ticks / 10),
            format!("{narrow:.1e}"),
            narrow <= 1.0e-6,
        );
    }
}
