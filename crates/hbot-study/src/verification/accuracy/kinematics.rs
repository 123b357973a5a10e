//! Accuracy of kinematics near singular designs.

use hbot_config::RigConfig;
use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, Vec3, WheelSpec};
use hbot_plot::{Lines, Series};

use super::{in_both_widths, median, sci};
use crate::context::Context;
use crate::report::{Report, row};
use crate::rng::Rng;

/// Smallest angles, over all postures, between the two contacts of the tested designs, in
/// millidegrees.
const GAPS: [u32; 5] = [30_000, 10_000, 1000, 100, 10];
/// Cone angles of the tested designs, in microradians.
const CONES: [u32; 5] = [174_500, 30_000, 10_000, 1000, 100];

fn wheel(angle: f64, cone: f64) -> WheelSpec {
    let (s, c) = libm::sincos(angle);
    let own = *RigConfig::prototype().rig.device.wheels()[0].spec();
    WheelSpec { axis: Vec3::new(s, 0.0, -c), cone, ..own }
}

/// Returns a nearly singular device: two wheels whose contacts can come within `gap` (rad) of each
/// other.
fn nearly_meeting(gap: f64) -> Device {
    let (cone, half) = (0.1745, 0.5 * gap);
    made(&[wheel(cone + half, cone), wheel(-cone - half, cone)])
}

/// Returns a nearly singular device: two wheels whose cone angle is only `cone`, rad.
fn nearly_upright(cone: f64) -> Device {
    made(&[wheel(0.785, cone), wheel(-0.785, cone)])
}

fn made(wheels: &[WheelSpec]) -> Device {
    let device = Device::new(0.102, 0.467, wheels);
    device.unwrap_or_else(|error| unreachable!("a hair from singular is legal: {error}"))
}

/// Returns the steer angles (rad) at which the contacts of the two wheels are nearest to each
/// other, found by search.
fn nearest(device: &Device) -> [f64; 2] {
    let apart = |th: &[f64; 2]| {
        let posture = Posture::new(device, th);
        1.0 - posture.frames()[0].c3.dot(posture.frames()[1].c3)
    };
    // By symmetry, each wheel then stands at a multiple of a quarter turn.
    let quarters = [0.0, 0.5, 1.0, 1.5].map(|x| x * core::f64::consts::PI);
    let all = quarters.iter().flat_map(|a| quarters.iter().map(move |b| [*a, *b]));
    all.min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or([0.0; 2])
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("kinematics near singular designs");
    introduce(report);
    let mut rng = Rng(5);
    let directions: Vec<Vec3> = (0..64).map(|_| Vec3::from_array(rng.direction())).collect();
    let gaps = GAPS.map(|gap| {
        (format!("gap_{gap}mdeg"), f64::from(gap), nearly_meeting((f64::from(gap) / 1000.0).to_radians()))
    });
    let cones = CONES
        .map(|cone| (format!("cone_{cone}urad"), f64::from(cone), nearly_upright(f64::from(cone) * 1.0e-6)));
    let mut table = vec![row(["design", "width", "margin sigma_min(Z)/R", "error"])];
    let mut lines = Vec::new();
    for (what, designs, colour) in
        [("gap, thousandths of a degree", &gaps, 0), ("cone, microradians", &cones, 1)]
    {
        in_both_widths!(stages => {
            let mut points = Vec::new();
            for (id, x, device) in designs {
                let th = nearest(device);
                let posture = Posture::new(device, &th);
                let narrow = stages::device(device);
                let error = |omega: &Vec3| {
                    let zd = posture.inverse(*omega);
                    (Vec3::from_array(stages::kinematics::rate(&narrow, &th, &zd[..4])) - *omega).length()
                };
                let error = median(directions.iter().map(error).collect());
                report.figure(format!("kinematics_{}_{id}_error", stages::WIDTH), error);
                let margin = hbot_core::design::singularity::interior_margin(&posture);
                table.push(row([id.as_str(), stages::WIDTH, &sci(margin), &sci(error)]));
                points.push((*x, error));
            }
            lines.push(Series::new(format!("{what}, {}", stages::WIDTH), points, colour).open(stages::WIDTH == "f32"));
        });
    }
    report.table(&table);
    report.lines(
        "kinematics",
        "Error of the sphere's rate in designs a hair from singular",
        Lines::new(
            "Near singular designs",
            "gap (thousandths of a degree) or cone (microradians)",
            "error of the rate, relative",
            lines,
        )
        .log([true; 2]),
    );
}

fn introduce(report: &mut Report) {
    report.heading("Kinematics near singular designs");
    report.say(
        "The sphere's rate from joint rates that belong to a known one, in the posture where the contact points come nearest (*gap*), or with \
         cones so small that steering hardly moves the contact (*cone*). Errors are relative to the rate, medians over directions. The joint rates are \
         rounded to the width first: near an interior singularity an error of a rate across the line through the contacts grows as 1/margin², \
         the square of what the design's margin says.",
    );
    report.family("kinematics_{width}_gap_{gap}mdeg_error | 1 | error of the rate, contact points {gap} millidegrees apart");
    report.family(
        "kinematics_{width}_cone_{cone}urad_error | 1 | error of the rate, cone angle {cone} microradians",
    );
}
