//! Runs the effects of a compiled scene, and keeps what they remember.

use crate::effects::{Anchor, Effect, EffectState, Motion};
use crate::real::{Quat, Real, Vec3};
use crate::rotation;
use crate::scene::{CompiledScene, MAX_EFFECTS};
use crate::shaping::limited;

/// The memories of all effects.
#[derive(Debug, Clone)]
pub(crate) struct Renderer {
    states: [EffectState; MAX_EFFECTS],
    revision: Option<u64>,
}

impl Renderer {
    pub(crate) const EMPTY: Self = Self { states: [EffectState::EMPTY; MAX_EFFECTS], revision: None };

    /// Makes a fresh memory for each effect that has none. True where `scene` is not that of the last tick.
    #[inline]
    pub(crate) fn adopt(&mut self, scene: &CompiledScene, q: Quat) -> bool {
        if self.revision == Some(scene.revision()) {
            return false;
        }
        self.revision = Some(scene.revision());
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            if state.epoch != effect.epoch {
                *state = EffectState { epoch: effect.epoch, ..EffectState::EMPTY };
                state.reference_revision = effect.reference_revision;
                anchor(effect, state, q, true);
            } else if state.reference_revision != effect.reference_revision {
                state.reference_revision = effect.reference_revision;
                if let Some((reference, anchor)) = effect.kind.reference() {
                    state.reference.goal = anchored(reference, anchor, q);
                }
            }
        }
        true
    }

    /// Every spring's reference must be within `limit` rad of `q`: the first that is not, with its distance.
    pub(crate) fn too_far(&self, scene: &CompiledScene, q: Quat, limit: Real) -> Option<(u8, Real)> {
        scene.effects().iter().find_map(|effect| {
            let (_, anchor) = effect.kind.reference()?;
            if anchor == Anchor::Here {
                return None;
            }
            let angle = rotation::angle_between(self.states[usize::from(effect.slot)].reference.goal, q);
            (!(angle <= limit)).then_some((effect.slot, angle))
        })
    }

    /// Begins anew at enable: references anchored here, absolute ones at their goals, everything fading in.
    pub(crate) fn enable(&mut self, scene: &CompiledScene, q: Quat) {
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            state.age_s = 0.0;
            state.branch = Vec3::ZERO;
            state.reference.q = state.reference.goal;
            anchor(effect, state, q, false);
        }
    }

    /// Sets the goal of an effect's reference and the rate that it is said to have until tick `omega_until`.
    pub(crate) fn refer(
        &mut self,
        scene: &CompiledScene,
        key: (u8, u32),
        goal: Quat,
        omega: Vec3,
        omega_until: u64,
    ) -> bool {
        let (slot, epoch) = key;
        let has = |e: &&Effect| e.slot == slot && e.epoch == epoch && e.kind.reference().is_some();
        if scene.effects().iter().find(has).is_none() {
            return false;
        }
        let reference = &mut self.states[usize::from(slot)].reference;
        reference.goal = goal;
        reference.omega = omega;
        reference.omega_until = omega_until;
        true
    }

    /// The scene's torque on the sphere in N, N m. References move by at most `reach` rad.
    #[inline]
    pub(crate) fn torque(
        &mut self,
        scene: &CompiledScene,
        motion: &Motion,
        tick: u64,
        dt: Real,
        reach: Real,
    ) -> Vec3 {
        let mut torque = Vec3::ZERO;
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            let reference = &mut state.reference;
            if reference.q != reference.goal {
                approach(&mut reference.q, reference.goal, reach);
            }
            if reference.omega != Vec3::ZERO && tick >= reference.omega_until {
                reference.omega = Vec3::ZERO;
            }
            let mut gain = effect.gain;
            if state.age_s < effect.fade_s {
                gain *= state.age_s / effect.fade_s;
                state.age_s += dt;
            }
            torque += effect.kind.torque(motion, state) * gain;
        }
        torque
    }
}

/// Puts the reference where its anchor says; an absolute one only when `fresh`, since a client may have moved it.
fn anchor(effect: &Effect, state: &mut EffectState, q: Quat, fresh: bool) {
    let Some((reference, anchor)) = effect.kind.reference() else { return };
    if fresh || anchor == Anchor::Here {
        state.reference.goal = anchored(reference, anchor, q);
        state.reference.q = state.reference.goal;
    }
}

/// Where a reference of the scene stands in N.
fn anchored(reference: Quat, anchor: Anchor, q: Quat) -> Quat {
    match anchor {
        Anchor::Absolute => reference,
        Anchor::Here => reference * q,
    }
}

/// Turns `q` towards `goal` by at most `reach` rad.
fn approach(q: &mut Quat, goal: Quat, reach: Real) {
    let way = rotation::difference(goal, *q);
    let step = limited(way, reach);
    *q = if step == way { goal } else { rotation::renormalized(rotation::exp(step) * *q) };
}
