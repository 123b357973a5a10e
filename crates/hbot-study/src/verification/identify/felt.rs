//! What a hand feels of springs before and after identification and compensation: the paper's table
//! III on a rig with weak motors, friction and gears that lose torque, whose loop first believes
//! the drawing.

use core::f64::consts::TAU;

use hbot_config::RigConfig;
use hbot_core::design::rig::{Compensation, Friction, Imperfect};
use hbot_core::safety::mode::Mode;
use hbot_core::{Device, Quat, Vec3, rotation};
use hbot_host::commission::bringup::excite::{Ended, Excitation, excite};
use hbot_host::commission::bringup::{Truth, open};
use hbot_host::rig::last_word::Program;
use hbot_host::run_loop::StopFlag;
use hbot_identify::motors::{Measured, Sample, measure};
use hbot_identify::{What, identify};
use hbot_sim::phenomena::{Gear, Phenomena};
use hbot_sim::rig::SimulatedConfig;
use hbot_sim::wander::{Built, Wander};
use serde_json::json;

use super::rigs::{Encoders, counts, recorded};
use crate::context::Context;
use crate::fit::Fit;
use crate::report::{Report, head, row};
use crate::rng::Rng;
use crate::whole::{Whole, prototype, scene_of, spring};

/// Stiffness of the spring, N m/rad, and its damping, N m s/rad.
const STIFFNESS: f64 = 4.0;
const DAMPING: f64 = 0.02;
/// Largest loads, N m.
const LOADS: [f64; 2] = [0.1, 0.8];
/// Time in which a load goes up, down and back, s.
const LOAD_S: f64 = 6.0;
/// Number of ranges of the load in which the ways up and down are compared.
const RANGES: usize = 20;
/// Speed of the sphere at which a hand turns it freely, rad/s, and for how long, s.
const BACK_DRIVEN: f64 = 0.3;
const BACK_DRIVEN_S: f64 = 3.0;
/// Time of the soft start, s.
const START_S: f64 = 0.7;
/// Weak motors: all by this, and each by up to this in addition.
const WEAK: f64 = 0.95;
const SPREAD: f64 = 0.02;
/// Bounds for the slope after, R² after, the part of the hysteresis that is left, and
/// the torque that turns the sphere, N m.
const SLOPE: f64 = 0.01;
const R2: f64 = 0.999;
const LEFT: f64 = 33.3; // %
const BACK: f64 = 1.5e-3;

/// What a hand feels, the worst of the axes.
#[derive(Debug, Clone, Copy)]
struct Felt {
    /// Error of the stiffness as a fraction, for each load.
    slope: [f64; 2],
    /// Least R² of the lines.
    r2: f64,
    /// Difference of the torque between the ways up and down, for each load, N m.
    hysteresis: [f64; 2],
    /// The same for the larger load, with less than half of it, N m.
    middle: f64,
    /// Torque that turns the sphere without a spring, N m.
    back: f64,
    active: bool,
}

/// A rig as it is, and as the loop can believe it.
struct Rigs {
    drawing: RigConfig,
    truth: RigConfig,
    phenomena: Phenomena,
    identified: RigConfig,
    measured: Measured,
}

