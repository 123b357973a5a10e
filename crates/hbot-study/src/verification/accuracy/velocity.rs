//! Accuracy of joint rates computed from counts: noise and lag of each estimate, false slip and
//! computing time, for encoders of several resolutions.

use core::f64::consts::TAU;

use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::{RateEstimate, Rig};
use hbot_core::inputs::{Inputs, JointReadings};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, Vec3};
use hbot_plot::{Lines, Series, short};
use hbot_sim::motion::JOINTS;

use super::sci;
use crate::context::Context;
use crate::report::{Report, row};
use crate::timing::{Time, Timed, in_turn};

const DT: f64 = 1e-3;
/// Number of ticks at the start of each motion that are ignored, until the estimates have settled.
const SETTLE: usize = 500;
/// Number of ticks of a motion whose computing time is measured.
const TIMED: usize = 4000;

/// The methods of estimating joint rates that are compared, each with its name in the ids of
/// figures.
const ESTIMATES: [(&str, RateEstimate); 9] = [
    ("controller", RateEstimate::Controller),
    ("difference", RateEstimate::Difference),
    ("low_pass_100hz", RateEstimate::LowPass { cutoff_hz: 100.0 }),
    ("low_pass_30hz", RateEstimate::LowPass { cutoff_hz: 30.0 }),
    ("adaptive_window_16", RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 16 }),
    ("adaptive_window_32", RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 32 }),
    ("kalman_30", RateEstimate::Kalman { acceleration: 30.0 }),
    ("kalman_100", RateEstimate::Kalman { acceleration: 100.0 }),
    ("kalman_300", RateEstimate::Kalman { acceleration: 300.0 }),
];

/// Encoder resolutions that are compared, each with its name in the ids of figures: counts per turn
/// of the steer's encoder and of the drive's (before its gear of 17).
const ENCODERS: [(&str, [u32; 2]); 4] =
    [("16384", [16384, 16384]), ("2048", [2048, 2048]), ("2048_and_256", [2048, 256]), ("256", [256, 256])];

/// A motion of the sphere, defined by its angular velocity over time (frame N, rad/s).
struct Motion {
    name: &'static str,
    size: f64,
    hertz: f64,
    steady: f64,
}

/// The motions on which the rate estimates are compared: a sphere held with a tremor of 0.5 mrad, a
/// slow exploration, and turning back and forth by 0.2 rad.
const MOTIONS: [Motion; 3] = [
    Motion { name: "held", size: 0.5e-3 * 9.0 * TAU, hertz: 9.0, steady: 0.0 },
    Motion { name: "slow", size: 0.02, hertz: 0.3, steady: 0.05 },
    Motion { name: "brisk", size: 2.0, hertz: 1.5, steady: 0.0 },
];

/// True values of a motion at one tick: joint angles (rad), joint rates (rad/s) and the sphere's
/// angular velocity (frame N, rad/s).
type Truth = ([f64; JOINTS], [f64; JOINTS], Vec3);

impl Motion {
    fn omega(&self, t: f64) -> Vec3 {
        let swing = |pace: f64| libm::sin(TAU * self.hertz * pace * t) * self.size;
        // The three frequencies have no common period, so that counts change at all phases.
        Vec3::new(swing(1.0), swing(0.707), swing(0.618)) * (1.0 / 3.0_f64.sqrt())
            + Vec3::new(0.6, -0.48, 0.64) * self.steady
    }

    fn truth(&self, rig: &Rig, ticks: usize) -> Vec<Truth> {
        let rates = |t: f64, z: &[f64; JOINTS]| {
            let rates = Posture::new(&rig.device, &[z[0], z[2]]).inverse(self.omega(t));
            core::array::from_fn(|j| rates[j])
        };
        let mut z = [0.3, 0.0, -0.5, 0.0];
        (0..ticks)
            .map(|tick| {
                let now = tick as f64 * DT;
                let reading = (z, rates(now, &z), self.omega(now));
                z = hbot_sim::extrapolation::advance(&rates, now, DT, &z);
                reading
            })
            .collect()
    }
}

