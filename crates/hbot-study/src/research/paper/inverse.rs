//! Section V.D: inverse-kinematics control (fig. 6, eq. 24) from one start to orientations all over
//! SO(3).

use hbot_config::RigConfig;
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::OdometryMethod;
use hbot_core::rotation::{error_eq24, shortest, vector_part};
use hbot_core::{Device, Quat, motion::odometry};
use hbot_plot::{Lines, Series, short};

use super::so3;
use crate::context::Context;
use crate::report::{Report, row};
use crate::threads;

/// Root mean square of the orientation error e_O about n1, n2 and n3 that the paper reports, rad.
const PAPER: [f64; 3] = [0.0354, 0.0368, 0.0312];
/// Period of the control loop, s.
const PERIOD_S: f64 = 1.0e-3;
/// Duration of a run of the control loop, s. The paper gives none; this is our interpretation.
const TIME_S: f64 = 1.0;
/// Gain K_O of the position loop in the runs whose errors are plotted, 1/s. The error depends only
/// on the product of gain and time.
const GAIN: f64 = 14.0;
/// A higher gain K_O, with which the remaining error is smaller than the one that the paper
/// reports, 1/s.
const BETTER: f64 = 30.0;
/// Number of ticks between two samples of the error.
const EVERY: usize = 10;
/// Largest allowed difference between the orientation error in the simulated control loop and the
/// error by its closed form, rad. The two differ because the loop holds the joint rates constant
/// for a tick: by K_O h/4 of the change of the error, which is 1 % of an error that starts at 0.5.
const WITHIN: f64 = 5.0e-3;

/// The course of the error over time: the root mean square of the error e_O over all orientations,
/// about each axis, in rad. There is one entry for each sample in time.
type Course = Vec<[f64; 3]>;

/// Which of the two quaternions that describe a desired orientation is given to the control loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sign {
    /// The quaternion that eq. 23 of the paper gives. In half of the cases, it is the one farther
    /// from the present orientation, and the control loop turns the sphere the long way round.
    Printed,
    /// The quaternion that is nearer to the present orientation.
    Nearest,
}

/// Simulates the control loop for one desired orientation. Returns the square of the error e_O
/// about each axis at each sample in time. `looks` is the number of samples.
fn follow(device: &Device, gain: f64, wanted: Quat, looks: usize) -> Course {
    let (mut q, mut th) = (Quat::IDENTITY, [0.0; 2]);
    let mut posture = Posture::new(device, &th);
    let mut course = Vec::with_capacity(looks);
    for k in 0..looks * EVERY {
        let error = error_eq24(wanted, q);
        if k % EVERY == 0 {
            course.push((error * error).to_array());
        }
        // The wheels follow zd = G K_O e_O exactly for a period, and the sphere follows without
        // slip.
        posture.update(device, &th);
        let delta = posture.inverse(error * gain).map(|rate| rate * PERIOD_S);
        q = odometry::advance(q, odometry::turn(device, OdometryMethod::Magnus4, &th, &delta));
        (th[0], th[1]) = (th[0] + delta[0], th[1] + delta[2]);
    }
    course
}

fn rms(device: &Device, gain: f64, sign: Sign, samples: &[Quat], looks: usize) -> Course {
    let wanted = |q: &Quat| if sign == Sign::Nearest { shortest(*q) } else { *q };
    let parts: Vec<&[Quat]> = samples.chunks(samples.len().div_ceil(16)).collect();
    let sums = threads::map(&parts, |part| {
        let mut sum = vec![[0.0; 3]; looks];
        for q in *part {
            for (sum, square) in sum.iter_mut().zip(follow(device, gain, wanted(q), looks)) {
                for k in 0..3 {
                    sum[k] += square[k];
                }
            }
        }
        sum
    });
    let mean = |at: usize| {
        [0, 1, 2].map(|k| (sums.iter().map(|sum| sum[at][k]).sum::<f64>() / samples.len() as f64).sqrt())
    };
    (0..looks).map(mean).collect()
}

