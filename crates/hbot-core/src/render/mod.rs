//! Runs the effects of a compiled scene and keeps their memories.

pub mod around;
pub mod effects;
pub(crate) mod fades;
pub mod impedance;
pub(crate) mod lead;
pub mod model;
pub mod outline;
pub mod scene;

use crate::design::rig::Rig;
use crate::linear::limited;
use crate::real::{Quat, Real, Vec3};
use crate::render::effects::{
    Anchor, Effect, EffectState, Memory, Motion, Now, Reference, Shared, largest, mass_scale,
};
use crate::render::fades::Parts;
use crate::render::scene::{CompiledScene, MAX_EFFECTS};
use crate::rotation;

/// The tick in which a scene is rendered, and the time by which its effects advance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    /// Number of the tick.
    pub(crate) tick: u64,
    /// Time since the last tick, s. It is 0 if the effects must not advance.
    pub(crate) dt: Real,
    /// Largest turn of a reference towards its goal in the time `dt`, rad.
    pub(crate) reach: Real,
    /// Time by which the pose at which the scene is rendered is ahead of its reading, s.
    pub(crate) lead: Real,
    /// Part of `lead` that is still to come: time from this tick to the moment of the pose, s.
    pub(crate) ahead: Real,
    /// Largest turn of a reference towards its goal in the time `ahead`, rad.
    pub(crate) reach_ahead: Real,
}

impl Moment {
    pub(crate) fn without_lead(tick: u64, dt: Real, reach: Real) -> Self {
        Self { tick, dt, reach, lead: 0.0, ahead: 0.0, reach_ahead: 0.0 }
    }
}

/// Computes the torque of a scene, and keeps the memory that its effects need from tick to tick.
/// The controller uses it. Plots, studies and tests also use it without a controller.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Renderer {
    states: [EffectState; MAX_EFFECTS],
    shared: Shared,
    revision: Option<u64>,
    /// Slot of the first effect in the scene of this tick that has a reference and is not fading
    /// out, if any.
    first_reference: Option<u8>,
    /// One bit per effect, at the index `slot`. It is set if the scene of this tick has given the
    /// effect a new reference.
    placed: u32,
    /// Inertia of the sphere, kg m². Together with the loop's period (the next field, s), it limits
    /// virtual masses.
    inertia: Real,
    period: Real,
}

