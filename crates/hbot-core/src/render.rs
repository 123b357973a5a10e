//! Runs the effects of a compiled scene and keeps their memories.

use crate::effects::{Anchor, Effect, EffectState, Memory, Motion, Now, Shared, mass_scale};
use crate::real::{Quat, Real, Vec3};
use crate::rig::Rig;
use crate::rotation;
use crate::scene::{CompiledScene, MAX_EFFECTS};
use crate::shaping::limited;

/// Computes the torque of a scene and keeps the memories of its effects. Used by the controller,
/// and alone for plots, studies and tests.
#[derive(Debug, Clone)]
pub struct Renderer {
    states: [EffectState; MAX_EFFECTS],
    shared: Shared,
    revision: Option<u64>,
    /// One bit per slot, set if the scene of this tick has placed the effect's reference anew.
    placed: u32,
    /// The sphere's own inertia, kg m², and the loop's period, s. Both limit virtual masses.
    inertia: Real,
    period: Real,
}

impl Renderer {
    /// Creates a renderer for `rig`. No effect has a memory yet.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            states: [EffectState::EMPTY; MAX_EFFECTS],
            shared: Shared::EMPTY,
            revision: None,
            placed: 0,
            inertia: rig.device.sphere_inertia(),
            period: rig.timing.period_s(),
        }
    }

    /// Creates a memory, anchored at the orientation `q`, for each effect of `scene` that has none.
    /// Returns true if `scene` differs from that of the last tick. Call it before
    /// [`render`](Self::render).
    #[inline]
    pub fn adopt(&mut self, scene: &CompiledScene, q: Quat) -> bool {
        self.placed = 0;
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
                self.placed |= 1 << effect.slot;
            } else if state.reference_revision != effect.reference_revision {
                state.reference_revision = effect.reference_revision;
                self.placed |= 1 << effect.slot;
                if let Some((reference, anchor)) = effect.kind.reference() {
                    state.reference.goal = anchored(reference, anchor, q);
                }
            }
        }
        let masses = scene.effects().iter().filter_map(|effect| {
            let (mass, smoothing) = effect.kind.mass()?;
            Some((mass * effect.gain, smoothing))
        });
        self.shared.mass_scale = mass_scale(masses, self.inertia, self.period);
        true
    }

    /// Returns the slot of the first effect that is not at rest within `limit` rad of `q`, and its
    /// distance in rad. Returns `None` if all effects are near enough.
    pub(crate) fn too_far(&self, scene: &CompiledScene, q: Quat, limit: Real) -> Option<(u8, Real)> {
        scene.effects().iter().find_map(|effect| {
            let (_, anchor) = effect.kind.reference()?;
            if anchor == Anchor::Here || effect.leaving {
                return None;
            }
            let angle = self.distance(scene, effect, q)?;
            (!(angle <= limit)).then_some((effect.slot, angle))
        })
    }

    /// Returns true if an effect that the scene of this tick has placed anew rests further than
    /// `limit` rad from `q`. With `any`, all effects count.
    pub(crate) fn is_far(&self, scene: &CompiledScene, q: Quat, limit: Real, any: bool) -> bool {
        scene.effects().iter().filter(|effect| !effect.leaving).any(|effect| {
            let placed = any || self.placed & (1 << effect.slot) != 0;
            placed && self.distance(scene, effect, q).is_some_and(|angle| !(angle <= limit))
        })
    }

    /// Returns the distance in rad from `q` to where `effect` rests, or `None` for kinds that rest
    /// everywhere or nowhere.
    fn distance(&self, scene: &CompiledScene, effect: &Effect, q: Quat) -> Option<Real> {
        let goal = self.states[usize::from(effect.slot)].reference.goal;
        effect.kind.excess(goal, q, scene.figures(effect.figures))
    }

    /// Restarts the effects at enable. Relative references are anchored at `q`, absolute ones jump
    /// to their goals, and every effect fades in.
    pub(crate) fn enable(&mut self, scene: &CompiledScene, q: Quat) {
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            if effect.leaving {
                // An effect that was fading out when the rig went idle does not come back.
                state.leaving_s = Real::INFINITY;
                continue;
            }
            state.age_s = 0.0;
            state.memory = Memory::None;
            state.reference.q = state.reference.goal;
            anchor(effect, state, q, false);
        }
        self.shared.restart();
    }

    /// Sets the goal of an effect's reference, and the rate that the client states for it until
    /// tick `omega_until`. Returns false if the effect does not exist or has no reference.
    pub(crate) fn set_reference(
        &mut self,
        scene: &CompiledScene,
        key: (u8, u32),
        goal: Quat,
        omega: Vec3,
        omega_until: u64,
    ) -> bool {
        let (slot, epoch) = key;
        let has =
            |e: &&Effect| e.slot == slot && e.epoch == epoch && !e.leaving && e.kind.reference().is_some();
        if scene.effects().iter().find(has).is_none() {
            return false;
        }
        let reference = &mut self.states[usize::from(slot)].reference;
        reference.goal = goal;
        reference.omega = omega;
        reference.omega_until = omega_until;
        true
    }

    /// Returns the present reference of the first effect that has one and is not fading out. It
    /// maps sphere axes to frame N.
    #[inline]
    #[must_use]
    pub fn reference(&self, scene: &CompiledScene) -> Option<Quat> {
        let has = |effect: &&Effect| !effect.leaving && effect.kind.reference().is_some();
        let effect = scene.effects().iter().find(has)?;
        Some(self.states[usize::from(effect.slot)].reference.q)
    }

    /// Advances all effects by `dt` seconds, the time since the last tick, and turns references by
    /// at most `reach` rad. Returns the scene's torque on the sphere in frame N, N m.
    #[inline]
    pub fn render(
        &mut self,
        scene: &CompiledScene,
        motion: &Motion,
        tick: u64,
        dt: Real,
        reach: Real,
    ) -> Vec3 {
        let mut torque = Vec3::ZERO;
        self.shared.begin();
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
            if effect.leaving {
                let left = effect.fade_out_s - state.leaving_s;
                if !(left > 0.0) {
                    continue;
                }
                gain *= left / effect.fade_out_s;
                state.leaving_s += dt;
            }
            if state.age_s < effect.fade_s {
                gain *= state.age_s / effect.fade_s;
                // An effect that leaves before its fade-in has ended does not get stronger.
                state.age_s += if effect.leaving { 0.0 } else { dt };
            }
            let mut now = Now {
                motion,
                dt,
                reference: &state.reference,
                figures: scene.figures(effect.figures),
                shared: &mut self.shared,
            };
            torque += effect.kind.render(&mut now, &mut state.memory) * gain;
        }
        self.shared.end(motion, dt);
        torque
    }

    /// Returns the energy stored in the effects at the orientation `q`, J, with their gains. Only
    /// effects count whose torque, apart from damping, is the gradient of an energy. Returns `None`
    /// if there are none.
    #[must_use]
    pub fn energy(&self, scene: &CompiledScene, q: Quat) -> Option<Real> {
        let motion = Motion { q, omega: Vec3::ZERO };
        let mut shared = self.shared.copy_between_moments();
        let mut sum = None;
        for effect in scene.effects().iter().filter(|effect| !effect.leaving) {
            let state = &self.states[usize::from(effect.slot)];
            let mut now = Now {
                motion: &motion,
                dt: 0.0,
                reference: &state.reference,
                figures: scene.figures(effect.figures),
                shared: &mut shared,
            };
            if let Some(energy) = effect.kind.energy(&mut now, &state.memory) {
                sum = Some(sum.unwrap_or(0.0) + energy * effect.gain);
            }
        }
        sum
    }
}

/// Sets the reference of an effect by its anchor. An absolute reference is set only if `fresh`,
/// since a client may have moved it.
fn anchor(effect: &Effect, state: &mut EffectState, q: Quat, fresh: bool) {
    let Some((reference, anchor)) = effect.kind.reference() else { return };
    if fresh || anchor == Anchor::Here {
        state.reference.goal = anchored(reference, anchor, q);
        state.reference.q = state.reference.goal;
    }
}

/// Returns the orientation in frame N of a reference of the scene. `q` is the present orientation.
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
