//! References: the orientations from which effects are measured, fixed or moving.

use crate::real::{Quat, Real, Vec3};

/// The orientation to which a reference is relative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The reference is an absolute orientation in frame N.
    Absolute,
    /// The reference is a turn from the orientation at enable, or from that at load if the rig is
    /// already active.
    Here,
}

/// The orientation from which an effect is measured, as the scene gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    reference: Quat,
    anchor: Anchor,
}

impl Target {
    /// The target at frame N itself.
    pub const N: Self = Self { reference: Quat::IDENTITY, anchor: Anchor::Absolute };

    /// Creates a target at the unit quaternion `reference`. Returns `None` if it is not of unit
    /// length.
    #[must_use]
    pub fn new(reference: Quat, anchor: Anchor) -> Option<Self> {
        ((reference.length_squared() - 1.0).abs() < 1.0e-6).then_some(Self { reference, anchor })
    }

    /// Returns the reference and its anchor.
    #[inline]
    #[must_use]
    pub fn reference(&self) -> (Quat, Anchor) {
        (self.reference, self.anchor)
    }
}

/// A moving reference: its orientation, its goal and its rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reference {
    /// Present orientation.
    pub(crate) q: Quat,
    /// Orientation that it approaches, at most at the rig's `reference_rate`.
    pub(crate) goal: Quat,
    /// Rate in frame N that the damper uses, rad/s; 0 after it has expired.
    pub(crate) omega: Vec3,
    /// First tick at which `omega` is no longer valid.
    pub(crate) omega_until: u64,
}

impl Reference {
    pub(crate) const STILL: Self =
        Self { q: Quat::IDENTITY, goal: Quat::IDENTITY, omega: Vec3::ZERO, omega_until: 0 };
}

/// Returns `v` with its length reduced by `deadband`, or zero if it is shorter than `deadband`.
#[inline]
pub(crate) fn beyond(v: Vec3, deadband: Real) -> Vec3 {
    let length = crate::real::sqrt(v.length_squared());
    if length > deadband { v * (1.0 - deadband / length) } else { Vec3::ZERO }
}

/// Returns the transposed derivative of [`beyond`] at `v`, times `f`. The derivative is symmetric.
#[inline]
pub(crate) fn beyond_gradient(v: Vec3, deadband: Real, f: Vec3) -> Vec3 {
    let length = crate::real::sqrt(v.length_squared());
    if !(length > deadband) {
        return Vec3::ZERO;
    }
    let unit = v * (1.0 / length);
    f * (1.0 - deadband / length) + unit * (deadband / length * unit.dot(f))
}
