//! The effects that scenes are made of: one file a kind, and one list, [`Kind`].
//!
//! An effect is a small immutable description; what it remembers from tick to tick stands in its slot of the
//! controller ([`EffectState`]). Adding a kind means a file here and an arm in the list below.

mod damper;
mod spring;

pub use damper::Damper;
pub use spring::{Anchor, Spring, SpringLaw};

use crate::real::{Quat, Real, Vec3};

/// What an effect may know of the moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Orientation of the sphere.
    pub q: Quat,
    /// Angular velocity in N, rad/s.
    pub omega: Vec3,
}

/// The list of kinds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A spring with a damper towards a reference orientation.
    Spring(Spring),
    /// Resistance against turning.
    Damper(Damper),
}

impl Kind {
    /// The torque on the sphere in N, N m, before gain and fading.
    #[inline]
    pub(crate) fn torque(&self, motion: &Motion, state: &mut EffectState) -> Vec3 {
        match self {
            Self::Spring(spring) => spring.torque(motion, state),
            Self::Damper(damper) => damper.torque(motion),
        }
    }

    /// The reference and its anchor, for kinds that have one.
    #[inline]
    #[must_use]
    pub fn reference(&self) -> Option<(Quat, Anchor)> {
        match self {
            Self::Spring(spring) => Some((spring.reference(), spring.anchor())),
            Self::Damper(_) => None,
        }
    }
}

/// One effect of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// Where its memory stands in the controller, below [`MAX_EFFECTS`](crate::scene::MAX_EFFECTS).
    pub slot: u8,
    /// Which effect it is in the life of the server: a new number makes a fresh memory, the same one keeps it, as when a
    /// parameter of a running effect is set.
    pub epoch: u32,
    /// A change of this number (epoch kept) makes `reference` of the kind the new goal of a kept memory.
    pub reference_revision: u32,
    /// Factor on its torque.
    pub gain: Real,
    /// How long it takes to fade in, s.
    pub fade_s: Real,
    /// What it is.
    pub kind: Kind,
}

/// What an effect remembers from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectState {
    /// The effect whose memory this is; 0 for none.
    pub(crate) epoch: u32,
    pub(crate) reference_revision: u32,
    /// Time since it began to fade in, s; stops at its fade time.
    pub(crate) age_s: Real,
    pub(crate) reference: Reference,
    /// The last rotation vector, which decides the side of a half turn.
    pub(crate) branch: Vec3,
}

impl EffectState {
    /// The memory of no effect.
    pub(crate) const EMPTY: Self =
        Self { epoch: 0, reference_revision: 0, age_s: 0.0, reference: Reference::STILL, branch: Vec3::ZERO };
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
    const STILL: Self = Self { q: Quat::IDENTITY, goal: Quat::IDENTITY, omega: Vec3::ZERO, omega_until: 0 };
}