/// Returns the RMS error of the control loop about each axis, computed by its closed form. The
/// error depends only on `product`, the product of gain and time.
///
/// About a fixed axis the remaining angle p obeys dp/dt = -K_O sin(p/2). So tan(p/4) falls as
/// exp(-K_O t/2), and |e_O| = sin(p/2).
fn closed(weighted: impl Iterator<Item = (Quat, f64)>, sign: Sign, product: f64) -> [f64; 3] {
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for (q, w) in weighted {
        let q = if sign == Sign::Nearest { shortest(q) } else { q };
        let e = vector_part(q);
        let quarter = libm::tan(0.5 * libm::atan2(e.length(), q.w)) * libm::exp(-0.5 * product);
        let left = libm::sin(2.0 * libm::atan(quarter));
        let e = if e.length() > 0.0 { e * (left / e.length()) } else { e };
        for (sum, e) in sum.iter_mut().zip(e.to_array()) {
            *sum += w * e * e;
        }
        weight += w;
    }
    sum.map(|sum| (sum / weight).sqrt())
}

fn mean(rms: [f64; 3]) -> f64 {
    (rms.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt()
}

/// Returns the product of gain and time at which the RMS error has fallen to `level`. `points` are
/// pairs of this product and the RMS error, in ascending order of the product.
fn falls_to(points: &[(f64, f64)], level: f64) -> f64 {
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        if y0 >= level && y1 < level {
            // The error falls exponentially between two samples.
            return x0 + (x1 - x0) * (y0 / level).ln() / (y0 / y1).ln();
        }
    }
    f64::NAN
}

/// Results of simulating the control loop for all desired orientations. Both q and -q stand for the
/// same orientation; a run uses one choice between them for all orientations.
struct Run {
    /// Name of the run as shown in tables and plots.
    name: &'static str,
    /// Name of the run as used in the ids of figures.
    id: &'static str,
    /// RMS error at each sample in time, over all orientations and axes. Each entry is a pair: the
    /// product of gain and time at the sample, and the error in rad.
    end: Vec<(f64, f64)>,
    /// RMS error from the start of the run up to each sample in time, over all orientations and
    /// axes. Each entry is a pair: the product of gain and time at the sample, and the error in
    /// rad.
    whole: Vec<(f64, f64)>,
    /// Product of gain and time at which the RMS error at that time equals the paper's.
    product: f64,
    /// Product of gain and time at which the RMS error over the whole run up to that time equals
    /// the paper's.
    whole_product: f64,
    /// Largest difference between the simulated control loop and its closed form, rad.
    off: f64,
}

/// Root mean square (RMS) of the error e_O that remains about each axis at the end of a run, over
/// all orientations, rad.
struct Left {
    /// RMS error with the quaternion that eq. 23 gives. The gain is chosen so that the mean over
    /// the three axes equals the paper's.
    ours: [f64; 3],
    /// RMS error with the quaternion that is nearer to the present orientation, and with a higher
    /// gain.
    better: [f64; 3],
    /// RMS error as in [`ours`](Self::ours), but over the orientations of the paper's grid.
    grid: [f64; 3],
}

pub(crate) fn study(context: &Context, report: &mut Report) {
    context.part("inverse-kinematics control");
    let device = RigConfig::prototype().rig.device;
    let samples: Vec<Quat> = so3::uniform(2).collect();
    let looks = (TIME_S / PERIOD_S) as usize / EVERY + 1;
    introduce(report, samples.len());
    let mut runs = Vec::new();
    for (sign, name, id) in
        [(Sign::Printed, "as eq. 23 gives it", "printed"), (Sign::Nearest, "the nearer one", "nearest")]
    {
        let course = rms(&device, GAIN, sign, &samples, looks);
        runs.push(Run::of(&course, &samples, sign, (name, id)));
    }
    let product = runs[0].product;
    let last =
        |gain: f64, sign: Sign| *rms(&device, gain, sign, &samples, looks).last().unwrap_or(&[f64::NAN; 3]);
    let grid = so3::equal_steps(if context.quick { 8 } else { 16 }).map(|(q, _)| (q, 1.0));
    let left = Left {
        ours: last(product / TIME_S, Sign::Printed),
        better: last(BETTER, Sign::Nearest),
        grid: closed(grid, Sign::Printed, product),
    };
    tell(report, &runs, &left);
    draw(report, &runs);
    check(report, &runs, &left);
    let [a, b, c] = left.ours.map(|x| format!("{x:.4}"));
    report.compare(
        "RMS of e_O about n1, n2, n3 (V.D)",
        "0.0354, 0.0368, 0.0312 rad",
        format!("{a}, {b}, {c} rad"),
        format!("a fit: K_O t is not given, and {product:.1} makes the mean the paper's. Over even samples the axes do not differ"),
    );
}

