//! Accuracy of odometry on smooth motions: the errors of the path and of the counts, separate and
//! together.

use hbot_core::design::rig::{Methods, Rig};
use hbot_core::motion::path::Trail;
use hbot_core::{Device, MAX_JOINTS};
use hbot_plot::{Lines, Series};
use hbot_sim::motion::{JOINTS, LEAD, MOTIONS, MotionSample, TrueMotion, along, angle};

use super::order::Errors;
use super::{DRIFT_S, RATES, in_both_widths, sci};
use crate::context::Context;
use crate::report::{Report, head, row, spread};
use crate::timing::{Time, in_turn};
use crate::verification::double::stages::odometry::{Choice, METHODS, ORDERS, PATH_ORDERS, PATHS, track};

/// Reading rate for which the report lists the error of each cause separately, Hz. It is one of
/// [`RATES`].
const PARTS_AT: u32 = 1000;

/// Returns all combinations of an odometry method and an assumed path of the joints between
/// readings.
fn choices() -> impl Iterator<Item = Choice> {
    (0..PATHS.len()).flat_map(|path| (0..METHODS.len()).map(move |method| Choice { method, path }))
}

/// Returns the combinations of odometry method and assumed path that give different results. The
/// result of Euler's method does not depend on the path, so this method occurs only once.
fn distinct() -> impl Iterator<Item = Choice> {
    choices().filter(|choice| choice.method > 0 || choice.path == 0)
}