/// Adds the section about springs to the report of the study.
pub(super) fn study(context: &Context, report: &mut Report) {
    report.family("identify_table3_{gear}_{believed}_{felt}_{number} | see the name | what a hand feels of a spring of 4 N m/rad, worst axis: `slope` (fraction) and `hysteresis` (N m) at 0.8 N m, `small_hysteresis` at 0.1 N m, `back` (N m): torque that turns the free sphere");
    report.heading("Table III: springs before and after");
    report.say(&format!(
        "The prototype with random geometry, motors that make {WEAK} of the torque that they are commanded (each within ±{SPREAD}), Coulomb and viscous friction in each joint and in the cage. A load about n1, n2 and n3 rises, falls and reverses within {LOAD_S} s on a spring of {STIFFNESS} N m/rad. *drawn*: the loop believes the drawing. *identified*: `rig identify` has found the geometry in 60 s of turns by hand, and `rig identify --motors` the rest in 60 s; friction is fed forward with the defaults: a part of 0.85, and a smoothing of 0.005 rad/s. *loss*: each drive's gear also loses 10 % of the torque that it passes on, and has half a degree of play. At rest nothing makes up for the loss, so near the largest load, where the sphere turns back, all of it stays; *middle*: hysteresis with less than half of the load."
    ));
    let mut table = vec![head(
        "rig | loop believes | slope error at 0.1 N m | at 0.8 N m | least R² | hysteresis at 0.1 N m, mN m | at 0.8 N m | at 0.8 N m, middle | back-driving, mN m",
    )];
    let mut motors = vec![head(
        "rig | torque constants, largest error | Coulomb, largest error | intervals that hold the truth",
    )];
    let count = if context.quick { 1 } else { 3 };
    let mut worst: Option<(Felt, Felt)> = None;
    let mut constants = 0.0_f64;
    let mut held = [0.0; 2];
    for (name, gear) in [("plain", None), ("loss", Some(Gear::default()))] {
        for seed in 0..count {
            let rigs = Rigs::new(2000 + seed, gear);
            let label = format!("{name} {seed}");
            let drawn = felt(&rigs, &rigs.drawing);
            table.push(told(&label, "drawing", &drawn));
            let after = felt(&rigs, &rigs.identified);
            table.push(told(&label, "identified", &after));
            for (believed, felt) in [("drawn", &drawn), ("identified", &after)] {
                let mut figure = |what: &str, value: f64| {
                    report.figure(format!("identify_table3_{name}_{believed}_{what}_{seed}"), value);
                };
                figure("slope", felt.slope[1]);
                figure("hysteresis", felt.hysteresis[1]);
                figure("small_hysteresis", felt.hysteresis[0]);
                figure("back", felt.back);
            }
            let [scale, coulomb, true_ones, intervals] = rigs.errors();
            motors.push(row([
                label,
                format!("{:.3} %", 100.0 * scale),
                format!("{:.1} %", 100.0 * coulomb),
                format!("{true_ones:.0} of {intervals:.0}"),
            ]));
            if gear.is_none() {
                held = [held[0] + true_ones, held[1] + intervals];
                constants = constants.max(scale);
                worst = Some(worst.map_or((drawn, after), |(a, b)| (a.worse(&drawn), b.worse(&after))));
            }
        }
    }
    report.table(&table);
    report.say("What the motors found, against the truth:");
    report.table(&motors);
    let Some((drawn, after)) = worst else { return };
    let most = |of: [f64; 2]| of[0].max(of[1]);
    report.check(
        "table III: the loop stays active",
        if drawn.active && after.active { "it does" } else { "it does not" },
        drawn.active && after.active,
    );
    report.check_within("table III: error of the slope after, %,", 100.0 * most(after.slope), 100.0 * SLOPE);
    report.check("table III: R² after, at least 0.999", format!("{:.5}", after.r2), after.r2 >= R2);
    for (k, load) in LOADS.into_iter().enumerate() {
        let left = after.hysteresis[k] / drawn.hysteresis[k];
        let what = format!("table III: part of the hysteresis left at {load} N m, %,");
        report.check_within(&what, 100.0 * left, LEFT);
    }
    report.check_within("table III: torque that turns the sphere after, mN m,", 1e3 * after.back, 1e3 * BACK);
    report.check_within("table III: error of a torque constant, %,", 100.0 * constants, 1.0);
    // One rig has too few intervals to tell a tenth of them.
    let [least, most] = if context.quick { [0.85, 1.0] } else { super::HELD };
    let part = held[0] / held[1].max(1.0);
    report.check(
        format!(
            "table III: {:.0} to {:.0} % of the motors' intervals hold the truth",
            100.0 * least,
            100.0 * most
        ),
        format!("{:.1} % of {:.0}", 100.0 * part, held[1]),
        (least..=most).contains(&part),
    );
}

fn told(rig: &str, believed: &str, felt: &Felt) -> Vec<String> {
    let percent = |x: f64| format!("{:.2} %", 100.0 * x);
    let milli = |x: f64| format!("{:.2}", 1e3 * x);
    row([
        rig.to_owned(),
        believed.to_owned(),
        percent(felt.slope[0]),
        percent(felt.slope[1]),
        format!("{:.5}", felt.r2),
        milli(felt.hysteresis[0]),
        milli(felt.hysteresis[1]),
        milli(felt.middle),
        milli(felt.back),
    ])
}

impl Rigs {
    fn new(seed: u64, gear: Option<Gear>) -> Self {
        let drawing = prototype(&[]);
        let device = drawing.rig.device;
        let mut built = Built::new(&device, seed).unwrap_or_else(|e| unreachable!("near the drawing: {e}"));
        // Both loops know the zeros; the part above is about them.
        built.zeros.fill(0.0);
        let phenomena = Phenomena { gear, ..Phenomena::default() };
        let mut truth = drawing.clone();
        let mut rng = Rng(seed);
        let mut joint = |j: usize| Imperfect {
            torque_scale: WEAK + SPREAD * (2.0 * rng.unit() - 1.0),
            friction: Friction {
                coulomb: (1.5e-4 + 1.5e-4 * rng.unit()) * if j.is_multiple_of(2) { 1.0 } else { 0.7 },
                viscous: 1.0e-5 * (0.5 + rng.unit()),
            },
            ..Imperfect::default()
        };
        let mut imperfect =
            Compensation { sphere: Friction { coulomb: 2.0e-3, viscous: 0.0 }, ..Compensation::default() };
        for j in 0..device.joints() {
            imperfect.joints[j] = joint(j);
        }
        truth.rig = rig_with(&drawing, built.device, Some(imperfect));
        let identified = by_hand(&drawing, &built, seed);
        let measured = by_motors(&identified, &truth, phenomena);
        let known = Compensation {
            joints: measured.joints,
            sphere: measured.sphere,
            imbalance: measured.imbalance,
            ..Compensation::default()
        };
        let mut after = identified.clone();
        after.rig = rig_with(&identified, identified.rig.device, Some(known));
        Self { drawing, truth, phenomena, identified: after, measured }
    }