fn introduce(report: &mut Report, samples: usize) {
    report.heading("Inverse-kinematics control (V.D, fig. 6)");
    report.say(&format!(
        "The loop of fig. 6 in simulation, as the paper has it: from one start, the identity with both wheels at zero, to {} orientations spread evenly over SO(3). Each tick of 1 ms takes e_O of eq. 24, gives the wheels \
         zd = G K_O e_O, and the orientation is integrated from the joints' angles. The paper gives neither K_O nor how long the loop runs nor over what its RMS is taken. **Our reading:** the RMS, over the samples, of what is left of \
         e_O when the loop is stopped. Then only the product K_O t matters: about a fixed axis dp/dt = -K_O sin(p/2), so tan(p/4) falls as exp(-K_O t/2) and |e_O| = sin(p/2). The paper's percentages are its \
         radians times 100, so its \"maximum position\" is 1: the largest that a quaternion's vector part can be.",
        samples
    ));
    report.family("ik_rms_{axis}_rad | rad | RMS over the samples of what is left of e_O (eq. 24) about an axis, the loop as printed, at the product of gain and time at which the mean of the three is the paper's; `percent` of the largest possible, 1; `paper`");
    report.family("ik_better_rms_{axis}_rad | rad | the same after the same time with a better gain and the nearer of the two quaternions; `gain` in 1/s");
    report.family("ik_product_{sign} | 1 | gain times time at which the RMS over samples and axes is the paper's 0.0346: the loop as printed, or with the nearer quaternion");
    report.family(
        "ik_product_whole_{sign} | 1 | the same where the RMS is taken over the whole run, from the start on",
    );
    report.family("ik_grid_rms_{axis}_rad | rad | the same as `ik_rms`, on the paper's grid of equal steps of each Hopf coordinate");
}

impl Run {
    /// Computes the results of simulating the control loop. `course` is the RMS error about each
    /// axis at each sample in time, over the desired orientations `samples`.
    fn of(course: &Course, samples: &[Quat], sign: Sign, (name, id): (&'static str, &'static str)) -> Self {
        let target = mean(PAPER);
        let at = |k: usize| GAIN * PERIOD_S * (k * EVERY) as f64;
        let end: Vec<(f64, f64)> = course.iter().enumerate().map(|(k, rms)| (at(k), mean(*rms))).collect();
        let mut square = 0.0;
        let whole: Vec<(f64, f64)> = end
            .iter()
            .enumerate()
            .map(|(k, (x, y))| {
                square += y * y;
                (*x, (square / (k + 1) as f64).sqrt())
            })
            .collect();
        let from_closed =
            |(x, y): &(f64, f64)| (y - mean(closed(samples.iter().map(|q| (*q, 1.0)), sign, *x))).abs();
        let off = end.iter().step_by(10).map(from_closed).fold(0.0_f64, f64::max);
        let product = falls_to(&end, target);
        // The squares of the transient are averaged over the run. A longer run adds time at rest,
        // so its mean is smaller.
        let settled = square / course.len() as f64 * at(course.len() - 1);
        Self { name, id, product, whole_product: settled / (target * target), off, end, whole }
    }
}