/// Measured computing times of one tick of odometry, for f64 and f32, and for each combination of
/// method and path.
pub(super) struct Times(Vec<(&'static str, Choice, Time)>);

impl Times {
    /// Returns the computing time of odometry for one second of motion at `hz` readings per second,
    /// in microseconds.
    pub(super) fn us_per_second(&self, width: &str, method: usize, path: usize, hz: u32) -> f64 {
        let choice = Choice { method, path };
        let found = self.0.iter().find(|(w, c, _)| *w == width && *c == choice);
        found.map_or(f64::NAN, |(.., time)| time.median * 1.0e-3 * f64::from(hz))
    }
}

/// Measures the computing time of every combination of odometry method and assumed path, in f64 and
/// in f32.
pub(super) fn times(context: &Context, report: &mut Report, device: &Device) -> Times {
    context.part("odometry: time");
    report.heading("Odometry: time");
    report.say(
        "What one tick takes to make an orientation of the joints' turns. Euler finds the contact frames of the last reading made already: the torque's \
         allocation needs them. The others make one set (midpoint) or two (magnus4) more.",
    );
    report.family("odometry_{method}_{path}_{width}_ns | ns | one tick of odometry of two wheels");
    let mut names = Vec::new();
    let mut timed = Vec::new();
    in_both_widths!(stages => {
        for choice in choices() {
            names.push((stages::WIDTH, choice));
            let of = stages::odometry::Choice { method: choice.method, path: choice.path };
            timed.push(stages::odometry::timed(stages::device(device), of));
        }
    });
    let times = in_turn(context.quick, &mut timed);
    let mut table = vec![row(["method", "path", "width", "ns a tick (quartiles)"])];
    for ((width, choice), time) in names.iter().zip(&times) {
        let (method, path) = (METHODS[choice.method].0, PATHS[choice.path].0);
        report.time(format!("odometry_{method}_{path}_{width}_ns"), *time);
        table.push(row([method, path, width, &spread(*time)]));
    }
    report.table(&table);
    Times(names.into_iter().zip(times).map(|((width, choice), time)| (width, choice, time)).collect())
}

/// A motion as the encoders read it at one reading rate.
struct Read {
    truth: Vec<[f64; 4]>,
    exact: Vec<[f64; JOINTS]>,
    /// Joint angles rounded to whole counts of the rig's encoders, rad.
    counted: Vec<[f64; JOINTS]>,
}

impl Read {
    fn new(rig: &Rig, moments: &[MotionSample], every: usize) -> Self {
        let moments: Vec<&MotionSample> = moments.iter().step_by(every).collect();
        let exact: Vec<[f64; JOINTS]> = moments.iter().map(|m| m.joints).collect();
        let counted = exact.iter().map(|joints| {
            core::array::from_fn(|j| {
                let count = rig.joints[j].radians_per_count();
                (joints[j] / count).round() * count
            })
        });
        let counted = counted.collect();
        Self { truth: moments[LEAD..].iter().map(|m| m.q).collect(), exact, counted }
    }
}

/// Returns the largest angle between two orientations with the same index in `a` and `b`, rad.
fn apart(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    a.iter().zip(b).map(|(a, b)| angle(*a, *b)).fold(0.0, f64::max)
}

/// Returns the readings of a motion at each of the rates [`RATES`].
fn readings(motion: &TrueMotion, rig: &Rig) -> Vec<Read> {
    let finest = RATES[RATES.len() - 1];
    RATES
        .iter()
        .map(|hz| {
            let every = (finest / hz) as usize;
            // Each rate has its own lead-in readings before time 0, from which the drift counts.
            let ticks = (DRIFT_S * f64::from(finest)).round() as usize;
            let moments = motion.moments(&rig.device, finest, ticks + every * LEAD + 1, every * LEAD);
            Read::new(rig, &moments, every)
        })
        .collect()
}

pub(super) fn study(context: &Context, report: &mut Report, rig: &Rig, times: &Times) {
    context.part("odometry: smooth motions");
    introduce(report);
    let mut budget =
        vec![head("motion | method | path | method's | path's | counts' | method and path | all three")];
    let mut orders = vec![row(["motion", "method", "path", "order"])];
    for motion in &MOTIONS {
        let reads = readings(motion, rig);
        let mut lines = Vec::new();
        in_both_widths!(stages => {
            let device = stages::device(&rig.device);
            for choice in choices() {
                let (method, path) = (METHODS[choice.method].0, PATHS[choice.path].0);
                let of = stages::odometry::Choice { method: choice.method, path: choice.path };
                let drift = |read: &Read| apart(&stages::odometry::track(&device, of, &read.exact), &read.truth);
                let drifts: Vec<f64> = reads.iter().map(drift).collect();
                for (hz, drift) in RATES.iter().zip(&drifts) {
                    let id = format!("odometry_{}_{method}_{path}_{}_{hz}hz_drift_rad", motion.name, stages::WIDTH);
                    report.figure(id, *drift);
                }
                if let Some(colour) = distinct().position(|other| other == choice) {
                    let points = RATES.iter().zip(&drifts).map(|(hz, drift)| (times.us_per_second(stages::WIDTH, choice.method, choice.path, *hz), *drift)).collect();
                    lines.push(Series::new(format!("{method}, {path}, {}", stages::WIDTH), points, colour).open(stages::WIDTH == "f32"));
                }
                if stages::WIDTH == "f64" {
                    orders.push(order(report, motion, choice, &drifts));
                }
            }
        });
        let followed = followed_by_all(rig, &reads);
        budget.extend(choices().map(|choice| parts(report, rig, motion, choice, &reads, &followed)));
        draw(report, motion, lines);
    }
    report.say("The three errors apart and together at 1 kHz, f64, rad:");
    report.table(&budget);
    report.say(
        "Orders between the two finest rates above the floor; the path's order bounds the method's. Motions that go on are held to theory; \
         where a wheel is pushed backwards it turns about quicker than a slow loop reads it, and the order shows only at higher rates.",
    );
    report.table(&orders);
}

fn draw(report: &mut Report, motion: &TrueMotion, lines: Vec<Series>) {
    let title = motion.name.replace('_', ", ");
    report.lines(
        &format!("odometry_{}", motion.name),
        &format!("Odometry of {title} motion, exact readings: drift in 0.6 s against the time that it takes; each line from 500 Hz (left) to 8 kHz"),
        Lines::new(
            format!("Drift of {title} motion"),
            "microseconds of computing for a second of motion",
            "drift in 0.6 s, rad",
            lines,
        )
        .log([true; 2])
        .front(),
    );
}

/// Returns, for each path that odometry can assume between readings, the orientations of a sphere
/// whose joints really move along this path. The readings have the rate [`PARTS_AT`] and no encoder
/// error.
fn followed_by_all(rig: &Rig, reads: &[Read]) -> Vec<Vec<[f64; 4]>> {
    let at = RATES.iter().zip(reads).find(|(hz, _)| **hz == PARTS_AT);
    let Some((_, at)) = at else { unreachable!("it is one of the rates") };
    (0..PATHS.len()).map(|path| followed(&rig.device, path, &at.exact)).collect()
}

fn introduce(report: &mut Report) {
    report.heading("Odometry: smooth motions");
    report.say(&format!(
        "A sphere turns smoothly for {DRIFT_S} s, and encoders read its joints. *Gentle* turns with 0.5 rad/s on average and changes at \
         0.5 Hz, *brisk* 3 rad/s and 2 Hz, *violent* 15 rad/s and 5 Hz; *reversing* ones go back and forth, so that wheels are pushed \
         backwards and turn about. A path is *straight* between two readings, or the *quadratic* or *cubic* through the last three or four, \
         over the last interval: nothing is extrapolated and nothing comes a tick late. Drift is the largest angle on the way. The method's error is against the \
         path followed to rounding, the path's is that of the path so followed against the truth, the counts' is what rounding the readings to \
         the prototype's counts (16384 a turn, the drive's through 17:1) changes. Euler takes the frames of the last reading, whatever the path.",
    ));
    report.family("odometry_{motion}_{method}_{path}_{width}_{rate}hz_drift_rad | rad | drift in 0.6 s of smooth motion with exact readings, largest on the way; {motion}: gentle, brisk, violent, each also with _reversing");
    report.family("odometry_{motion}_{method}_{path}_counts_{rate}hz_drift_rad | rad | the same in f64 with readings rounded to the prototype's counts");
    report.family("odometry_{motion}_{method}_{path}_{part}_part_1000hz_rad | rad | the part of that drift at 1 kHz that {part} (method, path, counts) has by itself");
}

/// Smallest drift that can be measured on a smooth motion, rad. It is the sum of the rounding
/// errors of the reference and of odometry: 4800 steps of 1e-16.
const FLOOR: f64 = 1.0e-13;

fn order(report: &mut Report, motion: &TrueMotion, choice: Choice, drifts: &[f64]) -> Vec<String> {
    let (method, path) = (METHODS[choice.method].0, PATHS[choice.path].0);
    let errors = Errors(RATES.iter().zip(drifts).map(|(hz, drift)| (1.0 / f64::from(*hz), *drift)).collect());
    let theory = ORDERS[choice.method].min(PATH_ORDERS[choice.path]);
    let order = if motion.reversing {
        errors.order(FLOOR)
    } else {
        let what = format!("odometry of {} motion, {method}, {path}, f64", motion.name);
        errors.check(report, &what, FLOOR, theory)
    };
    row([motion.name, method, path, &order.map_or("-".to_owned(), |order| format!("{order:.2}"))])
}

/// The errors of odometry on one motion, by cause and together, rad. `method` is the error of the
/// integration method, `path` that of the path assumed between readings, and `counts` that of
/// rounding to encoder counts.
pub(super) struct Budget {
    pub(super) method: f64,
    pub(super) path: f64,
    pub(super) counts: f64,
    /// Error that the integration method and the assumed path cause together, rad.
    pub(super) both: f64,
    /// Error that the integration method, the assumed path and the encoder counts cause together,
    /// rad.
    all: f64,
}

impl Budget {
    /// Measures the errors of odometry with the method and the path of `choice`. `followed` are the
    /// exact orientations if the joints move along this path through exact readings.
    fn of(device: &Device, choice: Choice, read: &Read, followed: &[[f64; 4]]) -> Self {
        let exact = track(device, choice, &read.exact);
        let counted = track(device, choice, &read.counted);
        Self {
            method: apart(&exact, followed),
            path: apart(followed, &read.truth),
            counts: apart(&counted, &exact),
            both: apart(&exact, &read.truth),
            all: apart(&counted, &read.truth),
        }
    }
}

/// Returns the orientation at each of `readings` if the joints move between readings along the path
/// with index `path` in [`PATHS`]. The orientations are exact apart from rounding.
fn followed(device: &Device, path: usize, readings: &[[f64; JOINTS]]) -> Vec<[f64; 4]> {
    let mut q = [1.0, 0.0, 0.0, 0.0];
    let mut all = vec![q];
    let mut trail = Trail::START;
    for (k, pair) in readings.windows(2).enumerate() {
        let mut delta = [0.0; MAX_JOINTS];
        for j in 0..JOINTS {
            delta[j] = pair[1][j] - pair[0][j];
        }
        let way = trail.step(PATHS[path].1, &delta, 1.0);
        if k >= LEAD {
            let th = core::array::from_fn(|i| pair[0][2 * i]);
            q = along(device, th, &way, q);
            all.push(q);
        }
    }
    all
}

/// Measures the errors of the rig's odometry on a motion, by cause. `moments` are samples of the
/// motion at the times at which the joints are read.
pub(super) fn budget(rig: &Rig, methods: Methods, moments: &[MotionSample]) -> Budget {
    let method = METHODS.iter().position(|(_, method)| *method == methods.odometry);
    let path = PATHS.iter().position(|(_, path)| *path == methods.path);
    let (Some(method), Some(path)) = (method, path) else { unreachable!("every method is in the list") };
    let read = Read::new(rig, moments, 1);
    let followed = followed(&rig.device, path, &read.exact);
    Budget::of(&rig.device, Choice { method, path }, &read, &followed)
}

/// Reports the odometry errors of one method and one path on a motion, at every reading rate.
/// Returns the row of the table for them.
fn parts(
    report: &mut Report,
    rig: &Rig,
    motion: &TrueMotion,
    choice: Choice,
    reads: &[Read],
    followed: &[Vec<[f64; 4]>],
) -> Vec<String> {
    let (method, path, name) = (METHODS[choice.method].0, PATHS[choice.path].0, motion.name);
    let mut at_1_khz = Vec::new();
    for (hz, read) in RATES.iter().zip(reads) {
        let id = format!("odometry_{name}_{method}_{path}_counts_{hz}hz_drift_rad");
        if *hz != PARTS_AT {
            report.figure(id, apart(&track(&rig.device, choice, &read.counted), &read.truth));
            continue;
        }
        let budget = Budget::of(&rig.device, choice, read, &followed[choice.path]);
        let Budget { method: of_method, path: of_path, counts, both, all } = budget;
        report.figure(id, all);
        for (part, value) in [("method", of_method), ("path", of_path), ("counts", counts)] {
            report.figure(format!("odometry_{name}_{method}_{path}_{part}_part_{PARTS_AT}hz_rad"), value);
        }
        at_1_khz = [of_method, of_path, counts, both, all].map(sci).to_vec();
    }
    row([name, method, path].map(str::to_owned).into_iter().chain(at_1_khz))
}
