//! Accuracy of allocation: the size and direction of the torque that each method makes within the
//! joint torque limits, and its computing time.

use core::f64::consts::TAU;

use hbot_core::allocation::{JointLimits, capability};
use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, Vec3, WheelSpec};
use hbot_plot::{Lines, Series, short};

use super::{in_both_widths, median, sci};
use crate::context::Context;
use crate::report::{Report, row};
use crate::rng::Rng;
use crate::timing::{Time, Timed, in_turn};
use crate::verification::double::stages::allocation::METHODS;

/// Sizes of the wanted torques, in per cent of the largest torque that the joints can make in the
/// wanted direction.
const PERCENT: [u32; 4] = [50, 100, 150, 200];
/// Torque limits of the prototype's steer and drive joints, N m.
const PEAKS: [f64; 2] = [0.93, 0.14];

/// Returns a device with `wheels` wheels like the prototype's, evenly spaced on a ring 45 degrees
/// below the equator.
pub(crate) fn ring(prototype: &Device, wheels: usize) -> Device {
    let spec = |k: usize| {
        let (s, c) = libm::sincos(TAU * k as f64 / wheels as f64);
        WheelSpec { axis: Vec3::new(c, s, -1.0), ..*prototype.wheels()[0].spec() }
    };
    let all: Vec<WheelSpec> = (0..wheels).map(spec).collect();
    let device = Device::new(prototype.sphere_radius(), prototype.sphere_mass(), &all);
    device.unwrap_or_else(|error| unreachable!("an even ring of wheels is a legal design: {error}"))
}

/// A wanted torque on the sphere at a posture, and the largest torque in the same direction, up to
/// the wanted one, that the joints can make. Both are in frame N, in N m.
struct Asked {
    th: Vec<f64>,
    wanted: Vec3,
    best: Vec3,
}

fn asked(device: &Device, percent: u32, count: usize) -> Vec<Asked> {
    let mut rng = Rng(7);
    let limits = JointLimits::of_device(device, |joint| PEAKS[joint % 2]);
    (0..count)
        .map(|_| {
            let th: Vec<f64> = device.wheels().iter().map(|_| rng.between(-3.0, 3.0)).collect();
            let direction = Vec3::from_array(rng.direction());
            let most = capability(Posture::new(device, &th).rows(), &limits, direction);
            let part = f64::from(percent) / 100.0;
            Asked { th, wanted: direction * (most * part), best: direction * (most * part.min(1.0)) }
        })
        .collect()
}

