//! A compiled scene: the effects that are there, and nothing for those that are not.

use crate::effects::{Damper, Effect, Kind};
use crate::real::Mat3;

/// The most effects in a scene.
pub const MAX_EFFECTS: usize = 32;

/// A scene as the tick runs it. Made outside the loop, handed in by reference, never changed.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledScene {
    revision: u64,
    len: usize,
    effects: [Effect; MAX_EFFECTS],
}

/// Why effects do not make a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneError {
    /// More than [`MAX_EFFECTS`].
    TooMany(usize),
    /// Two effects share a slot, or a slot is not below [`MAX_EFFECTS`].
    Slot(u8),
}

impl core::fmt::Display for SceneError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooMany(n) => write!(f, "{n} effects: a scene has at most {MAX_EFFECTS}"),
            Self::Slot(slot) => write!(f, "slot {slot} is taken twice or not below {MAX_EFFECTS}"),
        }
    }
}

impl core::error::Error for SceneError {}

impl CompiledScene {
    /// A scene of `effects`, in the order of their sum. A `revision` that differs from the running scene's makes the
    /// controller blend from one to the other over 50 ms.
    ///
    /// # Errors
    /// Too many effects, or slots that are not unique.
    pub fn new(revision: u64, effects: &[Effect]) -> Result<Self, SceneError> {
        if effects.len() > MAX_EFFECTS {
            return Err(SceneError::TooMany(effects.len()));
        }
        let mut taken = 0_u32;
        for effect in effects {
            let bit = 1_u32.checked_shl(effect.slot.into()).unwrap_or(0);
            if bit == 0 || taken & bit != 0 {
                return Err(SceneError::Slot(effect.slot));
            }
            taken |= bit;
        }
        let mut scene = Self { revision, ..Self::empty() };
        scene.len = effects.len();
        scene.effects[..effects.len()].copy_from_slice(effects);
        Ok(scene)
    }

    /// A scene without effects, revision 0.
    #[must_use]
    pub fn empty() -> Self {
        let unused = Effect {
            slot: 0,
            epoch: 0,
            reference_revision: 0,
            gain: 0.0,
            fade_s: 0.0,
            kind: Kind::Damper(
                Damper::new(Mat3::ZERO).unwrap_or_else(|| unreachable!("zero is a legal damping")),
            ),
        };
        Self { revision: 0, len: 0, effects: [unused; MAX_EFFECTS] }
    }

    /// The number that tells this scene from others.
    #[inline]
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The effects, in the order of their sum.
    #[inline]
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.effects[..self.len]
    }
}
