//! The geometry of what the hand meets: walls, notches, guides, and places that attract. Each law
//! describes its own, so that a program that draws a scene needs to know no kind of effect.
//!
//! [`Kind::outline`] visits the parts of an effect, and [`Kind::at_rest`] says how strongly the
//! effect pulls at an orientation.

use crate::real::{Quat, Real, Vec3};
use crate::render::effects::Kind;

/// A part of the geometry of an effect. Axes are unit vectors in the frame of the effect's
/// reference, which is frame N for effects without one. Angles about an axis are twists of the
/// sphere relative to the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outline<'a> {
    /// A wall around a cone. The sphere's own axis `axis` must stay within `angle` rad of the place
    /// that this axis has at the reference.
    Cone {
        /// The axis of the cone, which is also the axis of the sphere.
        axis: Vec3,
        /// Half of the opening angle, rad.
        angle: Real,
    },
    /// Walls at the smallest and the largest twist about `axis`, rad. They can be many turns apart.
    Twist {
        /// The axis of the twist.
        axis: Vec3,
        /// Angles of the walls, rad.
        range: [Real; 2],
    },
    /// Notches of a dial that hold the sphere.
    Notches {
        /// The axis of the dial.
        axis: Vec3,
        /// Angles of the notches, rad.
        angles: Angles<'a>,
        /// Largest distance at which a notch acts, rad.
        width: Real,
        /// Whether there are walls beyond the first and the last notch.
        walls: bool,
    },
    /// Angles about `axis` half way between which something happens, such as a click.
    Clicks {
        /// The axis of the dial.
        axis: Vec3,
        /// The angles, rad.
        angles: Angles<'a>,
    },
    /// An orientation that attracts the sphere, as a turn from the reference. It is one of several,
    /// of which the nearest acts.
    Snap(Quat),
    /// The reference attracts the sphere, most strongly at the angle `width`, rad.
    Well {
        /// Angle at which the torque is largest, rad.
        width: Real,
    },
    /// The sphere turns freely about `axis`, and is held against all other turns.
    Hinge {
        /// The axis that is free.
        axis: Vec3,
    },
    /// The sphere is held against twists about `axis`, and turns freely otherwise.
    Untwisted {
        /// The axis that is held.
        axis: Vec3,
    },
    /// The sphere's own axis `pointer` is held in the plane with the normal `normal`.
    Plane {
        /// Normal of the plane.
        normal: Vec3,
        /// Axis of the sphere.
        pointer: Vec3,
    },
    /// A mass at a place that is fixed in the sphere, m, in the sphere's axes.
    Weight(Vec3),
    /// A fixed point next to the sphere's surface, past which the surface is felt: a unit vector.
    Finger(Vec3),
}

/// Angles about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Angles<'a> {
    /// This number of angles, evenly spaced around a turn. The first is 0.
    Even(u16),
    /// These angles, rad, in ascending order. They can cover many turns.
    At(&'a [Real]),
}

impl Kind {
    /// Returns the torque of the effect on a sphere that rests at the orientation `q` and was never
    /// elsewhere, in frame N, N m, before the effect's gain. `reference` is the effect's reference
    /// as a rotation to frame N, and `numbers` its list of numbers. The time stands still.
    #[must_use]
    pub fn at_rest(&self, reference: Quat, q: Quat, numbers: &[Real]) -> Vec3 {
        crate::render::around::still(self, reference, q, numbers)
    }
}