/// The results of one allocation method for all wanted torques of one size, in one floating-point
/// width.
struct Found {
    /// Name of the method, and its index in [`METHODS`].
    method: (&'static str, usize),
    width: &'static str,
    wheels: usize,
    /// Size of the wanted torques, in per cent of the largest torque that the joints can make.
    percent: u32,
    /// For each posture: the difference between the best possible torque and the torque that the
    /// method made, relative to the best possible torque.
    shortfalls: Vec<f64>,
    /// For each posture: the angle between the torque that the method made and the wanted torque,
    /// rad.
    turns: Vec<f64>,
}

pub(super) fn study(context: &Context, report: &mut Report, prototype: &Device) {
    context.part("allocation");
    introduce(report);
    let (found, mut timed) = measured(context, prototype);
    context.part("allocation: time");
    let times = in_turn(context.quick, &mut timed);
    tell(report, &found, &times);
}

fn introduce(report: &mut Report) {
    report.heading("Allocation");
    report.say(
        "Joint torques for a torque on the sphere at random postures and directions, at 50 % to 200 % of what the joints can make in that \
         direction, for 2 to 8 of the prototype's wheels in a ring. *exact* (as rig files have it) makes all that can be made in the direction asked for; *clipped* (likewise) \
         takes the joint torques of least cost and scales them as a whole, so that the direction stays; *cut* cuts each of those at its own limit, which is here for \
         comparison alone and which no rig file can ask for: it turns the torque. The shortfall is |T made - T best| / |T best|, where T best is the most that the joints can make in that \
         direction, by the facets of the polytope in f64; the direction's error is the angle between T made and T asked for. Medians of the postures; the \
         worst is noted beside them in summary.json.",
    );
    report.family("allocation_{method}_{width}_{wheels}w_{percent}pct_shortfall | 1 | torque that is missing, relative to the best; median");
    report.family("allocation_{method}_{width}_{wheels}w_{percent}pct_direction_rad | rad | angle between the torque made and the one asked for; median");
    report.family(
        "allocation_{method}_{width}_{wheels}w_{percent}pct_ns | ns | one allocation, mean over the postures",
    );
}

/// Runs every allocation method in f64 and in f32. Returns the results, and the code whose
/// computing time is to be measured.
fn measured(context: &Context, prototype: &Device) -> (Vec<Found>, Vec<Timed<'static>>) {
    let count = if context.quick { 32 } else { 128 };
    let (mut found, mut timed) = (Vec::new(), Vec::new());
    for wheels in 2..=8 {
        let device = ring(prototype, wheels);
        for percent in PERCENT {
            let asked = asked(&device, percent, count);
            in_both_widths!(stages => {
                let device = stages::device(&device);
                let cases: Vec<_> = asked
                    .iter()
                    .map(|a| stages::allocation::Case::new(&device, &a.th, PEAKS, a.wanted.to_array()))
                    .collect();
                for method in 0..METHODS.len() {
                    let made: Vec<Vec3> = cases.iter().map(|case| Vec3::from_array(case.made(method))).collect();
                    let pairs = || made.iter().zip(&asked);
                    found.push(Found {
                        method: (METHODS[method], method),
                        width: stages::WIDTH,
                        wheels,
                        percent,
                        shortfalls: pairs().map(|(m, a)| (*m - a.best).length() / a.best.length()).collect(),
                        turns: pairs()
                            .map(|(m, a)| libm::atan2(m.cross(a.wanted).length(), m.dot(a.wanted)))
                            .collect(),
                    });
                    timed.push(stages::allocation::timed(method, cases.clone()));
                }
            });
        }
    }
    (found, timed)
}

fn worst(all: &[f64]) -> f64 {
    all.iter().copied().fold(0.0, f64::max)
}

fn tell(report: &mut Report, found: &[Found], times: &[Time]) {
    let mut table = vec![row(["method", "width", "wheels", "asked, %", "shortfall", "direction, rad", "ns"])];
    let mut lines: Vec<Series> = Vec::new();
    for (Found { method: (method, colour), width, wheels, percent, shortfalls, turns }, time) in
        found.iter().zip(times)
    {
        let id = |what: &str| format!("allocation_{method}_{width}_{wheels}w_{percent}pct_{what}");
        let (short_of, turned) = (median(shortfalls.clone()), median(turns.clone()));
        report.figure(id("shortfall"), short_of).note("worst", worst(shortfalls));
        report.figure(id("direction_rad"), turned).note("worst", worst(turns));
        report.time(id("ns"), *time);
        if wheels % 2 == 0 && (*percent == 50 || *percent == 150) {
            let cells = [method, *width, &wheels.to_string(), &percent.to_string()].map(str::to_owned);
            table.push(row(cells.into_iter().chain([sci(short_of), sci(turned), short(time.median)])));
        }
        if *percent == 150 {
            let name = format!("{method}, {width}");
            let point = (*wheels as f64, time.median);
            match lines.iter_mut().find(|s| s.name == name) {
                Some(series) => series.points.push(point),
                None => {
                    lines.push(Series::new(name, vec![point], *colour).open(*width == "f32"));
                }
            }
        }
    }
    let exact = found.iter().filter(|of| of.method.1 == 0 && of.width == "f64");
    let worst_exact = exact.map(|of| worst(&of.shortfalls)).fold(0.0, f64::max);
    report.table(&table);
    // The postures of a ring are well conditioned. The general solution loses some hundred
    // roundings there.
    report.check(
        "exact allocation, f64: all of what can be made, to 1e-9",
        sci(worst_exact),
        worst_exact < 1.0e-9,
    );
    report.lines(
        "allocation",
        "What one allocation takes where 150 % of the capability is asked for",
        Lines::new("Allocation at 150 % of the capability", "wheels", "ns", lines).log([false, true]),
    );
}
