//! Rings about an axis, on which the twist of the sphere is read like the angle of a dial.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

use super::round::About;
use super::{Pen, Role};

/// Half the length of a mark across the ring, rad.
const MARK: f64 = 0.035;
/// Half the length of the mark at which the sphere is, and of a wall, rad.
const LONG: f64 = 0.06;

/// A ring on the sphere at the angle `radius` about an axis, rad.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    about: About,
    radius: f64,
    /// Twist of the sphere about the axis, rad, -pi to pi.
    pub(super) psi: f64,
}

/// Returns the twist of the rotation `x` about the unit vector `axis`, rad, -pi to pi
/// (docs/internals/physics.md, section 6). The scalar part of `x` must not be negative.
pub(super) fn twist(x: DQuat, axis: DVec3) -> f64 {
    2.0 * DVec3::new(x.x, x.y, x.z).dot(axis).atan2(x.w)
}

impl Ring {
    pub(super) fn new(pen: &Pen<'_>, axis: DVec3, radius: f64) -> Self {
        Self { about: About::new(axis, pen.reference), radius, psi: twist(pen.relative(), axis) }
    }

    /// Draws the ring, and the mark that turns with the sphere.
    pub(super) fn draw(&self, pen: &mut Pen<'_>, role: Role, id: &str) {
        pen.line(role, self.about.circle(self.radius), 0.0);
        let pointer = vec![self.about.at(0.4 * self.radius, self.psi), self.at(self.psi)];
        pen.line(Role::Pointer, pointer, 0.0);
        // The label of a wall is opposite to that of the notches inside its ring.
        let side = if role == Role::Wall { 0.5 } else { -0.5 };
        pen.label(role, self.about.at(self.radius + 0.14, side * PI), id);
    }

    fn at(&self, angle: f64) -> DVec3 {
        self.about.at(self.radius, angle)
    }

    fn across(&self, angle: f64, half: f64) -> Vec<DVec3> {
        vec![self.about.at(self.radius - half, angle), self.about.at(self.radius + half, angle)]
    }

    /// Draws a notch at an angle. One that holds the sphere is longer, and glows.
    pub(super) fn notch(&self, pen: &mut Pen<'_>, angle: f64, held: bool) {
        let (half, glow) = if held { (LONG, 1.0) } else { (MARK, 0.0) };
        pen.line(Role::Place, self.across(angle, half), glow);
    }

    /// Draws a wall at an angle. `side` is 1 if angles above it are in the wall and -1 if those
    /// below are, and `depth` how far the sphere is in the wall, rad.
    pub(super) fn wall(&self, pen: &mut Pen<'_>, angle: f64, side: f64, glow: f64) {
        pen.line(Role::Wall, self.across(angle, LONG), glow);
        // The wall goes on behind its face.
        let behind = self.about.arc(self.radius + LONG, [angle, angle + side * 0.12]);
        pen.line(Role::Wall, behind, glow);
    }

    /// Draws the part of the ring between two angles, such as the way that the sphere is in a wall.
    pub(super) fn part(&self, pen: &mut Pen<'_>, role: Role, range: [f64; 2], glow: f64) {
        pen.line(role, self.about.arc(self.radius, range), glow);
    }
}

/// Returns the distance from `psi` to the angle `to`, rad, -pi to pi. A state tells the twist
/// without its whole turns.
pub(super) fn off(psi: f64, to: f64) -> f64 {
    (psi - to + PI).rem_euclid(TAU) - PI
}
