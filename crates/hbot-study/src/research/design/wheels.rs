//! The paper's claim that more than two wheels increase stability, in figures: the prototype with
//! two, three and four of its wheels.

use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, Mat3, Vec3};
use hbot_plot::{Bar, bars, short};

use super::figures::{families, figures};
use super::margins::grip;
use super::search::machine;
use super::space::{Design, Parts, WHEELS};
use super::torus::{Measures, TOLD, samples};
use crate::context::Context;
use crate::report::{Report, head, row};
use crate::rng::Rng;

/// Number of random slips from which the share that the joint rates reveal is estimated.
const SLIPS: usize = 20_000;
/// Number of postures at which a single wheel slips, for the share that the joint rates reveal.
const POSTURES: usize = 4096;

/// The share of the contacts' slip that the joint rates reveal, as a fraction of the slip's energy.
/// The rest looks like a turn of the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    /// Mean of the revealed share if all wheels slip in random directions.
    mean: f64,
    /// Mean of the revealed share if a single wheel slips.
    single: f64,
    /// Smallest revealed share if a single wheel slips: in its worst direction at the worst
    /// posture.
    single_least: f64,
}

/// Returns the share of the energy |s|² of random slips that the joint rates reveal: the part that
/// remains in the residual of the core's forward kinematics. A simultaneous turn of the sphere does
/// not change it.
fn share_seen(device: &Device, seed: u64) -> f64 {
    let n = device.wheels().len();
    let mut rng = Rng(seed);
    let (mut left, mut all) = (0.0, 0.0);
    for th in samples(n, SLIPS) {
        let posture = Posture::new(device, &th);
        let omega = Vec3::from_array(rng.direction());
        let mut zd = posture.inverse(omega);
        for (i, wheel) in device.wheels().iter().enumerate() {
            // H⁻¹ s are the joint rates that make the slip s. The slip is drawn from a Gaussian
            // distribution in the plane, so that no direction is preferred.
            let (sin, cos) = libm::sincos(rng.between(0.0, core::f64::consts::TAU));
            let size = libm::sqrt(-2.0 * libm::log(1.0 - rng.unit()));
            let [u, v] = [size * cos, size * sin];
            let steer = u / (device.sphere_radius() * wheel.axis_along_roll());
            zd[2 * i] += steer;
            zd[2 * i + 1] +=
                (v + device.sphere_radius() * wheel.axis_along_axle() * steer) / wheel.spec().radius;
            all += u * u + v * v;
        }
        let slip = posture.forward(device, &zd).slip;
        left += slip[..n].iter().flatten().map(|s| s * s).sum::<f64>();
    }
    left / all
}

/// Returns the share of the slip of a single wheel that the joint rates reveal: the mean over
/// directions and postures, and the smallest. It uses the block of the wheel in I - Z (ZᵀZ)⁻¹ Zᵀ.
fn single(device: &Device) -> [f64; 2] {
    let n = device.wheels().len();
    let (mut sum, mut least) = (0.0, f64::INFINITY);
    for th in samples(n, POSTURES) {
        let posture = Posture::new(device, &th);
        let mut moment = Mat3::ZERO;
        for frame in posture.frames() {
            let outer = |n: Vec3| Mat3::from_cols(n * n.x, n * n.y, n * n.z);
            moment += Mat3::IDENTITY - outer(frame.c3);
        }
        let inverse = moment.inverse();
        for frame in posture.frames() {
            let (a, b) = (inverse * frame.c2, inverse * frame.c1);
            let [xx, xy, yy] = [1.0 - a.dot(frame.c2), a.dot(frame.c1), 1.0 - b.dot(frame.c1)];
            sum += 0.5 * (xx + yy);
            let smaller = 0.5 * (xx + yy - libm::hypot(xx - yy, 2.0 * xy));
            least = least.min(smaller.max(0.0));
        }
    }
    [sum / (POSTURES * n) as f64, least]
}

fn seen(device: &Device) -> Seen {
    let [single, single_least] = single(device);
    Seen { mean: share_seen(device, 5), single, single_least }
}

/// Results for one number of wheels, which become a row of the table.
struct Count {
    wheels: usize,
    measures: Measures,
    /// Peak torque in the worst direction at the worst posture if all motors of one wheel are dead,
    /// N m.
    one_dead: f64,
    seen: Seen,
}