    /// Returns the largest relative errors of torque constants and of Coulomb friction, and how
    /// many intervals hold the truth, of how many.
    fn errors(&self) -> [f64; 4] {
        use hbot_identify::motors::MotorName;
        let truth = self.truth.rig.compensation.unwrap_or_default();
        let [mut scale, mut coulomb, mut held, mut count] = [0.0_f64; 4];
        for value in &self.measured.values {
            let real = match (value.name, value.joint) {
                (MotorName::TorqueScale, Some(j)) => truth.joints[j].torque_scale,
                (MotorName::Coulomb, Some(j)) => truth.joints[j].friction.coulomb,
                (MotorName::Viscous, Some(j)) => truth.joints[j].friction.viscous,
                (MotorName::Coulomb, None) => truth.sphere.coulomb,
                _ => continue,
            };
            count += 1.0;
            held += f64::from(u8::from((value.found - real).abs() <= value.interval));
            let off = (value.found / real - 1.0).abs();
            match value.name {
                MotorName::TorqueScale => scale = scale.max(off),
                MotorName::Coulomb => coulomb = coulomb.max(off),
                _ => {}
            }
        }
        [scale, coulomb, held, count]
    }
}

fn rig_with(config: &RigConfig, device: Device, compensation: Option<Compensation>) -> hbot_core::Rig {
    let changed = config.rig.with(|parts| {
        parts.device = device;
        parts.compensation = compensation;
    });
    changed.unwrap_or_else(|error| unreachable!("near the drawing: {error}"))
}

/// Returns the rig file with the geometry that a hand's turns show.
fn by_hand(drawing: &RigConfig, built: &Built, seed: u64) -> RigConfig {
    let (recording, _) = counts(
        &drawing.rig,
        built,
        &Wander::new(seed, Vec3::splat(super::SPEED)),
        super::RECORDED_S,
        Encoders::IDEAL,
        seed,
    );
    let found = identify(&drawing.rig, &recorded(recording), What::Geometry, &mut |_, _| ());
    let found = found.unwrap_or_else(|why| unreachable!("a good recording: {why}"));
    let drawn = &drawing.rig.device;
    let device = Device::new(drawn.sphere_radius(), drawn.sphere_mass(), &found.wheels);
    let mut device = device.unwrap_or_else(|error| unreachable!("near the drawing: {error}"));
    for (i, zero) in found.zeros.iter().enumerate() {
        device = device.with_steering_zero(i, *zero);
    }
    RigConfig { rig: rig_with(drawing, device, None), ..drawing.clone() }
}

/// Returns what the motors show of a rig that is as `truth` says.
fn by_motors(believed: &RigConfig, truth: &RigConfig, phenomena: Phenomena) -> Measured {
    let how = Excitation { seconds: 60.0, wander: 0.8, fastest: 6.0 };
    let truth = Truth { built: Some(truth), phenomena };
    // No helper process is started for a simulated rig.
    let bench = open(believed, truth, StopFlag::default(), &Program::this("none"));
    let mut bench = bench.unwrap_or_else(|error| unreachable!("a simulated rig: {error}"));
    let mut log = Vec::new();
    let ended = excite(&mut bench, &how, &mut |now| {
        log.push(Sample { time_s: now.time_s, counts: now.reading.counts, torque: now.torque });
    });
    match ended {
        Ok(Ended::Done) => {}
        other => unreachable!("nothing disturbs the motion: {other:?}"),
    }
    measure(&believed.rig, Quat::IDENTITY, &log).unwrap_or_else(|why| unreachable!("a good motion: {why}"))
}

impl Felt {
    /// Returns the worse of two in each respect.
    fn worse(&self, other: &Self) -> Self {
        let more = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        Self {
            slope: more(self.slope, other.slope),
            r2: self.r2.min(other.r2),
            hysteresis: more(self.hysteresis, other.hysteresis),
            middle: self.middle.max(other.middle),
            back: self.back.max(other.back),
            active: self.active && other.active,
        }
    }
}