impl Renderer {
    /// Creates a renderer for `rig`. It holds no state of any effect until [`adopt`](Self::adopt)
    /// is called with a scene.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            states: [EffectState::EMPTY; MAX_EFFECTS],
            shared: Shared::EMPTY,
            revision: None,
            first_reference: None,
            placed: 0,
            inertia: rig.device.sphere_inertia(),
            period: rig.timing.period_s(),
        }
    }

    /// Creates a memory for each effect of `scene` that has none yet. References with the anchor
    /// [`Anchor::Here`] are placed relative to the orientation `q`. Returns true if `scene` is not
    /// the one of the last tick. Call it before [`render`](Self::render).
    #[inline(always)]
    pub fn adopt(&mut self, scene: &CompiledScene, q: Quat) -> bool {
        self.placed = 0;
        if self.revision == Some(scene.revision()) {
            return false;
        }
        self.revision = Some(scene.revision());
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            state.memory.fit(&effect.kind);
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
                    state.reference.moving = true;
                }
            }
        }
        let masses = scene.effects().iter().filter_map(|effect| {
            let (mass, smoothing) = effect.kind.mass()?;
            Some((largest(&mass) * effect.gain, smoothing))
        });
        self.shared.mass_scale = mass_scale(masses, self.inertia, self.period);
        let has = |effect: &&Effect| !effect.leaving && effect.kind.reference().is_some();
        let references = scene.effects().iter().filter(|effect| effect.kind.reference().is_some());
        self.shared.several = references.count() > 1;
        self.first_reference = scene.effects().iter().find(has).map(|effect| effect.slot);
        true
    }

    /// Returns the first effect that rests further than `limit` rad from the orientation `q`: its
    /// slot, and the distance in rad. Returns `None` if there is no such effect.
    pub(crate) fn too_far(&self, scene: &CompiledScene, q: Quat, limit: Real) -> Option<(u8, Real)> {
        scene.effects().iter().find_map(|effect| {
            let (reference, anchor) = effect.kind.reference()?;
            if effect.leaving {
                return None;
            }
            let angle = match anchor {
                // It is anchored when the rig is enabled.
                Anchor::Here => {
                    let goal = anchored(reference, anchor, q);
                    effect.kind.excess(goal, q, scene.numbers(effect.numbers))?
                }
                Anchor::Absolute => self.distance(scene, effect, q)?,
            };
            (!(angle <= limit)).then_some((effect.slot, angle))
        })
    }

    /// Returns true if an effect rests further than `limit` rad from the orientation `q`. If `any`
    /// is false, only effects are checked to which the scene of this tick has given a new
    /// reference.
    pub(crate) fn is_far(&self, scene: &CompiledScene, q: Quat, limit: Real, any: bool) -> bool {
        scene.effects().iter().filter(|effect| !effect.leaving).any(|effect| {
            let placed = any || self.placed & (1 << effect.slot) != 0;
            placed && self.distance(scene, effect, q).is_some_and(|angle| !(angle <= limit))
        })
    }

    /// Returns the distance from the orientation `q` to the nearest orientation at which `effect`
    /// rests, rad. Returns `None` for kinds of effects without such a distance.
    fn distance(&self, scene: &CompiledScene, effect: &Effect, q: Quat) -> Option<Real> {
        let goal = self.states[usize::from(effect.slot)].reference.goal;
        effect.kind.excess(goal, q, scene.numbers(effect.numbers))
    }

    /// Returns true if the reference of an effect of `scene` moves.
    pub(crate) fn is_led(&self, scene: &CompiledScene) -> bool {
        scene.effects().iter().any(|effect| self.states[usize::from(effect.slot)].reference.moving)
    }

    /// Restarts all effects of `scene` when the rig is enabled. References with the anchor
    /// [`Anchor::Here`] are placed relative to the orientation `q`. All other references jump to
    /// their goals. Every effect fades in.
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

    /// Sets the orientation that an effect's reference approaches. `omega` is the angular velocity
    /// of the reference, which is used until tick `omega_until`. `key` is the effect's slot and
    /// epoch. Returns false if the effect does not exist or has no reference.
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
        reference.moving = true;
        true
    }

    /// Returns the present reference orientation of the first effect that has one and is not fading
    /// out. It maps sphere axes to frame N. The scene is the one that was given to
    /// [`adopt`](Self::adopt).
    #[inline]
    #[must_use]
    pub fn reference(&self) -> Option<Quat> {
        let slot = self.first_reference?;
        Some(self.states.get(usize::from(slot))?.reference.q)
    }

    /// Returns the torque of the scene on the sphere in frame N, in N m. Advances all effects by
    /// `dt` seconds, the time since the last tick. References turn towards their goals by at most
    /// `reach` rad.
    pub fn render(
        &mut self,
        scene: &CompiledScene,
        motion: &Motion,
        tick: u64,
        dt: Real,
        reach: Real,
    ) -> Vec3 {
        self.render_in_tick(scene, *motion, Moment::without_lead(tick, dt, reach), |_, _| {})
    }

    /// Implements [`render`](Self::render). The tick takes it inline, because a torque that is
    /// returned through memory costs some nanoseconds. `each` is called with each effect and its
    /// torque.
    #[inline(always)]
    pub(crate) fn render_in_tick(
        &mut self,
        scene: &CompiledScene,
        motion: Motion,
        moment: Moment,
        mut each: impl FnMut(&Effect, Vec3),
    ) -> Vec3 {
        let dt = moment.dt;
        let mut torque = Vec3::ZERO;
        let gain = |effect: &Effect, state: &mut EffectState| {
            let mut gain = effect.gain;
            if effect.leaving {
                let left = effect.fade_out_s - state.leaving_s;
                if !(left > 0.0) {
                    return None;
                }
                gain *= left / effect.fade_out_s;
                state.leaving_s += dt;
            }
            if state.age_s < effect.fade_s {
                gain *= state.age_s / effect.fade_s;
                // An effect that leaves before its fade-in has ended does not get stronger.
                state.age_s += if effect.leaving { 0.0 } else { dt };
            }
            Some(gain)
        };
        self.render_each(scene, motion, moment, gain, |effect, _, part| {
            each(effect, part);
            torque += part;
        });
        torque
    }

    /// Computes the torques of all effects, as [`render`](Self::render) does, but does not add
    /// those that fade. The fades do not advance. `next` is the time until the next tick, s.
    pub(crate) fn parts(
        &mut self,
        scene: &CompiledScene,
        motion: &Motion,
        moment: Moment,
        next: Real,
    ) -> Parts {
        let mut parts = Parts::NONE;
        let gain = |effect: &Effect, state: &mut EffectState| {
            let is_gone = effect.leaving && !(effect.fade_out_s - state.leaving_s > 0.0);
            (!is_gone).then_some(effect.gain)
        };
        self.render_each(scene, *motion, moment, gain, |effect, state, torque| {
            parts.add(effect, state, torque, next);
        });
        parts
    }

    /// Advances the references and computes the torque of each effect with the gain that `gain`
    /// returns for it. An effect without a gain has faded out and is left out. `add` is called with
    /// each torque.
    #[inline(always)]
    fn render_each(
        &mut self,
        scene: &CompiledScene,
        motion: Motion,
        moment: Moment,
        gain: impl Fn(&Effect, &mut EffectState) -> Option<Real>,
        mut add: impl FnMut(&Effect, &EffectState, Vec3),
    ) {
        let Moment { tick, dt, reach, lead, ahead, reach_ahead } = moment;
        let shares = self.shared.several;
        self.shared.begin();
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            if state.reference.moving {
                advance(&mut state.reference, tick, reach);
            }
            let Some(gain) = gain(effect, state) else { continue };
            let mut led = None;
            if state.reference.moving && ahead > 0.0 {
                led = Some(led_by(&state.reference, ahead, reach_ahead));
            }
            let now = Now {
                motion,
                dt,
                lead,
                ahead,
                reference: led.as_ref().unwrap_or(&state.reference),
                numbers: scene.numbers(effect.numbers),
                shared: &mut self.shared,
                shares,
            };
            let torque = effect.kind.render(gain, now, &mut state.memory);
            add(effect, state, torque);
        }
        self.shared.end(&motion, dt);
    }

    /// Advances all fades by the fraction `part` of a tick of `dt` seconds.
    pub(crate) fn fade(&mut self, scene: &CompiledScene, dt: Real, part: Real) {
        for effect in scene.effects() {
            fades::advance(effect, &mut self.states[usize::from(effect.slot)], dt, part);
        }
    }

    /// Returns the torque that the elastic effects of the last tick would make without delay if the
    /// sphere were at rest in the orientation `q`, N m. This is their torque without damping. No
    /// effect advances.
    #[inline(never)]
    pub(crate) fn elastic_at(&mut self, scene: &CompiledScene, q: Quat) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for effect in scene.effects().iter().filter(|effect| effect.kind.is_elastic()) {
            let state = &self.states[usize::from(effect.slot)];
            let factor = fades::factor(effect, state);
            if factor > 0.0 {
                let mut memory = state.memory;
                let now = at_rest(q, effect, state, scene, &mut self.shared);
                sum += effect.kind.render(effect.gain * factor, now, &mut memory);
            }
        }
        sum
    }

    /// Returns the energy that the effects store at the orientation `q`, J, multiplied by their
    /// gains. It includes only effects whose torque, apart from damping, is the gradient of an
    /// energy. Returns `None` if there are none.
    #[must_use]
    pub fn energy(&self, scene: &CompiledScene, q: Quat) -> Option<Real> {
        let mut shared = self.shared.copy_between_moments();
        let mut sum = None;
        for effect in scene.effects().iter().filter(|effect| !effect.leaving) {
            let state = &self.states[usize::from(effect.slot)];
            let mut now = at_rest(q, effect, state, scene, &mut shared);
            if let Some(energy) = effect.kind.energy(&mut now, &state.memory) {
                sum = Some(sum.unwrap_or(0.0) + energy * effect.gain);
            }
        }
        sum
    }
}