pub(super) fn study(context: &Context, report: &mut Report, parts: &Parts) {
    context.part("two, three, four wheels");
    let mut counts = Vec::new();
    for wheels in WHEELS {
        let design = Design { wheels, ..parts.prototype };
        let Some(mut machine) = machine(parts, &design) else {
            unreachable!("the prototype's wheels in a ring are a legal design")
        };
        let measures = Measures::of(&machine, &design, TOLD);
        let seen = seen(&machine.device);
        machine.peak[..2].fill(0.0);
        let one_dead = Measures::of(&machine, &design, TOLD).torque;
        counts.push(Count { wheels, measures, one_dead, seen });
    }
    tell(report, parts, &counts);
    plots(report, &counts);
    checks(report, &counts);
}

fn tell(report: &mut Report, parts: &Parts, counts: &[Count]) {
    introduce(report);
    let mut table = vec![head(
        "wheels | mean spectral index | least | peak torque, N m | one wheel dead, N m | contact force, N per N m | slips from, N m | normal force shared, N m | inertia, kg m² | slip components seen | share of slip seen | of one wheel's: mean, least",
    )];
    table.extend(counts.iter().map(|count| figures_of(report, parts, count)));
    report.table(&table);
    let [two, three, four] = [0, 1, 2].map(|k| &counts[k].measures);
    report.say(&format!(
        "So a third wheel at once makes {:.1} times the torque in the worst case, {:.1} times what turns the sphere before a contact slips ({:.2} times at the same normal force in sum), {:.2} times the \
         conditioning, leaves torque in every direction where one wheel's motors die, and shows any slip of one wheel. Its price is {:.0} % more apparent inertia. A fourth adds torque ({:.1} times two wheels') and \
         little conditioning ({:.3} after {:.3}) at this tilt, for {:.0} % more inertia than two.",
        three.torque / two.torque,
        two.load / three.load,
        two.load / three.load * 2.0 / 3.0,
        three.gci / two.gci,
        100.0 * (three.inertia / two.inertia - 1.0),
        four.torque / two.torque,
        four.gci,
        three.gci,
        100.0 * (four.inertia / two.inertia - 1.0),
    ));
}

/// Reports the figures of the design with the number of wheels in `count`. Returns its row of the
/// table.
fn figures_of(report: &mut Report, parts: &Parts, count: &Count) -> Vec<String> {
    let (n, m) = (count.wheels, &count.measures);
    let stem = format!("design_wheels_{n}");
    figures(report, &stem, parts, &Design { wheels: n, ..parts.prototype }, m);
    let (dof, shared) = (2 * n - 3, m.slips_from(grip(parts)) * 2.0 / n as f64);
    report.figure(format!("{stem}_residual_dof"), dof as f64);
    report.figure(format!("{stem}_slip_seen"), count.seen.mean).note("expected", dof as f64 / (2 * n) as f64);
    report
        .figure(format!("{stem}_single_slip_seen"), count.seen.single)
        .note("least", count.seen.single_least);
    report.figure(format!("{stem}_one_wheel_dead_torque"), count.one_dead);
    report.figure(format!("{stem}_slip_torque_shared"), shared);
    row([
        n.to_string(),
        short(m.gci),
        short(m.conditioning),
        short(m.torque),
        short(count.one_dead),
        short(m.load),
        short(m.slips_from(grip(parts))),
        short(shared),
        format!("{:.2e}", m.inertia),
        format!("{dof} of {}", 2 * n),
        short(count.seen.mean),
        format!("{}, {}", short(count.seen.single), short(count.seen.single_least)),
    ])
}

fn introduce(report: &mut Report) {
    report.heading("Two, three and four of the prototype's wheels");
    report.say(
        "The paper says that more than two wheels give improved stability. Here is the prototype's wheel, with its cone, tilt, radius and motors, spread evenly about n3 two, three and \
         four times. A slip s of the contacts (two components a wheel) shows in the residual of the joint rates but for the part that looks like a turn of the sphere: of the 2n components \
         2n - 3 are seen, (2n - 3)/(2n) of the energy of slips without a preferred direction. Of two wheels where one slips alone at right angles to the chord between the contacts, as when the \
         sphere pivots about the other contact, nothing is seen; from three wheels on, every slip of a single wheel shows. What all contacts share as a turn does never show, nor pivoting on the spot about a contact's normal, which \
         is no slip of its point: for that it takes a reference from outside.",
    );
    families(report, "design_wheels_{wheels}");
    report.family("design_wheels_{wheels}_residual_dof | 1 | components of slip that are seen, 2n - 3");
    report.family("design_wheels_{wheels}_slip_seen | 1 | share of the energy of slips at random that is seen; `expected`: (2n - 3)/(2n)");
    report.family("design_wheels_{wheels}_single_slip_seen | 1 | the same where one wheel alone slips; `least`: in the worst direction at the worst of the postures");
    report.family("design_wheels_{wheels}_one_wheel_dead_torque | N m | peak torque in the worst direction at the worst posture where one wheel's motors are dead");
    report.family("design_wheels_{wheels}_slip_torque_shared | N m | slip_torque where the normal force of the prototype's two wheels is shared by all");
}

