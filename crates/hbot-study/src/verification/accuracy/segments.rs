//! Accuracy of odometry while the joints turn at constant rates. The error is then that of the
//! method alone.

use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::OdometryMethod;
use hbot_core::{Device, Vec3};
use hbot_plot::{Lines, Series};
use hbot_sim::motion::{JOINTS, WHEELS, angle, segment};

use super::motions::Times;
use super::order::Errors;
use super::{DRIFT_S, RATES, in_both_widths, median, sci};
use crate::context::Context;
use crate::report::{Report, row};
use crate::rng::Rng;
use crate::verification::double::stages::odometry::{METHODS, ORDERS};

/// A motion in which the joints turn at constant rates: the initial steer angles (rad), the joint
/// rates (rad/s) and the exact final orientation of the sphere.
struct Segment {
    th: [f64; WHEELS],
    zd: [f64; JOINTS],
    end: [f64; 4],
}

/// Angular speed of the sphere at the start of each turn, rad/s.
const SPEED: f64 = 3.0;
/// Reading rates that are used only to measure the order of a method, Hz. No real control loop is
/// so slow.
const SLOW: [u32; 2] = [125, 250];
/// Smallest drift that can be measured, rad: the rounding error of some ten thousand steps of
/// 1e-16. At higher rates, the difference between the method magnus4 and the reference becomes no
/// smaller than this.
const FLOOR: f64 = 3.0e-14;

fn segments(device: &Device, count: usize) -> Vec<Segment> {
    let mut rng = Rng(11);
    (0..count)
        .map(|_| {
            let th = core::array::from_fn(|_| rng.between(-3.0, 3.0));
            let omega = Vec3::from_array(rng.direction()) * SPEED;
            let rates = Posture::new(device, &th).inverse(omega);
            let zd = core::array::from_fn(|j| rates[j]);
            Segment { th, zd, end: segment(device, th, &zd, DRIFT_S) }
        })
        .collect()
}

pub(super) fn study(context: &Context, report: &mut Report, device: &Device, times: &Times) {
    context.part("odometry: the method's error");
    introduce(report);
    let segments = segments(device, if context.quick { 15 } else { 45 });
    let mut table = vec![row(["method", "width"])];
    table[0].extend(RATES.map(|hz| format!("{hz} Hz")));
    let mut lines = Vec::new();
    let mut orders = Vec::new();
    in_both_widths!(stages => {
        let device = stages::device(device);
        let drift = |method, hz: u32| {
            let ticks = (DRIFT_S * f64::from(hz)).round() as u32;
            let h = 1.0 / f64::from(hz);
            median(segments.iter().map(|s| angle(stages::odometry::segment(&device, method, s.th, &s.zd, h, ticks), s.end)).collect())
        };
        for (method, (name, _)) in METHODS.iter().enumerate() {
            let drifts = RATES.map(|hz| drift(method, hz));
            for (hz, drift) in RATES.iter().zip(drifts) {
                report.figure(format!("odometry_segments_{name}_{}_{hz}hz_drift_rad", stages::WIDTH), drift);
            }
            table.push(row([*name, stages::WIDTH].into_iter().map(str::to_owned).chain(drifts.map(sci))));
            let points = RATES.iter().zip(drifts).map(|(hz, drift)| (times.us_per_second(stages::WIDTH, method, 0, *hz), drift)).collect();
            lines.push(Series::new(format!("{name}, {}", stages::WIDTH), points, method).open(stages::WIDTH == "f32"));
            if stages::WIDTH == "f64" {
                let slow = SLOW.iter().map(|hz| (*hz, drift(method, *hz)));
                let all = slow.chain(RATES.into_iter().zip(drifts));
                orders.push((method, Errors(all.map(|(hz, drift)| (1.0 / f64::from(hz), drift)).collect())));
            }
        }
    });
    report.table(&table);
    rounding(report, device, &segments);
    for (method, errors) in orders {
        let what = format!("odometry at constant rates, {}, f64", METHODS[method].0);
        errors.check(report, &what, FLOOR, ORDERS[method]);
    }
    draw(report, lines);
}

fn introduce(report: &mut Report) {
    report.heading("Odometry: the method's error");
    report.say(&format!(
        "Joints turn at constant rates for {DRIFT_S} s, as they do in the first moment of a sphere that turns with {SPEED} rad/s: so the \
         path between two readings is known, and what is left is the method's error. Drift is the angle at the end; the median of turns \
         that begin at any steering angles."
    ));
    report.family("odometry_segments_{method}_{width}_{rate}hz_drift_rad | rad | drift in 0.6 s of joints at constant rates, median of brisk turns");
}

fn draw(report: &mut Report, lines: Vec<Series>) {
    report.lines(
        "odometry_segments",
        "Odometry at constant joint rates: drift in 0.6 s against the time that it takes; each line from 500 Hz (left) to 8 kHz",
        Lines::new(
            "The method's error",
            "microseconds of computing for a second of motion",
            "drift in 0.6 s, rad",
            lines,
        )
        .log([true; 2])
        .front(),
    );
}

/// Reports where f32 loses accuracy. The turns of the sphere between readings are computed in f64
/// and rounded to f32. They are then combined to an orientation in f32 in two ways, whose errors
/// are compared.
fn rounding(report: &mut Report, device: &Device, segments: &[Segment]) {
    report.family("odometry_rounding_{way}_{width}_{rate}hz_drift_rad | rad | drift in 0.6 s of f64's turns combined in either width: by the product of quaternions, or by adding the change that it makes");
    report.say(
        "How the turns are combined. Here they are those of magnus4 in f64, rounded to the width. The *product* is exp(turn) q, as in the core in f64. The \
         *change* adds exp(turn) q - q, in which no number near 1 is multiplied, as in the core in f32:",
    );
    let mut table = vec![row(["combined by", "width"])];
    table[0].extend(RATES.map(|hz| format!("{hz} Hz")));
    let turned = RATES.map(|hz| segments.iter().map(|s| turns(device, s, hz)).collect::<Vec<_>>());
    in_both_widths!(stages => {
        for (index, (way, _)) in stages::odometry::WAYS.into_iter().enumerate() {
            let off = |(turns, s): (&Vec<[f64; 3]>, &Segment)| angle(stages::odometry::after(turns, index), s.end);
            let drifts = turned.each_ref().map(|all| median(all.iter().zip(segments).map(off).collect()));
            for (hz, drift) in RATES.iter().zip(drifts) {
                report.figure(format!("odometry_rounding_{way}_{}_{hz}hz_drift_rad", stages::WIDTH), drift);
            }
            table.push(row([way, stages::WIDTH].into_iter().map(str::to_owned).chain(drifts.map(sci))));
        }
    });
    report.table(&table);
}

/// Returns the turns of the sphere between readings at `hz` readings per second, as rotation
/// vectors in frame N, rad. They are computed with the method magnus4 in f64.
fn turns(device: &Device, segment: &Segment, hz: u32) -> Vec<[f64; 3]> {
    let h = 1.0 / f64::from(hz);
    let delta = segment.zd.map(|rate| rate * h);
    let turn = |k: u32| {
        let t = f64::from(k) * h;
        let th: [f64; WHEELS] = core::array::from_fn(|i| segment.th[i] + segment.zd[2 * i] * t);
        hbot_core::motion::odometry::turn(device, OdometryMethod::Magnus4, &th, &delta).to_array()
    };
    (0..(DRIFT_S * f64::from(hz)).round() as u32).map(turn).collect()
}
