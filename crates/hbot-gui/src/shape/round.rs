//! Circles and arcs on the sphere.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

/// Shapes are drawn this far from the centre, so that the sphere does not hide those on its near
/// half.
pub(super) const LIFT: f64 = 1.015;
/// Length of the longest straight piece of a curve, rad.
const STEP: f64 = 0.07;

/// Directions about an axis: a unit vector `axis` and the direction of the angle 0 about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct About {
    axis: DVec3,
    zero: DVec3,
    quarter: DVec3,
}

impl About {
    /// Creates the directions about `axis`, a unit vector in the axes of a reference. `to_n` turns
    /// these axes to frame N. The direction of the angle 0 is fixed in the reference.
    pub(super) fn new(axis: DVec3, to_n: DQuat) -> Self {
        let zero = axis.any_orthonormal_vector();
        Self { axis: to_n * axis, zero: to_n * zero, quarter: to_n * axis.cross(zero) }
    }

    pub(super) const fn axis(&self) -> DVec3 {
        self.axis
    }

    /// Returns the point of the sphere at the angle `polar` from the axis, and `angle` about it.
    pub(super) fn at(&self, polar: f64, angle: f64) -> DVec3 {
        let (sp, cp) = polar.sin_cos();
        let (sa, ca) = angle.sin_cos();
        LIFT * (self.axis * cp + (self.zero * ca + self.quarter * sa) * sp)
    }

    /// Returns the arc at the angle `polar` from the axis, from one angle about it to another.
    pub(super) fn arc(&self, polar: f64, [from, to]: [f64; 2]) -> Vec<DVec3> {
        let pieces = ((to - from).abs() * polar.sin().abs() / STEP).ceil().max(2.0) as u32;
        (0..=pieces).map(|k| self.at(polar, from + (to - from) * f64::from(k) / f64::from(pieces))).collect()
    }

    /// Returns the whole circle at the angle `polar` from the axis.
    pub(super) fn circle(&self, polar: f64) -> Vec<DVec3> {
        self.arc(polar, [0.0, TAU])
    }

    /// Returns the angle about the axis at which a direction in frame N is.
    pub(super) fn angle_of(&self, direction: DVec3) -> f64 {
        direction.dot(self.quarter).atan2(direction.dot(self.zero))
    }
}

/// Returns the shortest arc on the sphere from one direction to another, both unit vectors. At
/// opposite directions no arc is the shortest, and the line is any.
pub(super) fn between(from: DVec3, to: DVec3) -> Vec<DVec3> {
    let whole = DQuat::from_rotation_arc(from, to);
    let pieces = (from.angle_between(to) / STEP).ceil().max(1.0) as u32;
    (0..=pieces)
        .map(|k| LIFT * (DQuat::IDENTITY.slerp(whole, f64::from(k) / f64::from(pieces)) * from))
        .collect()
}
