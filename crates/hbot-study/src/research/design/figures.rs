//! The figures of one design, for tables and summary.json.

use super::margins::grip;
use super::space::{Design, Parts};
use super::torus::Measures;
use crate::report::{Family, Report};

/// One kind of figure that is reported of designs, such as the peak torque: its name in ids, its
/// unit, its meaning, and the patterns of the ids.
pub(super) struct Told {
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    families: [&'static str; 3],
    of: fn(&Parts, &Design, &Measures) -> f64,
}

macro_rules! told {
    ($name:literal, $unit:literal, $meaning:literal, $of:expr) => {
        Told {
            name: $name,
            unit: $unit,
            meaning: $meaning,
            families: [
                concat!("design_prototype_", $name),
                concat!("design_best_{wheels}w_{which}_", $name),
                concat!("design_wheels_{wheels}_", $name),
            ],
            of: $of,
        }
    };
}

const TOLD: [Told; 18] = [
    told!("cone_rad", "rad", "cone angle", |_, d, _| d.cone),
    told!("toe_rad", "rad", "toe angle", |_, d, _| d.toe),
    told!("tilt_rad", "rad", "angle of the steering axes from -n3", |_, d, _| d.tilt),
    told!("radius_m", "m", "wheel radius", |_, d, _| d.radius),
    told!(
        "gci",
        "1",
        "global conditioning index: mean spectral index of G over all steering angles",
        |_, _, m| m.gci
    ),
    told!(
        "conditioning_least",
        "1",
        "least spectral index over all steering angles: the actuation margin",
        |_, _, m| m.conditioning
    ),
    told!(
        "torque",
        "N m",
        "peak torque of the motors in the worst direction at the worst posture",
        |_, _, m| m.torque
    ),
    told!(
        "torque_5pct",
        "N m",
        "peak torque in the worst direction, which 5 % of postures are below",
        |_, _, m| m.torque_low
    ),
    told!(
        "inertia",
        "kg m²",
        "largest eigenvalue of the apparent inertia over all steering angles",
        |_, _, m| m.inertia
    ),
    told!("inertia_mean", "kg m²", "mean of the largest eigenvalue of the apparent inertia", |_, _, m| m
        .inertia_mean),
    told!(
        "steering_speed",
        "1",
        "steering rate at most, for a sphere that turns at 1 rad/s: 1/(sin a cos b)",
        |_, _, m| m.speed[0]
    ),
    told!(
        "drive_speed",
        "1",
        "drive rate at most, for a sphere that turns at 1 rad/s: R/(r cos b)",
        |_, _, m| m.speed[1]
    ),
    told!(
        "contact_force",
        "N/(N m)",
        "largest contact force for a torque of 1 N m in the worst direction at the worst posture",
        |_, _, m| m.load
    ),
    told!(
        "slip_torque",
        "N m",
        "torque in the worst direction at the worst posture at which the first contact slips, at the prototype's normal force on each wheel",
        |p, _, m| m.slips_from(grip(p))
    ),
    told!("usable_torque", "N m", "the lesser of torque and slip_torque", |p, _, m| m
        .torque
        .min(m.slips_from(grip(p)))),
    told!(
        "interior",
        "1",
        "sigma_min(Z)/R over all steering angles, exact for two wheels, a lower bound for more",
        |_, _, m| m.interior
    ),
    told!("gap_rad", "rad", "angle left between neighbouring modules", |p, d, _| d.gap(p.sphere_radius())),
    told!("headroom_rad", "rad", "angle left between modules and the open half", |p, d, _| d
        .headroom(p.sphere_radius())),
];

/// The group of designs whose figures are reported: the prototype, the best designs, or the designs
/// that are compared by number of wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    Prototype,
    Best,
    Wheels,
}

/// Declares the figures of the designs in the group `of`, with their units and meanings.
pub(super) fn families(report: &mut Report, of: Of) {
    for told in TOLD {
        let (unit, meaning) = (told.unit, told.meaning);
        report.meaning(Family { pattern: told.families[of as usize], unit, meaning });
    }
}

/// Reports all figures of a design. The id of each figure begins with `stem`.
pub(super) fn figures(report: &mut Report, stem: &str, parts: &Parts, design: &Design, measures: &Measures) {
    for told in TOLD {
        report.figure(format!("{stem}_{}", told.name), (told.of)(parts, design, measures));
    }
}
