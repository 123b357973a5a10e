//! A compiled scene: the list of its effects and their data, in the form that a tick needs.

use crate::real::{Real, Vec3};
use crate::render::effects::{Constant, Effect, Frame, Kind, Span};

/// Largest number of effects in a scene.
pub const MAX_EFFECTS: usize = 32;

/// Largest count of numbers in a scene's table of numbers. The table holds positions, orientations
/// and way-points for all effects of the scene.
pub const MAX_NUMBERS: usize = 4096;

/// A scene in the form that a tick needs: its effects and a table of numbers for them. It is
/// compiled outside the loop and never changed.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledScene {
    revision: u64,
    len: usize,
    effects: [Effect; MAX_EFFECTS],
    numbers: [Real; MAX_NUMBERS],
}

/// The reason why a list of effects is not a valid scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneError {
    /// There are more than [`MAX_EFFECTS`] effects. The value is their number.
    TooMany(usize),
    /// Two effects have the same slot, or a slot is not below [`MAX_EFFECTS`]. The value is this
    /// slot.
    Slot(u8),
    /// There are more than [`MAX_NUMBERS`] numbers in the table, or an effect refers to numbers
    /// that are not in it. The value is the count of numbers.
    Numbers(usize),
}

impl core::fmt::Display for SceneError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooMany(n) => write!(f, "{n} effects: a scene has at most {MAX_EFFECTS}"),
            Self::Slot(slot) => write!(f, "slot {slot} is taken twice or not below {MAX_EFFECTS}"),
            Self::Numbers(n) => write!(f, "{n} numbers: a scene has at most {MAX_NUMBERS}"),
        }
    }
}

impl core::error::Error for SceneError {}

impl CompiledScene {
    /// Creates a scene from `effects`, without a table of numbers. The torques of the effects are
    /// added in their order. If `revision` differs from that of the running scene, the controller
    /// blends from the running scene to this one over 50 ms.
    ///
    /// # Errors
    /// Fails if there are too many effects, if their slots are not unique, or if an effect refers
    /// to a table of numbers.
    pub fn new(revision: u64, effects: &[Effect]) -> Result<Self, SceneError> {
        Self::with_numbers(revision, effects, &[])
    }

    /// Creates a scene from `effects` and a table of numbers, `figures`. The [`Span`] of each
    /// effect refers to a part of this table.
    ///
    /// # Errors
    /// Fails if there are too many effects or numbers, if slots are not unique, or if a span is not
    /// within the table.
    pub fn with_numbers(revision: u64, effects: &[Effect], numbers: &[Real]) -> Result<Self, SceneError> {
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
            let end = usize::from(effect.numbers.start) + usize::from(effect.numbers.len);
            if end > numbers.len() {
                return Err(SceneError::Numbers(end));
            }
        }
        if numbers.len() > MAX_NUMBERS {
            return Err(SceneError::Numbers(numbers.len()));
        }
        let mut scene = Self::empty();
        scene.revision = revision;
        scene.numbers[..numbers.len()].copy_from_slice(numbers);
        scene.len = effects.len();
        scene.effects[..effects.len()].copy_from_slice(effects);
        Ok(scene)
    }

    /// Returns an empty scene, which makes no torque. Its revision is 0.
    #[must_use]
    pub fn empty() -> Self {
        let nothing = Kind::Constant(Constant { torque: Vec3::ZERO, frame: Frame::World });
        let unused = Effect::new(0, 0, nothing);
        Self { revision: 0, len: 0, effects: [unused; MAX_EFFECTS], numbers: [0.0; MAX_NUMBERS] }
    }

    /// Returns the revision of the scene: a number by which the controller recognises a change of
    /// scene.
    #[inline]
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Returns the effects of the scene, in the order in which their torques are added.
    #[inline]
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.effects[..self.len]
    }
    /// Returns the part `span` of the scene's table of numbers.
    ///
    /// # Panics
    /// Panics if `span` is not within the largest possible table, [`MAX_NUMBERS`].
    #[inline]
    #[must_use]
    pub fn numbers(&self, span: Span) -> &[Real] {
        let start = usize::from(span.start);
        &self.numbers[start..start + usize::from(span.len)]
    }

    /// Returns a scene that contains only the effect with the index `effect` in this scene.
    ///
    /// # Panics
    /// Panics if `effect` is not below [`MAX_EFFECTS`].
    #[must_use]
    pub fn only(&self, effect: usize) -> Self {
        let mut scene = self.clone();
        scene.effects[0] = self.effects[effect];
        scene.len = 1;
        scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an effect in `slot` that refers to the numbers from `start` on, `len` of them.
    fn effect(slot: u8, start: u16, len: u16) -> Effect {
        let nothing = Kind::Constant(Constant { torque: Vec3::ZERO, frame: Frame::World });
        Effect { numbers: Span { start, len }, ..Effect::new(slot, 1, nothing) }
    }

    #[test]
    fn a_scene_has_at_most_32_effects_each_in_a_slot_of_its_own() {
        let all: [Effect; MAX_EFFECTS] = core::array::from_fn(|slot| effect(slot as u8, 0, 0));
        assert_eq!(CompiledScene::new(1, &all).unwrap().effects(), all);
        // In any order.
        let mut backwards = all;
        backwards.reverse();
        assert_eq!(CompiledScene::new(1, &backwards).unwrap().effects(), backwards);
        let many = [all[0]; MAX_EFFECTS + 1];
        assert_eq!(CompiledScene::new(1, &many), Err(SceneError::TooMany(MAX_EFFECTS + 1)));
        for taken in [0, 7, 31] {
            let twice = [effect(taken, 0, 0), effect(1, 0, 0), effect(taken, 0, 0)];
            assert_eq!(CompiledScene::new(1, &twice), Err(SceneError::Slot(taken)));
        }
        for beyond in [32, 33, 64, 255] {
            assert_eq!(CompiledScene::new(1, &[effect(beyond, 0, 0)]), Err(SceneError::Slot(beyond)));
        }
    }

    #[test]
    fn an_effect_refers_to_numbers_that_are_in_the_table() {
        let table: [Real; MAX_NUMBERS] = core::array::from_fn(|k| k as Real);
        let scene =
            |start, len, table: &[Real]| CompiledScene::with_numbers(1, &[effect(0, start, len)], table);
        let span = Span { start: 2, len: 3 };
        assert_eq!(scene(2, 3, &table[..5]).unwrap().numbers(span), [2.0, 3.0, 4.0]);
        assert_eq!(scene(2, 3, &table[..4]), Err(SceneError::Numbers(5)));
        assert_eq!(scene(5, 0, &table[..4]), Err(SceneError::Numbers(5)));
        assert_eq!(scene(1, 0, &[]), Err(SceneError::Numbers(1)));
        assert!(scene(0, 0, &[]).is_ok());
        assert_eq!(scene(u16::MAX, u16::MAX, &table), Err(SceneError::Numbers(2 * usize::from(u16::MAX))));
        // The whole table, and one number more.
        let whole = MAX_NUMBERS as u16;
        assert_eq!(scene(0, whole, &table).unwrap().numbers(Span { start: 0, len: whole }), table);
        let longer = [0.0; MAX_NUMBERS + 1];
        assert_eq!(scene(0, 0, &longer), Err(SceneError::Numbers(MAX_NUMBERS + 1)));
    }
}