/// Returns the readings that motor controllers would send during a motion, with the encoders of
/// `rig`. Angles are rounded down to whole encoder counts.
fn readings(rig: &Rig, truth: &[Truth]) -> Vec<JointReadings> {
    let reading = |(tick, (angles, rates, _)): (usize, &Truth)| {
        let mut feedback = JointReadings::new(tick as u32, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..JOINTS {
            feedback.counts[j] = (angles[j] / rig.joints[j].radians_per_count()).floor() as i32;
            feedback.rates[j] = rates[j];
        }
        feedback
    };
    truth.iter().enumerate().map(reading).collect()
}

/// Runs a controller on `readings` and returns the state that it reports for each of them.
fn states(rig: &Rig, readings: &[JointReadings]) -> impl Iterator<Item = hbot_core::outputs::State> {
    let mut controller = Controller::new(*rig);
    readings.iter().map(move |feedback| {
        let inputs = Inputs { feedback: Some(*feedback), ..Inputs::quiet(u64::from(feedback.sequence)) };
        controller.tick(&CompiledScene::empty(), &inputs).state
    })
}

/// Quality of a rate estimate on one motion: the noise and the lag of the sphere's angular
/// velocity, and the slip that is reported although the wheels do not slip.
struct Quality {
    /// Root mean square of the error of the sphere's angular velocity after the lag is removed,
    /// rad/s.
    noise: f64,
    /// Lag of the estimated angular velocity behind the true one, s. It is the time shift that
    /// explains most of the error.
    lag: f64,
    /// Largest slip that the controller reports although the wheels do not slip, m/s.
    slip: f64,
}

fn judge(rig: &Rig, truth: &[Truth]) -> Quality {
    let (mut errors, mut slip) = (Vec::new(), 0.0_f64);
    for (tick, state) in states(rig, &readings(rig, truth)).enumerate() {
        if (SETTLE..truth.len() - 1).contains(&tick) {
            let growth = (truth[tick + 1].2 - truth[tick - 1].2) / (2.0 * DT);
            errors.push((state.omega - truth[tick].2, growth));
            slip = slip.max(state.slip);
        }
    }
    // The lag is the least-squares solution of: error = -lag growth + noise.
    let squares: f64 = errors.iter().map(|(_, growth)| growth.length_squared()).sum();
    let lag = -errors.iter().map(|(error, growth)| error.dot(*growth)).sum::<f64>() / squares;
    let rest: f64 = errors.iter().map(|(error, growth)| (*error + *growth * lag).length_squared()).sum();
    Quality { noise: (rest / errors.len() as f64).sqrt(), lag, slip }
}

/// Returns a copy of `rig` in which the encoders have `counts` counts per turn (steer, drive) and
/// joint rates are estimated by the method `rate`.
fn with(rig: &Rig, counts: [u32; 2], rate: RateEstimate) -> Rig {
    let rig = rig.with(|rig| {
        rig.methods.rate = rate;
        for (j, joint) in rig.joints.iter_mut().enumerate() {
            joint.counts_per_turn = counts[j % 2];
        }
    });
    rig.unwrap_or_else(|error| unreachable!("the study's encoders are legal: {error}"))
}

pub(super) fn study(context: &Context, report: &mut Report, rig: &Rig) {
    context.part("joint rates: error");
    let ticks = if context.quick { 4000 } else { 20_000 };
    introduce(report, ticks);
    let truths: Vec<Vec<Truth>> = MOTIONS.iter().map(|motion| motion.truth(rig, ticks)).collect();
    let (mut found, mut timed) = (Vec::new(), Vec::new());
    for (encoder, counts) in ENCODERS {
        for (name, rate) in ESTIMATES {
            let rig = with(rig, counts, rate);
            let of: Vec<Quality> = truths.iter().map(|truth| judge(&rig, truth)).collect();
            found.push((encoder, name, of));
            // The brisk motion is timed, as its counts change most. The estimates with windows take
            // only a little longer on the other motions.
            let readings = readings(&rig, &truths[2][..TIMED]);
            timed.push(
                Timed::new(move || states(&rig, &readings).map(|state| state.omega.x).sum::<f64>())
                    .in_units_of(TIMED as f64),
            );
        }
    }
    context.part("joint rates: time");
    let times = in_turn(context.quick, &mut timed);
    let mut table = vec![row(["counts", "estimate", "noise, held", "noise, slow", "noise, brisk"])];
    table[0].extend(["lag, ms", "false slip, mm/s", "ns a tick", "ns more"].map(str::to_owned));
    let mut lines: Vec<Series> = Vec::new();
    for (k, ((encoder, name, of), time)) in found.into_iter().zip(&times).enumerate() {
        let estimate = k % ESTIMATES.len();
        table.push(figures(report, [encoder, name], &of, *time, times[k - estimate]));
        let point = (time.median, of[1].noise);
        match lines.iter_mut().find(|series| series.name == name) {
            Some(series) => series.points.push(point),
            None => lines.push(Series::new(name.to_owned(), vec![point], estimate).open(estimate >= 8)),
        }
    }
    report.table(&table);
    report.lines(
        "velocity",
        "Joint rates: noise of the sphere's rate in slow motion against the time of a tick; each line from fine encoders to coarse ones",
        Lines::new("Joint rates from counts", "ns a tick", "noise in slow motion, rad/s", lines)
            .log([true; 2]),
    );
}

/// Reports the figures of one method that estimates joint rates, and returns its row of the table.
/// `plain` is the computing time of a tick without an estimate, which uses the rates that the motor
/// controllers report.
fn figures(
    report: &mut Report,
    [encoder, name]: [&str; 2],
    of: &[Quality],
    time: Time,
    plain: Time,
) -> Vec<String> {
    let id = |what: &str| format!("velocity_{name}_{encoder}_{what}");
    for (motion, quality) in MOTIONS.iter().zip(of) {
        report.figure(id(&format!("{}_noise_rad_per_s", motion.name)), quality.noise);
    }
    let (lag, slip) = (of[2].lag * 1e3, of.iter().fold(0.0, |most: f64, q| most.max(q.slip)));
    report.figure(id("lag_ms"), lag);
    report.figure(id("false_slip_m_per_s"), slip);
    report.time(id("ns"), time);
    let mut cells = row([encoder, name]);
    cells.extend(of.iter().map(|quality| sci(quality.noise)));
    // Tenths, and no minus before a zero.
    cells.push(format!("{:.1}", (lag * 10.0).round() / 10.0 + 0.0));
    cells.extend([slip * 1e3, time.median, time.median - plain.median].map(short));
    cells
}

fn introduce(report: &mut Report, ticks: usize) {
    report.heading("Joint rates");
    report.say(&format!(
        "What the estimates of `rate_estimate` make of counts: the prototype at 1 kHz, counts floored, {} s of each motion. *Held* has a tremor of 0.5 mrad at \
         9 Hz; *slow* is 0.05 rad/s about a skew axis with some wandering; *brisk* up to 2 rad/s to and fro at 1.5 Hz. Noise is the root mean square of the \
         error of the sphere's angular velocity, after the lag that explains most of it in brisk motion is taken out. False slip is the most that the slip \
         detector sees in any of the motions: the wheels never slip. Of `controller` the rates are exact here. The time is that of a whole tick at rest \
         without a scene; docs/internals/velocity.md says what to conclude.",
        ticks as f64 * DT,
    ));
    report.family("velocity_{estimate}_{counts}_{motion}_noise_rad_per_s | rad/s | noise of the sphere's rate, its lag taken out; {counts}: a turn, of the steering and the drive where they differ");
    report.family("velocity_{estimate}_{counts}_lag_ms | ms | by how much the rate is late in brisk motion");
    report.family(
        "velocity_{estimate}_{counts}_false_slip_m_per_s | m/s | the largest slip seen where there is none",
    );
    report.family(
        "velocity_{estimate}_{counts}_ns | ns | a tick without a scene, from counts to the sphere's rate",
    );
}
