//! Margins that every design must keep at all steer angles.

use super::space::{Design, Parts};
use super::torus::Measures;

/// A property that a design must not fall below, such as the distance from a singularity, and its
/// lower bound.
pub(super) struct Margin {
    pub(super) name: &'static str,
    pub(super) meaning: &'static str,
    pub(super) unit: &'static str,
    pub(super) least: f64,
    of: fn(&Judged<'_>) -> f64,
}

/// The data of one design from which its margins are computed.
struct Judged<'a> {
    design: &'a Design,
    measures: &'a Measures,
    sphere_radius: f64,
    grip: f64,
}

/// Smallest allowed torque on the sphere at which the first contact slips, in the worst direction,
/// N m. The prototype reaches 0.77.
pub(super) const HOLDS: f64 = 0.75;

pub(super) const MARGINS: [Margin; 7] = [
    Margin {
        name: "boundary",
        meaning: "sin(cone) cos(toe) = 1 over the steering speed; 0 is a boundary singularity",
        unit: "1",
        least: 0.1,
        of: |j| 1.0 / j.measures.speed[0],
    },
    Margin {
        name: "drive",
        meaning: "r cos(toe)/R = 1 over the drive speed",
        unit: "1",
        least: 0.1,
        of: |j| 1.0 / j.measures.speed[1],
    },
    Margin {
        name: "interior",
        meaning: "sigma_min(Z)/R over all steering angles, exact for two wheels, for more a bound that the true one is not below; 0 is an interior singularity",
        unit: "1",
        least: 0.25,
        of: |j| j.measures.interior,
    },
    Margin {
        name: "actuation",
        meaning: "least spectral index of G over all steering angles, all joints driven; 0 is an actuation singularity",
        unit: "1",
        least: 0.25,
        of: |j| j.measures.conditioning,
    },
    Margin {
        name: "traction",
        meaning: "torque in the worst direction at the worst posture at which the first contact slips",
        unit: "N m",
        least: HOLDS,
        of: |j| j.measures.slips_from(j.grip),
    },
    Margin {
        name: "gap",
        meaning: "angle left between neighbouring modules, whatever they steer to",
        unit: "rad",
        least: 0.0,
        of: |j| j.design.gap(j.sphere_radius),
    },
    Margin {
        name: "headroom",
        meaning: "angle left between the modules and the cage's open half",
        unit: "rad",
        least: 0.0,
        of: |j| j.design.headroom(j.sphere_radius),
    },
];

/// Returns the largest friction force of a contact of the prototype, mu N, in N.
pub(super) fn grip(parts: &Parts) -> f64 {
    let traction = parts.rig.limits.traction;
    traction.map_or_else(|| unreachable!("the prototype's file says it"), |t| t.mu * t.normal_force)
}

/// Returns the values of all margins of a design, in the order of [`MARGINS`].
pub(super) fn margins(parts: &Parts, design: &Design, measures: &Measures) -> [f64; MARGINS.len()] {
    let judged = Judged { design, measures, sphere_radius: parts.sphere_radius(), grip: grip(parts) };
    MARGINS.map(|margin| (margin.of)(&judged))
}

/// Returns whether all margins of a design are at or above their lower bounds.
pub(super) fn keeps(parts: &Parts, design: &Design, measures: &Measures) -> bool {
    margins(parts, design, measures).iter().zip(MARGINS).all(|(value, margin)| *value >= margin.least)
}

/// Returns whether the dimensions of a design leave room for the wheel modules and keep the joint
/// speeds within their bounds. This needs no measurement, so unsuitable designs are rejected
/// quickly.
pub(super) fn has_room(parts: &Parts, design: &Design) -> bool {
    let r = parts.sphere_radius();
    design.gap(r) >= 0.0
        && design.headroom(r) >= 0.0
        && design.steering_speed() * MARGINS[0].least <= 1.0
        && design.drive_speed(r) * MARGINS[1].least <= 1.0
}
