//! A compiled scene: the effects that are there, and nothing for those that are not.

use crate::effects::{Constant, Effect, Frame, Kind, Span};
use crate::real::{Real, Vec3};

/// The most effects in a scene.
pub const MAX_EFFECTS: usize = 32;

/// The most figures that the effects of a scene have together: positions, orientations, way-points.
pub const MAX_FIGURES: usize = 4096;

/// A scene as the tick runs it. Made outside the loop, handed in by reference, never changed.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledScene {
    revision: u64,
    len: usize,
    effects: [Effect; MAX_EFFECTS],
    figures: [Real; MAX_FIGURES],
}

/// Why effects do not make a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneError {
    /// More than [`MAX_EFFECTS`].
    TooMany(usize),
    /// Two effects share a slot, or a slot is not below [`MAX_EFFECTS`].
    Slot(u8),
    /// More than [`MAX_FIGURES`] figures, or an effect's are not among them.
    Figures(usize),
}

impl core::fmt::Display for SceneError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooMany(n) => write!(f, "{n} effects: a scene has at most {MAX_EFFECTS}"),
            Self::Slot(slot) => write!(f, "slot {slot} is taken twice or not below {MAX_EFFECTS}"),
            Self::Figures(n) => write!(f, "{n} figures: a scene has at most {MAX_FIGURES}"),
        }
    }
}

impl core::error::Error for SceneError {}

impl CompiledScene {
    /// A scene of `effects`, in the order of their sum, that need no figures. A `revision` that differs from the running
    /// scene's makes the controller blend from one to the other over 50 ms.
    ///
    /// # Errors
    /// Too many effects, or slots that are not unique.
    pub fn new(revision: u64, effects: &[Effect]) -> Result<Self, SceneError> {
        Self::with_figures(revision, effects, &[])
    }

    /// The same, with the table of figures that the effects' spans are of.
    ///
    /// # Errors
    /// Too many effects or figures, slots that are not unique, or a span that is not of the table.
    pub fn with_figures(revision: u64, effects: &[Effect], figures: &[Real]) -> Result<Self, SceneError> {
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
            let end = usize::from(effect.figures.start) + usize::from(effect.figures.len);
            if end > figures.len() {
                return Err(SceneError::Figures(end));
            }
        }
        if figures.len() > MAX_FIGURES {
            return Err(SceneError::Figures(figures.len()));
        }
        let mut scene = Self::empty();
        scene.revision = revision;
        scene.figures[..figures.len()].copy_from_slice(figures);
        scene.len = effects.len();
        scene.effects[..effects.len()].copy_from_slice(effects);
        Ok(scene)
    }

    /// A scene without effects, revision 0.
    #[must_use]
    pub fn empty() -> Self {
        let nothing = Kind::Constant(Constant { torque: Vec3::ZERO, frame: Frame::World });
        let unused = Effect::new(0, 0, nothing);
        Self { revision: 0, len: 0, effects: [unused; MAX_EFFECTS], figures: [0.0; MAX_FIGURES] }
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
    /// A part of the table of figures.
    #[inline]
    #[must_use]
    pub fn figures(&self, span: Span) -> &[Real] {
        let start = usize::from(span.start);
        &self.figures[start..start + usize::from(span.len)]
    }

    /// The scene of one of its effects alone.
    #[must_use]
    pub fn only(&self, effect: usize) -> Self {
        let mut scene = self.clone();
        scene.effects[0] = self.effects[effect];
        scene.len = 1;
        scene
    }
}
