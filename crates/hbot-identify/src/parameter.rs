//! The unknowns of an identification, and how far a rig can be from its drawing.
//!
//! All of them are 0 for a rig that is as drawn.

use std::f64::consts::PI;

/// Usual deviation of an angle from the drawing, rad: half a degree.
pub const ANGLE: f64 = 0.5 * PI / 180.0;
/// Usual deviation of a wheel's radius from the drawing, as a fraction of the radius.
pub const RADIUS: f64 = 0.01;
/// Usual deviation of the sphere's centre from the point where the steering axes meet, m.
pub const CENTRE: f64 = 0.5e-3;
/// Usual deviation of a steering zero, rad. A zero is often set by hand before the power goes on.
pub const ZERO: f64 = 0.1;
/// Usual error that repeats with each turn of an encoder, rad of the encoder.
pub const DISC: f64 = 5.0e-4;

/// Number of unknowns of each wheel.
pub const OF_WHEEL: usize = 8;
/// Number of unknowns of the sphere, which follow those of the wheels.
pub const OF_SPHERE: usize = 3;

/// One unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Tilt of a wheel's steering axis about the first or second axis of its drawn frame at the
    /// joint angle zero, rad.
    Tilt(usize),
    /// Turn of the wheel about its steering axis at the joint angle zero, rad.
    Zero,
    /// Cone angle minus the drawn one, rad.
    Cone,
    /// Toe angle minus the drawn one, rad.
    Toe,
    /// Natural logarithm of the wheel's radius divided by the drawn one. The sphere's radius counts
    /// as right, because a larger rig turns in the same way.
    Radius,
    /// Error of the steer encoder that repeats with each of its turns, rad of the encoder: 0 is
    /// the factor of the cosine of its angle, 1 that of the sine.
    Disc(usize),
    /// Offset of the sphere's centre from the point where the steering axes meet along n1, n2 or n3
    /// (0 to 2), m.
    Centre(usize),
}

impl Quantity {
    /// The unknowns of a wheel, in their order.
    pub const OF_WHEEL: [Self; OF_WHEEL] = [
        Self::Tilt(0),
        Self::Tilt(1),
        Self::Zero,
        Self::Cone,
        Self::Toe,
        Self::Radius,
        Self::Disc(0),
        Self::Disc(1),
    ];

    /// Returns the usual deviation of the quantity, in its unit. It is the standard deviation that
    /// the fit assumes before it has seen a recording.
    #[must_use]
    pub const fn usual(self) -> f64 {
        match self {
            Self::Tilt(_) | Self::Cone | Self::Toe => ANGLE,
            Self::Zero => ZERO,
            Self::Radius => RADIUS,
            Self::Disc(_) => DISC,
            Self::Centre(_) => CENTRE,
        }
    }
}

/// Returns the number of unknowns of a rig with `wheels` wheels.
#[must_use]
pub const fn count(wheels: usize) -> usize {
    OF_WHEEL * wheels + OF_SPHERE
}

/// Returns the unknowns of a rig with `wheels` wheels in their order: those of each wheel with its
/// index, then those of the sphere.
pub fn all(wheels: usize) -> impl Iterator<Item = (Option<usize>, Quantity)> {
    let of_wheels = (0..wheels).flat_map(|wheel| Quantity::OF_WHEEL.map(|it| (Some(wheel), it)));
    of_wheels.chain((0..OF_SPHERE).map(|axis| (None, Quantity::Centre(axis))))
}
