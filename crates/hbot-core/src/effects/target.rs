//! References: the orientation that an effect is measured from, fixed or moving.

use crate::real::{Quat, Real, Vec3};

/// What a reference is measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The frame N.
    Absolute,
    /// The orientation at enable, or at load where the rig is active already: the reference turns from there.
    Here,
}

/// The orientation that an effect is measured from, as the scene states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    reference: Quat,
    anchor: Anchor,
}

impl Target {
    /// The frame N itself.
    pub const N: Self = Self { reference: Quat::IDENTITY, anchor: Anchor::Absolute };

    /// A target at the unit quaternion `reference`. `None` where it is not unit.
    #[must_use]
    pub fn new(reference: Quat, anchor: Anchor) -> Option<Self> {
        ((reference.length_squared() - 1.0).abs() < 1.0e-6).then_some(Self { reference, anchor })
    }

    /// The reference and its anchor.
    #[inline]
    #[must_use]
    pub fn reference(&self) -> (Quat, Anchor) {
        (self.reference, self.anchor)
    }
}

/// A reference that moves: where it is, where it goes, and the rate it is said to have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reference {
    /// Where it is now.
    pub(crate) q: Quat,
    /// Where it goes, at most at the rig's `reference_rate`.
    pub(crate) goal: Quat,
    /// Its rate in N for the damper, rad/s; 0 once expired.
    pub(crate) omega: Vec3,
    /// First tick at which `omega` no longer holds.
    pub(crate) omega_until: u64,
}

impl Reference {
    pub(crate) const STILL: Self =
        Self { q: Quat::IDENTITY, goal: Quat::IDENTITY, omega: Vec3::ZERO, omega_until: 0 };
}

/// `v` shortened by `deadband`, to nothing where it is not longer: what is left beyond a dead zone.
#[inline]
pub(crate) fn beyond(v: Vec3, deadband: Real) -> Vec3 {
    let length = crate::real::sqrt(v.length_squared());
    if length > deadband { v * (1.0 - deadband / length) } else { Vec3::ZERO }
}

/// The derivative of [`beyond`] at `v`, transposed (it is symmetric), times `f`.
#[inline]
pub(crate) fn beyond_gradient(v: Vec3, deadband: Real, f: Vec3) -> Vec3 {
    let length = crate::real::sqrt(v.length_squared());
    if !(length > deadband) {
        return Vec3::ZERO;
    }
    let unit = v * (1.0 / length);
    f * (1.0 - deadband / length) + unit * (deadband / length * unit.dot(f))
}
