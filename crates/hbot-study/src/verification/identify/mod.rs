//! The study `identify`: how well `hbot rig identify` finds the geometry of rigs that are not as
//! drawn.

mod felt;
mod hours;
mod rigs;

use hbot_config::RigConfig;
use hbot_core::{Rig, Vec3};
use hbot_identify::{What, identify};
use hbot_plot::{Lines, Series, short};
use hbot_sim::wander::{Built, Wander};

use self::rigs::{Encoders, counts, geometry, recorded, truth};
use crate::context::Context;
use crate::report::{Report, head, row};

/// The drawings, each with its name in the ids of figures, its file, and the number of random rigs
/// that are built from it.
const DRAWINGS: [(&str, &str, u64); 3] = [
    ("two_wheels", include_str!("../../../../../rigs/prototype.toml"), 20),
    ("three_wheels", include_str!("../../../../../rigs/three_wheels.toml"), 5),
    ("four_wheels", include_str!("../../../../../rigs/four_wheels.toml"), 5),
];
/// Speed of the hand about each axis, root mean square, rad/s.
const SPEED: f64 = 1.0;
/// Length of the recording, s.
const RECORDED_S: f64 = 60.0;
/// Number of turns after which the drift is judged, and the time of each, s.
const TURNS: usize = 10;
const TURN_S: f64 = 4.0;
/// Length of the recording from which the zeros alone are found, s.
const ZEROS_S: f64 = 2.0;
/// Largest drift after one turn and after ten turns with ideal encoders, rad.
const IDEAL: [f64; 2] = [0.5e-3, 2.0e-3];
/// Largest drift with real encoders, rad, beyond that of the true geometry: play deceives odometry
/// whatever the geometry.
const BEYOND_TRUTH: [f64; 2] = [0.3e-3, 1.0e-3];
/// Largest error of a zero that is found alone, rad.
const ZERO: f64 = 0.3e-3;
/// Largest error of the stiffness in the worst direction, as a fraction.
const STIFFNESS: f64 = 0.01;
/// Bounds of the fraction of intervals that hold the truth.
const HELD: [f64; 2] = [0.90, 0.99];

/// What one rig shows.
#[derive(Debug, Default)]
struct Shown {
    /// Drift after one turn and after ten turns, as drawn and as found, rad.
    drawn: [f64; 2],
    found: [f64; 2],
    /// The same with the true geometry.
    truth: [f64; 2],
    /// Stiffness error as drawn and as found.
    stiffness: [f64; 2],
    /// Largest error of a zero that is found alone, rad.
    zero: f64,
    /// Number of intervals, and of those that hold the truth.
    intervals: [usize; 2],
}