fn plots(report: &mut Report, counts: &[Count]) {
    let two = &counts[0].measures;
    let group = |name: &str, of: &dyn Fn(&Count) -> f64| -> Vec<Bar> {
        let bar = |(colour, count): (usize, &Count)| Bar {
            name: format!("{name}, {} wheels", count.wheels),
            value: of(count),
            label: None,
            spread: None,
            colour,
        };
        counts.iter().enumerate().map(bar).collect()
    };
    let all = [
        group("peak torque, worst case", &|c| c.measures.torque / two.torque),
        group("torque before slip", &|c| two.load / c.measures.load),
        group("the same, normal force shared", &|c| two.load / c.measures.load * 2.0 / c.wheels as f64),
        group("mean spectral index", &|c| c.measures.gci / two.gci),
        group("largest apparent inertia", &|c| c.measures.inertia / two.inertia),
    ];
    report.plot(
        "wheels",
        "The prototype's wheel two, three and four times, relative to two",
        bars("More wheels", "times that of two wheels", &all.concat()),
    );
    let all = [
        group("all wheels slip at random", &|c| c.seen.mean),
        group("one wheel slips alone, mean", &|c| c.seen.single),
        group("one wheel slips alone, worst", &|c| c.seen.single_least),
    ];
    report.plot(
        "wheels_slip",
        "How much of the contacts' slip the residual of the joint rates shows",
        bars("Slip that can be observed", "share of the slip's energy that is seen", &all.concat()),
    );
}

fn checks(report: &mut Report, counts: &[Count]) {
    let off = |c: &Count| (c.seen.mean - (2 * c.wheels - 3) as f64 / (2 * c.wheels) as f64).abs();
    let worst = counts.iter().map(off).fold(0.0, f64::max);
    // Four times the standard error of 20,000 samples of a share with a spread of about 0.4.
    let bound = 4.0 * 0.4 / libm::sqrt(SLIPS as f64);
    report.check(
        format!("the share of random slips that is seen is (2n - 3)/(2n) within {bound:.3}"),
        format!("{worst:.4} at worst"),
        worst <= bound,
    );
    // The smallest eigenvalue of a projection of rank 1 in a plane is zero except for rounding.
    report.check(
        "some slips of one wheel alone are never seen with two wheels, and all are with three and four",
        counts.iter().map(|c| format!("{:.3}", c.seen.single_least)).collect::<Vec<_>>().join(", "),
        counts[0].seen.single_least < 1.0e-9 && counts[1..].iter().all(|c| c.seen.single_least > 0.01),
    );
    report.check(
        "without one wheel's motors two wheels cannot make every torque, three and four can",
        counts.iter().map(|c| format!("{:.3} N m", c.one_dead)).collect::<Vec<_>>().join(", "),
        counts[0].one_dead < 1.0e-9 && counts[1..].iter().all(|c| c.one_dead > 0.05),
    );
    let rises = |of: fn(&Count) -> f64| counts.windows(2).all(|pair| of(&pair[1]) > of(&pair[0]));
    let gains = rises(|c| c.measures.torque)
        && rises(|c| c.one_dead)
        && rises(|c| 1.0 / c.measures.load)
        && rises(|c| c.measures.inertia)
        && rises(|c| c.measures.gci);
    report.check(
        "peak torque, also where one wheel is dead, torque before slip, conditioning, and apparent inertia grow with every wheel",
        if gains { "they do" } else { "they do not" },
        gains,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(wheels: usize) -> Device {
        let parts = Parts::prototype();
        parts.device(&Design { wheels, ..parts.prototype }).expect("legal")
    }

    /// The mean share of a single wheel's slip that the joint rates reveal is (2n - 3)/(2n), as for
    /// slips of all wheels. The trace of the residual's projection is 2n - 3 at every posture, and
    /// all wheels have equal parts of it.
    #[test]
    fn a_single_wheels_share_is_that_of_all_in_the_mean() {
        for wheels in WHEELS {
            let [mean, _] = single(&device(wheels));
            assert!((mean - (2 * wheels - 3) as f64 / (2 * wheels) as f64).abs() < 1e-12, "{mean}");
        }
    }

    /// With another random seed, the revealed share of the slip changes only within its standard
    /// error.
    #[test]
    fn chance_moves_the_share_within_its_error() {
        for seed in [1, 2, 3] {
            let share = share_seen(&device(3), seed);
            assert!((share - 0.5).abs() < 4.0 * 0.4 / libm::sqrt(SLIPS as f64), "{share}");
        }
    }
}
