//! References: the orientations from which effects are measured, fixed or moving.

use crate::real::{Quat, Real, Vec3};
use crate::render::around::Spot;
use crate::rotation;

/// The orientation relative to which the reference of an effect is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Anchor {
    /// The reference is an orientation in frame N.
    Absolute,
    /// The reference is a turn relative to the sphere's orientation at `enable`. If the rig is
    /// already active when the effect is loaded, it is relative to the orientation at that time.
    Here,
}

/// The reference orientation of an effect, as the scene gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Target {
    reference: Quat,
    anchor: Anchor,
}

impl Target {
    /// The target whose axes are those of frame N.
    pub const N: Self = Self { reference: Quat::IDENTITY, anchor: Anchor::Absolute };

    /// Creates a target at the unit quaternion `reference`. Returns `None` if the length of
    /// `reference` is not 1.
    #[must_use]
    pub fn new(reference: Quat, anchor: Anchor) -> Option<Self> {
        ((reference.length_squared() - 1.0).abs() < 1.0e-6).then_some(Self { reference, anchor })
    }

    /// Returns the reference orientation, and the anchor relative to which it is given.
    #[inline]
    #[must_use]
    pub fn reference(&self) -> (Quat, Anchor) {
        (self.reference, self.anchor)
    }
}

/// The reference orientation of an effect while its scene runs. It moves towards its goal at a
/// limited rate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Reference {
    /// Present orientation of the reference.
    pub(crate) q: Quat,
    /// Orientation that the reference approaches. The rig's `reference_rate` limits its speed.
    pub(crate) goal: Quat,
    /// Angular velocity of the reference in frame N, rad/s. Dampers act on motion relative to it. 0
    /// after it has expired.
    pub(crate) omega: Vec3,
    /// First tick in which `omega` is no longer valid.
    pub(crate) omega_until: u64,
    /// False if the reference is at its goal and `omega` is 0, so that a tick changes nothing. Set
    /// when a new goal or a new `omega` is given.
    pub(crate) moving: bool,
}

impl Reference {
    pub(crate) const STILL: Self =
        Self { q: Quat::IDENTITY, goal: Quat::IDENTITY, omega: Vec3::ZERO, omega_until: 0, moving: false };
}

/// Returns `v` with its length reduced by `deadband`, or zero if it is shorter than `deadband`.
#[inline]
pub(crate) fn beyond(v: Vec3, deadband: Real) -> Vec3 {
    let length = crate::real::sqrt(v.length_squared());
    if length > deadband { v * (1.0 - deadband / length) } else { Vec3::ZERO }
}

/// Returns the derivative matrix of [`beyond`] at `v`, times the vector `f`. The matrix is
/// symmetric, so it equals its transpose.
#[inline]
pub(crate) fn beyond_gradient(v: Vec3, deadband: Real, f: Vec3) -> Vec3 {
    let length = crate::real::sqrt(v.length_squared());
    if !(length > deadband) {
        return Vec3::ZERO;
    }
    let unit = v * (1.0 / length);
    f * (1.0 - deadband / length) + unit * (deadband / length * unit.dot(f))
}

/// Calls `visit` for the reference, and for the ends of a dead band about each of `axes` if there
/// is a dead band. This is [`Law::places`](super::Law::places) of a spring with a dead band, rad.
pub(crate) fn places_of_spring<M: Default>(
    axes: &[Vec3],
    deadband: Real,
    visit: &mut dyn FnMut(Spot, Quat, Vec3, M),
) {
    visit(Spot::Rest, Quat::IDENTITY, Vec3::ZERO, M::default());
    for axis in axes.iter().filter(|_| deadband > 0.0) {
        visit(Spot::Edge, rotation::exp(*axis * deadband), *axis, M::default());
    }
}