/// Runs the study `identify` and returns its report.
pub(crate) fn study(context: &Context) -> Report {
    let mut report = Report::new("identify", context.quick);
    report.family("identify_{rig}_{encoders}_{drift}_{number} | rad | drift of the orientation after one turn and after ten turns with the geometry that was found (`one`, `ten`), without a turn of the whole frame; `drawn`: with the drawing, `truth`: with the true geometry");
    report.family("identify_{rig}_{encoders}_stiffness_{number} | 1 | error of a stiffness in the worst direction and posture with the geometry that was found, as a fraction; `drawn`: with the drawing");
    report.family("identify_{encoders}_held | 1 | fraction of the 95 % intervals that hold the truth");
    report.say(&format!(
        "Random rigs differ from their drawings by 0.5 degrees in axes, cones, toes and zeros and by 1 % in radii (standard deviations). A hand turns the sphere for {RECORDED_S} s about all axes with {SPEED} rad/s about each (root mean square); \
         `hbot rig identify` then finds the geometry in the counts. The drift is that of ten turns about axes at random, by the method `midpoint` at 1 kHz, against the exact orientation. *ideal*: encoders that only round to counts, {} at the motor. *real*: also half a degree of play in the drives, and encoder discs \
         off centre by 0.5 mrad.",
        16384
    ));
    context.expect(4);
    let mut lines = Vec::new();
    let mut sentences = Vec::new();
    for (k, (name, encoders)) in
        [("ideal", Encoders::IDEAL), ("real", Encoders::REAL)].into_iter().enumerate()
    {
        context.part(name);
        let mut table = vec![head(
            "rig | one turn, mrad | ten turns | ten with the truth | ten as drawn | stiffness error | as drawn | zeros in 2 s, mrad",
        )];
        let mut worst = Shown::default();
        let mut beyond = [0.0_f64; 2];
        let mut points = Vec::new();
        let mut drawn = Vec::new();
        for (rig_name, file, count) in DRAWINGS {
            let config =
                RigConfig::from_toml(file, rig_name).unwrap_or_else(|e| unreachable!("a legal rig: {e}"));
            let count = if context.quick { 1 } else { count };
            for seed in 0..count {
                let shown = one(&config.rig, 1000 + seed, encoders);
                let id = |what: &str| format!("identify_{rig_name}_{name}_{what}_{seed}");
                for (what, i) in [("one", 0), ("ten", 1)] {
                    let (found, truth) = (shown.found[i], shown.truth[i]);
                    report.figure(id(what), found).note("drawn", shown.drawn[i]).note("truth", truth);
                    worst.found[i] = worst.found[i].max(found);
                    worst.truth[i] = worst.truth[i].max(truth);
                    beyond[i] = beyond[i].max(found - truth);
                }
                report.figure(id("stiffness"), shown.stiffness[1]).note("drawn", shown.stiffness[0]);
                worst.stiffness[1] = worst.stiffness[1].max(shown.stiffness[1]);
                worst.zero = worst.zero.max(shown.zero);
                worst.intervals[0] += shown.intervals[0];
                worst.intervals[1] += shown.intervals[1];
                points.push((points.len() as f64, shown.found[1]));
                drawn.push((drawn.len() as f64, shown.drawn[1]));
                table.push(row([
                    format!("{rig_name} {seed}"),
                    short(1e3 * shown.found[0]),
                    short(1e3 * shown.found[1]),
                    short(1e3 * shown.truth[1]),
                    short(1e3 * shown.drawn[1]),
                    format!("{:.3} %", 100.0 * shown.stiffness[1]),
                    format!("{:.1} %", 100.0 * shown.stiffness[0]),
                    if shown.zero.is_finite() { short(1e3 * shown.zero) } else { "not found".to_owned() },
                ]));
            }
        }
        let held = worst.intervals[1] as f64 / worst.intervals[0].max(1) as f64;
        report.figure(format!("identify_{name}_held"), held);
        report.heading(&format!("Encoders: {name}"));
        report.table(&table);
        for (i, turns) in ["one turn", "ten turns"].into_iter().enumerate() {
            match name {
                "ideal" => {
                    report.check_within(
                        &format!("ideal: drift after {turns}, mrad,"),
                        1e3 * worst.found[i],
                        1e3 * IDEAL[i],
                    );
                }
                _ => report.check_within(
                    &format!("{name}: drift after {turns} beyond that of the true geometry, mrad,"),
                    1e3 * beyond[i],
                    1e3 * BEYOND_TRUTH[i],
                ),
            }
        }
        report.check_within(
            &format!("{name}: error of the stiffness, %,"),
            100.0 * worst.stiffness[1],
            100.0 * STIFFNESS,
        );
        if k == 0 {
            report.check_within("ideal: zeros from 2 s of motion, mrad,", 1e3 * worst.zero, 1e3 * ZERO);
            lines.push(("drawn", drawn));
        }
        let [least, most] = HELD;
        report.check(
            format!(
                "{name}: {:.0} to {:.0} % of the 95 % intervals hold the truth",
                100.0 * least,
                100.0 * most
            ),
            format!("{:.1} % of {}", 100.0 * held, worst.intervals[0]),
            // A quick run has too few intervals for the upper bound.
            held >= least && (held <= most || context.quick),
        );
        sentences.push(format!(
            "With {name} encoders the orientation drifts by at most {} mrad in ten turns ({} mrad with the true geometry), and a stiffness is wrong by at most {} %.",
            short(1e3 * worst.found[1]),
            short(1e3 * worst.truth[1]),
            short(100.0 * worst.stiffness[1])
        ));
        if k == 0 {
            sentences.push(format!(
                "Two seconds of motion show the zeros of a rig that was identified before to {} mrad.",
                short(1e3 * worst.zero)
            ));
        }
        lines.push((name, points));
    }
    let series = lines.into_iter().zip(0..).map(|((name, points), k)| Series::new(name, points, k)).collect();
    report.heading("All rigs");
    report.lines(
        "identify_drift",
        "Drift after ten turns of each rig, as drawn and as found with ideal and real encoders",
        Lines::new("Drift after ten turns", "rig", "drift, rad", series).log([false, true]),
    );
    report.in_short("identify_drift", sentences);
    context.part("table III");
    felt::study(context, &mut report);
    context.part("a reference from outside");
    hours::study(context, &mut report);
    report
}

/// Identifies a random rig and judges the result.
fn one(rig: &Rig, seed: u64, encoders: Encoders) -> Shown {
    let built = Built::new(&rig.device, seed).unwrap_or_else(|e| unreachable!("near the drawing: {e}"));
    let seen = |wander: &Wander, seconds: f64| counts(rig, &built, wander, seconds, encoders, seed);
    let hand = |seed: u64| Wander::new(seed, Vec3::splat(SPEED));
    let (recording, _) = seen(&hand(seed), RECORDED_S);
    let found = identify(rig, &recorded(recording), What::Geometry, &mut |_, _| ());
    let found = found.unwrap_or_else(|why| unreachable!("a good recording: {why}"));
    let (truth, ours) = (truth(rig, &built), geometry(rig, &found.wheels, &found.zeros));
    let drawn = geometry(
        rig,
        &rig.device.wheels().iter().map(|w| *w.spec()).collect::<Vec<_>>(),
        &vec![0.0; built.zeros.len()],
    );
    let (judged, real) = seen(&Wander::turns(seed, TURNS, TURN_S), TURNS as f64 * TURN_S);
    let method = hbot_core::design::rig::OdometryMethod::Midpoint;
    let marks = [real.len() / TURNS, real.len() - 1];
    let drift = |geometry: &hbot_identify::compare::Geometry| {
        let computed = geometry.orientations(rig, method, &judged);
        let drift = geometry.drift(&truth, &computed, &real);
        marks.map(|mark| drift[mark])
    };
    let mut shown = Shown {
        drawn: drift(&drawn),
        found: drift(&ours),
        truth: drift(&truth),
        stiffness: [drawn.stiffness_error(&truth), ours.stiffness_error(&truth)],
        ..Shown::default()
    };
    let (all, held) = rigs::intervals(&found, &built);
    shown.intervals = [all, held];
    // The zeros are lost with the power. The rig as identified finds them again.
    let begun = rig.with(|parts| parts.device = built.device).unwrap_or(*rig);
    let (short, _) = seen(&hand(seed + 900), ZEROS_S);
    if let Ok(zeros) = identify(&begun, &recorded(short), What::Zeros, &mut |_, _| ()) {
        let off = zeros.zeros.iter().zip(&truth.zeros).map(|(a, b)| (a - b).abs());
        shown.zero = off.fold(0.0, f64::max);
    } else {
        shown.zero = f64::INFINITY;
    }
    shown
}