/// Measures what a hand feels of the rig `rigs` if the loop believes `config`.
fn felt(rigs: &Rigs, config: &RigConfig) -> Felt {
    let mut felt =
        Felt { slope: [0.0; 2], r2: 1.0, hysteresis: [0.0; 2], middle: 0.0, back: 0.0, active: true };
    for axis in Vec3::AXES {
        for (k, load) in LOADS.into_iter().enumerate() {
            let line = line(rigs, config, axis, load);
            felt.slope[k] = felt.slope[k].max((line.slope / STIFFNESS - 1.0).abs());
            felt.r2 = felt.r2.min(line.r2);
            felt.hysteresis[k] = felt.hysteresis[k].max(line.hysteresis);
            if k == 1 {
                felt.middle = felt.middle.max(line.middle);
            }
            felt.active &= line.active;
        }
        felt.back = felt.back.max(back_driven(rigs, config, axis));
    }
    felt
}

/// Returns the loop on the rig as it is, after the soft start.
fn started(rigs: &Rigs, config: &RigConfig, stiffness: f64) -> Whole {
    let free = || scene_of(json!({"name": "study"}));
    let scene = if stiffness > 0.0 { spring(stiffness, DAMPING) } else { free() };
    let simulated = SimulatedConfig {
        phenomena: rigs.phenomena,
        imperfect: rigs.truth.rig.compensation,
        ..SimulatedConfig::new(&rigs.truth.rig)
    };
    let mut run = Whole::simulated(config, scene, &simulated);
    run.run(START_S);
    run
}

/// Load over deflection.
struct Line {
    slope: f64,
    r2: f64,
    /// Difference between the ways up and down, in any range of the load and in the middle half.
    hysteresis: f64,
    middle: f64,
    active: bool,
}

/// Loads the spring up, down and in reverse, twice, and looks at the second time.
fn line(rigs: &Rigs, config: &RigConfig, axis: Vec3, most: f64) -> Line {
    let mut run = started(rigs, config, STIFFNESS);
    let ticks = run.ticks(LOAD_S);
    let mut active = true;
    let mut points = Vec::new();
    // Torque that friction takes, summed in ranges of the load on the way up and down.
    let mut taken = [[(0.0, 0.0); RANGES]; 2];
    for tick in 0..2 * ticks {
        let phase = TAU * f64::from(tick) / f64::from(ticks);
        let load = most * phase.sin();
        run.rig_mut().set_external(axis * load);
        active &= run.step(None).state.mode == Mode::Active;
        if tick < ticks {
            continue;
        }
        let state = run.rig().state();
        let deflection = rotation::log(state.q).dot(axis);
        points.push((deflection, load));
        let left = load - STIFFNESS * deflection - DAMPING * state.omega.dot(axis);
        // The ends are left out: there the sphere sticks.
        let range = ((load / most + 1.0) * 0.5 * RANGES as f64) as usize;
        if range > 0 && range < RANGES - 1 {
            let (sum, count) = &mut taken[usize::from(phase.cos() > 0.0)][range];
            (*sum, *count) = (*sum + left, *count + 1.0);
        }
    }
    run.rig_mut().set_external(Vec3::ZERO);
    let [down, up] = taken;
    let apart = |((a, n), (b, m)): (&(f64, f64), &(f64, f64))| (a / n - b / m).abs();
    let within = |ranges: core::ops::Range<usize>| {
        let both = down[ranges.clone()].iter().zip(&up[ranges]);
        both.filter(|((_, n), (_, m))| *n > 0.0 && *m > 0.0).map(apart).fold(0.0, f64::max)
    };
    let (hysteresis, middle) = (within(0..RANGES), within(RANGES / 4..3 * RANGES / 4));
    let Fit { slope, r2, .. } = Fit::through(&points);
    Line { slope, r2, hysteresis, middle, active }
}

/// Returns the mean torque with which a hand turns the sphere about `axis` without a spring, N m.
fn back_driven(rigs: &Rigs, config: &RigConfig, axis: Vec3) -> f64 {
    // A stiff controller of the hand's speed.
    const GAINS: [f64; 2] = [0.1, 1.0];
    let mut run = started(rigs, config, 0.0);
    let ticks = run.ticks(BACK_DRIVEN_S);
    let (mut sum, mut integral) = (0.0, Vec3::ZERO);
    for tick in 0..ticks {
        let off = axis * BACK_DRIVEN - run.rig().state().omega;
        integral += off * run.period();
        let hand = off * GAINS[0] + integral * GAINS[1];
        run.rig_mut().set_external(hand);
        run.step(None);
        if tick >= ticks / 3 {
            sum += hand.dot(axis);
        }
    }
    sum / f64::from(ticks - ticks / 3)
}