/// Adds figures, a table and text about the runs of the control loop to the report.
fn tell(report: &mut Report, runs: &[Run], left: &Left) {
    let Left { ours, better, grid } = left;
    let mut table = vec![row(["quaternion given", "RMS at the end: K_O t", "RMS over the whole run: K_O t"])];
    for Run { name, id, product, whole_product, .. } in runs {
        report.figure(format!("ik_product_{id}"), *product);
        report.figure(format!("ik_product_whole_{id}"), *whole_product);
        table.push(row([(*name).to_owned(), format!("{product:.1}"), format!("{whole_product:.0}")]));
    }
    for (k, axis) in ["n1", "n2", "n3"].into_iter().enumerate() {
        report
            .figure(format!("ik_rms_{axis}_rad"), ours[k])
            .note("percent", 100.0 * ours[k])
            .note("paper", PAPER[k]);
        report.figure(format!("ik_better_rms_{axis}_rad"), better[k]).note("gain", BETTER);
        report.figure(format!("ik_grid_rms_{axis}_rad"), grid[k]);
    }
    report.table(&table);
    let (product, gain) = (runs[0].product, runs[0].product / TIME_S);
    let [a, b, c] = ours.map(|x| format!("{x:.4}"));
    let [ga, gb, gc] = grid.map(|x| format!("{x:.4}"));
    report.say(&format!(
        "The size of the paper's error is one unknown number, K_O t; we take the one at which the mean over the axes is the paper's, {product:.1}: a gain of {gain:.1} 1/s for {TIME_S} s, say. What is left to compare are the three axes: \
         {a}, {b}, {c} rad here, 0.0354, 0.0368, 0.0312 in the paper. Over even samples no axis differs from another, so the paper's spread of 8 % each way is that of its samples; on its own grid of equal steps of each Hopf coordinate the closed form gives {ga}, {gb}, {gc}. \
         Such errors are no property of the device: a gain of {BETTER} 1/s, which a loop of 1 kHz bears easily, leaves {} rad after the same second. \
         As printed the loop turns the long way round wherever eq. 23 gives the farther of the two quaternions, half of all; with the nearer one K_O t = {:.1} does. \
         Were the RMS taken over the whole run instead, the transient would have to be diluted by K_O t of hundreds (the table's last column): not what one would run.",
        short(worst(better)),
        runs[1].product
    ));
}

fn draw(report: &mut Report, runs: &[Run]) {
    let target = mean(PAPER);
    let mut series = Vec::new();
    for (colour, Run { name, end, whole, .. }) in runs.iter().enumerate() {
        series.push(Series::new(format!("{name}, at the end"), end.clone(), colour));
        series.push(Series::new(format!("{name}, whole run"), whole.clone(), colour).open(true));
    }
    series.push(Series::new("the paper", vec![(0.0, target), (GAIN * TIME_S, target)], 6).open(true));
    report.lines(
        "inverse",
        "What is left of e_O, RMS over samples and axes, against gain times time",
        Lines::new("Inverse-kinematics control to samples of SO(3)", "K_O t", "RMS of e_O, rad", series)
            .log([false, true]),
    );
}

fn worst(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn check(report: &mut Report, runs: &[Run], Left { ours, better, .. }: &Left) {
    let off = runs.iter().map(|run| run.off).fold(0.0, f64::max);
    report.check(
        format!("the loop at the joints leaves what its closed form does, within {WITHIN} rad"),
        format!("{off:.1e} rad at worst"),
        off <= WITHIN,
    );
    let spread = ours.iter().fold(0.0, |worst: f64, x| worst.max((x / mean(*ours) - 1.0).abs()));
    report.check(
        "over even samples no axis is left with more than 2 % more than the mean",
        format!("{:.2} %", 100.0 * spread),
        spread <= 0.02,
    );
    report.check(
        "a better gain leaves less than 1e-3 rad about each axis",
        format!("{:.1e} rad", worst(better)),
        worst(better) < 1.0e-3,
    );
}