/// Returns what an effect is evaluated with if the sphere rests in the orientation `q` and no time
/// passes.
fn at_rest<'a>(
    q: Quat,
    effect: &Effect,
    state: &'a EffectState,
    scene: &'a CompiledScene,
    shared: &'a mut Shared,
) -> Now<'a> {
    Now {
        motion: Motion { q, omega: Vec3::ZERO },
        dt: 0.0,
        lead: 0.0,
        ahead: 0.0,
        reference: &state.reference,
        numbers: scene.numbers(effect.numbers),
        shared,
        shares: false,
    }
}

/// Sets the reference of an effect as the scene gives it. If the reference is absolute and `fresh`
/// is false, it is left unchanged, because a client may have moved it.
fn anchor(effect: &Effect, state: &mut EffectState, q: Quat, fresh: bool) {
    let Some((reference, anchor)) = effect.kind.reference() else { return };
    if fresh || anchor == Anchor::Here {
        state.reference.goal = anchored(reference, anchor, q);
        state.reference.q = state.reference.goal;
    }
}

/// Returns a reference of the scene as an orientation in frame N. `q` is the sphere's present
/// orientation, to which the reference can be relative.
fn anchored(reference: Quat, anchor: Anchor, q: Quat) -> Quat {
    match anchor {
        Anchor::Absolute => reference,
        Anchor::Here => reference * q,
    }
}

/// Advances a moving reference to tick `tick`: turns it towards its goal by at most `reach` rad,
/// and ends its rate if that has expired.
fn advance(reference: &mut Reference, tick: u64, reach: Real) {
    if reference.q != reference.goal {
        approach(&mut reference.q, reference.goal, reach);
    }
    if reference.omega != Vec3::ZERO && tick >= reference.omega_until {
        reference.omega = Vec3::ZERO;
    }
    reference.moving = reference.q != reference.goal || reference.omega != Vec3::ZERO;
}

/// Returns where a moving reference will be `ahead` seconds later. It turns towards its goal by at
/// most `reach` rad, or by its own rate if it is there.
#[inline(never)]
fn led_by(reference: &Reference, ahead: Real, reach: Real) -> Reference {
    let mut led = *reference;
    if led.q != led.goal {
        approach(&mut led.q, led.goal, reach);
    } else {
        led.q = rotation::renormalized(rotation::exp(led.omega * ahead) * led.q);
    }
    led
}

/// Turns the orientation `q` towards `goal` by at most `reach` rad.
fn approach(q: &mut Quat, goal: Quat, reach: Real) {
    let way = rotation::difference(goal, *q);
    let step = limited(way, reach);
    *q = if step == way { goal } else { rotation::renormalized(rotation::exp(step) * *q) };
}
