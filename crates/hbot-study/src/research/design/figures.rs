//! The figures of one design, for tables and summary.json.

use super::margins::grip;
use super::space::{Design, Parts};
use super::torus::Measures;
use crate::report::{Family, Report};

/// One kind of figure that is reported of designs, such as the peak torque: its name in ids, its
/// unit, its meaning, and its value.
type Told = (&'static str, &'static str, &'static str, fn(&Parts, &Design, &Measures) -> f64);

const TOLD: [Told; 18] = [
    ("cone_rad", "rad", "cone angle", |_, d, _| d.cone),
    ("toe_rad", "rad", "toe angle", |_, d, _| d.toe),
    ("tilt_rad", "rad", "angle of the steering axes from -n3", |_, d, _| d.tilt),
    ("radius_m", "m", "wheel radius", |_, d, _| d.radius),
    (
        "gci",
        "1",
        "global conditioning index: mean spectral index of G over all steering angles",
        |_, _, m| m.gci,
    ),
    (
        "conditioning_least",
        "1",
        "least spectral index over all steering angles: the actuation margin",
        |_, _, m| m.conditioning,
    ),
    ("torque", "N m", "peak torque of the motors in the worst direction at the worst posture", |_, _, m| {
        m.torque
    }),
    (
        "torque_5pct",
        "N m",
        "peak torque in the worst direction, which 5 % of postures are below",
        |_, _, m| m.torque_low,
    ),
    (
        "inertia",
        "kg m²",
        "largest eigenvalue of the apparent inertia over all steering angles",
        |_, _, m| m.inertia,
    ),
    ("inertia_mean", "kg m²", "mean of the largest eigenvalue of the apparent inertia", |_, _, m| {
        m.inertia_mean
    }),
    (
        "steering_speed",
        "1",
        "steering rate at most, for a sphere that turns at 1 rad/s: 1/(sin a cos b)",
        |_, _, m| m.speed[0],
    ),
    ("drive_speed", "1", "drive rate at most, for a sphere that turns at 1 rad/s: R/(r cos b)", |_, _, m| {
        m.speed[1]
    }),
    (
        "contact_force",
        "N/(N m)",
        "largest contact force for a torque of 1 N m in the worst direction at the worst posture",
        |_, _, m| m.load,
    ),
    (
        "slip_torque",
        "N m",
        "torque in the worst direction at the worst posture at which the first contact slips, at the prototype's normal force on each wheel",
        |p, _, m| m.slips_from(grip(p)),
    ),
    ("usable_torque", "N m", "the lesser of torque and slip_torque", |p, _, m| {
        m.torque.min(m.slips_from(grip(p)))
    }),
    (
        "interior",
        "1",
        "sigma_min(Z)/R over all steering angles, exact for two wheels, a lower bound for more",
        |_, _, m| m.interior,
    ),
    ("gap_rad", "rad", "angle left between neighbouring modules", |p, d, _| d.gap(p.sphere_radius())),
    ("headroom_rad", "rad", "angle left between modules and the open half", |p, d, _| {
        d.headroom(p.sphere_radius())
    }),
];

/// Declares the figures of designs, with their units and meanings. The ids of the designs begin
/// with `stem`, in which `{...}` stands for a part that varies.
pub(super) fn families(report: &mut Report, stem: &str) {
    for (name, unit, meaning, _) in TOLD {
        report.meaning(Family { pattern: format!("{stem}_{name}"), unit, meaning });
    }
}

/// Reports all figures of a design. The id of each figure begins with `stem`.
pub(super) fn figures(report: &mut Report, stem: &str, parts: &Parts, design: &Design, measures: &Measures) {
    for (name, _, _, of) in TOLD {
        report.figure(format!("{stem}_{name}"), of(parts, design, measures));
    }
}
