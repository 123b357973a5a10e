//! Accuracy of the spring laws and of their first-order forms.

use hbot_core::{Mat3, Vec3};
use hbot_plot::{Lines, Series};

use super::{in_both_widths, sci};
use crate::context::Context;
use crate::report::{Report, row, spread};
use crate::timing::in_turn;
use crate::verification::double::stages::spring::{LAWS, STIFFNESS};

/// Angles of the sphere at which the spring torque is tested, in milliradians.
const ANGLES: [u32; 9] = [1, 3, 10, 30, 100, 300, 1000, 2000, 3000];
/// Unit axes of the turns at which the spring torque is tested; the largest error is reported. None
/// of them is a principal axis of the stiffness, because the first-order forms are more accurate
/// there.
const AXES: [Vec3; 3] = [Vec3::new(0.6, 0.48, 0.64), Vec3::new(-0.36, 0.48, 0.8), Vec3::new(0.8, -0.6, 0.0)];

/// Returns the exact torque of a spring law, N m, for a sphere that is turned by the rotation
/// vector `p` (rad). The formula is evaluated directly from `p`, without a logarithm and without
/// the square root of a difference. `law` is the index of the law.
fn truth(law: usize, p: Vec3) -> Vec3 {
    let k = Mat3::from_diagonal(Vec3::from_array(STIFFNESS));
    let t = p.length();
    if law < 2 {
        let kp = k * p;
        let cross = p.cross(kp);
        let half = 0.5 * t;
        let c = if t < 0.1 {
            let t2 = t * t;
            1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 * (1.0 / 30_240.0 + t2 * (1.0 / 1_209_600.0)))
        } else {
            (1.0 - half / libm::tan(half)) / (t * t)
        };
        -(kp + cross * 0.5 + p.cross(cross) * c)
    } else {
        let (s, eta) = libm::sincos(0.5 * t);
        let e = p * (s / t);
        let ke = k * e;
        (ke * eta + e.cross(ke)) * -2.0
    }
}

/// Returns the largest error of a spring law over all [`AXES`], relative to the size of the torque.
/// `at` evaluates the law in f64 or in f32.
fn error(law: usize, angle: f64, at: impl Fn(usize, [f64; 4]) -> [f64; 3]) -> f64 {
    let off = |axis: Vec3| {
        let (s, c) = libm::sincos(0.5 * angle);
        let torque = at(law, [c, axis.x * s, axis.y * s, axis.z * s]);
        let truth = truth(law, axis * angle);
        (Vec3::from_array(torque) - truth).length() / truth.length()
    };
    AXES.into_iter().map(off).fold(0.0, f64::max)
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("spring laws");
    introduce(report);
    let (mut names, mut timed) = (Vec::new(), Vec::new());
    in_both_widths!(stages => {
        for law in 0..LAWS.len() {
            names.push((law, stages::WIDTH));
            timed.push(stages::spring::timed(law));
        }
    });
    let times = in_turn(context.quick, &mut timed);
    let mut table = vec![row(["law", "width", "ns (quartiles)"])];
    table[0].extend([10, 100, 1000, 3000].map(|angle| format!("error at {} rad", f64::from(angle) / 1000.0)));
    let mut lines = Vec::new();
    for ((law, width), time) in names.into_iter().zip(times) {
        let name = LAWS[law];
        let errors = ANGLES.map(|angle| {
            let angle = f64::from(angle) / 1000.0;
            if width == "f64" {
                error(law, angle, crate::verification::double::stages::spring::at)
            } else {
                error(law, angle, crate::verification::single::stages::spring::at)
            }
        });
        report.time(format!("spring_{name}_{width}_ns"), time);
        for (angle, error) in ANGLES.iter().zip(errors) {
            report.figure(format!("spring_{name}_{width}_{angle}mrad_error"), error);
        }
        let shown = [2, 4, 6, 8].map(|k| sci(errors[k]));
        table.push(row([name, width, &spread(time)].map(str::to_owned).into_iter().chain(shown)));
        check(report, name, width, errors);
        lines.push(
            Series::new(
                format!("{name}, {width}: {:.0} ns", time.median),
                ANGLES.iter().zip(errors).map(|(angle, error)| (f64::from(*angle) / 1000.0, error)).collect(),
                law,
            )
            .open(width == "f32"),
        );
    }
    report.table(&table);
    report.lines(
        "spring",
        "Error of a spring's torque over the angle, with what one torque takes",
        Lines::new("Spring laws", "angle, rad", "error relative to the torque", lines).log([true; 2]),
    );
}

fn introduce(report: &mut Report) {
    report.heading("Spring laws");
    report.say(
        "Torque of an uneven spring (4, 2, 1 N m/rad) turned by an angle about skew axes, against the law's own formula in the turn. The \
         first-order forms leave out what is of the next order in the angle: -K log q and -2 K e. They are no gradients: round a closed path \
         they give out energy.",
    );
    report.family("spring_{law}_{width}_{angle}mrad_error | 1 | error of the torque relative to its size at that angle, largest over some axes");
    report.family("spring_{law}_{width}_ns | ns | one torque");
}

/// Adds the check of one form of the spring law to the report. The error of an exact form must not
/// exceed 64 roundings. The relative error of an approximate form must grow linearly with the
/// angle; this is checked in f64.
fn check(report: &mut Report, name: &str, width: &str, errors: [f64; ANGLES.len()]) {
    if name.ends_with("exact") {
        let worst = errors.into_iter().fold(0.0, f64::max);
        // Some tens of roundings; nearer to a half turn the logarithm's Jacobian grows, and they
        // with it.
        let bound = if width == "f64" { 64.0 * f64::EPSILON } else { 64.0 * f64::from(f32::EPSILON) };
        report.check(
            format!("spring law {name}, {width}: within 64 roundings of its formula"),
            sci(worst),
            worst < bound,
        );
    } else if width == "f64" {
        let order = (errors[3] / errors[2]).ln() / 3.0_f64.ln();
        report.check(
            format!(
                "spring law {name}, {width}: its relative error is of the order 1 in the angle, within 0.1"
            ),
            format!("{order:.3}"),
            (order - 1.0).abs() < 0.1,
        );
    }
}
