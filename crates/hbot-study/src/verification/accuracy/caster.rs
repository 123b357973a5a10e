//! The caster effect of a wheel. When the sphere pushes a wheel backwards, the wheel turns around,
//! and a rounding error of its heading grows to a large angle.

use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, Quat, Vec3, rotation};
use hbot_plot::{Lines, Series, short};
use hbot_sim::extrapolation;
use hbot_sim::plant::{Method, Plant, PlantState, SpringDamper};

use super::sci;
use crate::context::Context;
use crate::report::{Report, row};

/// Initial error of a wheel's heading, rad. It is far larger than rounding errors. After the sphere
/// has turned by [`TURN`], the error has grown, but is still far below one radian.
const OFF: f64 = 1.0e-7;
/// Angle by which the sphere turns while it pushes the wheel backwards, rad.
const TURN: f64 = 1.0;

pub(super) fn study(context: &Context, report: &mut Report, device: &Device) {
    context.part("the caster's sensitivity");
    report.heading("The caster's exponential sensitivity");
    report.say(
        "A wheel that is rolled forwards comes into line, one that is pushed backwards turns about: its heading error grows by \
         exp(cot a x the angle turned), whatever computes it. Below, two integrators of order 4 follow one free sphere on a spring at 1 ms a \
         step. Each is right to its order; after some reversals their wheels are elsewhere, and so then is the sphere. Energy and the unit norm, \
         which do not depend on where the wheels stand, go on to agree. So two trajectories may be compared over short times or without \
         reversals, and over long ones only what is conserved.",
    );
    report.family("caster_growth_per_rad_{what} | 1 | growth of a heading error while the sphere turns 1 rad against the wheel: measured, and predicted exp(cot a)");
    report.family("caster_{what}_apart_{unit} | rad or J | how far rk4 and rkmk4 at 1 ms are apart after 10 s of a free sphere on a spring");
    let (measured, predicted) = (growth(device), libm::exp(1.0 / libm::tan(device.wheels()[0].spec().cone)));
    report.figure("caster_growth_per_rad_measured".to_owned(), measured);
    report.figure("caster_growth_per_rad_predicted".to_owned(), predicted);
    // The prediction is linear in the error. The part that it omits is about 291² x 1e-7.
    report.check(
        "a heading error grows by exp(cot a) a radian, to 0.1 %",
        format!("{} against {}", short(measured), short(predicted)),
        (measured / predicted - 1.0).abs() < 1.0e-3,
    );
    part_ways(report, device);
}

/// Returns the factor by which an error of a wheel's heading grows while the sphere turns 1 rad and
/// pushes the wheel backwards.
fn growth(device: &Device) -> f64 {
    let th = [0.4, -0.7];
    // The sphere turns about the axle of wheel 1. In one of the two senses this pushes the wheel
    // backwards, so that its heading is unstable.
    let omega = Posture::new(device, &th).frames()[0].c1;
    let ends = [1.0, -1.0].map(|sense| {
        let rate = |_: f64, y: &[f64; 1]| [Posture::new(device, &[y[0], th[1]]).inverse(omega * sense)[0]];
        let mut y = [th[0] + OFF];
        for k in 0..200 {
            y = extrapolation::advance(&rate, f64::from(k) * TURN / 200.0, TURN / 200.0, &y);
        }
        ((y[0] - th[0]) / OFF).abs()
    });
    // The other sense is the stable one, in which the error shrinks.
    ends[0].max(ends[1])
}

/// Simulates one motion with two integration methods, and reports how far their results differ.
fn part_ways(report: &mut Report, device: &Device) {
    let Ok(plant) = Plant::new(device) else { unreachable!("the prototype is a plant") };
    let spring = SpringDamper { stiffness: 1.0, damping: 0.0, reference: Quat::IDENTITY };
    let start = PlantState { q: rotation::exp(Vec3::new(1.4, -1.0, 0.8)), ..PlantState::default() };
    let energy = |s: &PlantState| plant.energy(s) + 0.5 * rotation::log(s.q).length_squared();
    let (mut a, mut b) = (start, start);
    let h = 1.0e-3;
    let mut series = ["steering angles, rad", "orientations, rad", "energies, J"]
        .map(|name| Series::new(name.to_owned(), Vec::new(), 0));
    let mut last = [0.0; 3];
    for k in 0..10_000 {
        let t = f64::from(k) * h;
        plant.step(Method::Rk4, &mut a, t, h, &[0.0; 16], &spring);
        plant.step(Method::Rkmk4, &mut b, t, h, &[0.0; 16], &spring);
        last = [
            (a.steer[0] - b.steer[0]).abs().max((a.steer[1] - b.steer[1]).abs()),
            rotation::angle_between(a.q, b.q),
            (energy(&a) - energy(&b)).abs(),
        ];
        if k % 50 == 49 {
            for (series, value) in series.iter_mut().zip(last) {
                series.points.push((t + h, value));
            }
        }
    }
    for (colour, series) in series.iter_mut().enumerate() {
        series.colour = colour;
    }
    for (id, value) in [("steer_apart_rad", 0), ("orientation_apart_rad", 1), ("energy_apart_j", 2)] {
        report.figure(format!("caster_{id}"), last[value]);
    }
    report.table(&[
        row(["apart after 10 s", ""]),
        row(["steering angles", &format!("{} rad", sci(last[0]))]),
        row(["orientations", &format!("{} rad", sci(last[1]))]),
        row(["energies, of 1.8 J", &format!("{} J", sci(last[2]))]),
    ]);
    report.lines(
        "caster",
        "How far rk4 and rkmk4, both at 1 ms, come apart on one free sphere",
        Lines::new("Two correct integrators part ways", "time, s", "apart", series.to_vec())
            .log([false, true]),
    );
}
