//! Runs the effects of a compiled scene and keeps their memories.

use crate::effects::{Anchor, Effect, EffectState, Memory, Motion, Now, Reference, Shared, mass_scale};
use crate::real::{Quat, Real, Vec3};
use crate::rig::Rig;
use crate::rotation;
use crate::scene::{CompiledScene, MAX_EFFECTS};
use crate::shaping::limited;

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
    #[cfg_attr(feature = "exact", serde(skip))]
    parts: Parts,
}

/// Parts of a scene's torque that the passivity controller treats differently, in frame N, N m. The
/// rest moves the sphere on purpose: constant torques, vibrations, moving references.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Parts {
    /// Torque that depends on the sphere's orientation and gives back the energy that it took.
    pub(crate) elastic: Vec3,
    /// Torque that resists the sphere's rate.
    pub(crate) resisting: Vec3,
}

impl Parts {
    const NOTHING: Self = Self { elastic: Vec3::ZERO, resisting: Vec3::ZERO };

    /// Adds the parts of the torque `own` (N m) of the effect that has just been rendered with
    /// `gain`. An effect whose reference moves is driven: `moving` is then true.
    #[inline]
    fn add(&mut self, own: Vec3, gain: Real, shared: &mut Shared, moving: bool) {
        let resisting = core::mem::take(&mut shared.resisting) * gain;
        if !core::mem::take(&mut shared.driving) && !moving {
            self.resisting += resisting;
            self.elastic += own - resisting;
        }
    }
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
            parts: Parts::NOTHING,
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
            Some((mass * effect.gain, smoothing))
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
            let (_, anchor) = effect.kind.reference()?;
            if anchor == Anchor::Here || effect.leaving {
                return None;
            }
            let angle = self.distance(scene, effect, q)?;
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
        self.render_in_tick(scene, *motion, tick, dt, reach)
    }

    /// Implements [`render`](Self::render). The tick takes it inline, because a torque that is
    /// returned through memory costs some nanoseconds.
    #[inline(always)]
    pub(crate) fn render_in_tick(
        &mut self,
        scene: &CompiledScene,
        motion: Motion,
        tick: u64,
        dt: Real,
        reach: Real,
    ) -> Vec3 {
        let mut torque = Vec3::ZERO;
        self.parts = Parts::NOTHING;
        self.shared.begin();
        for effect in scene.effects() {
            let state = &mut self.states[usize::from(effect.slot)];
            if state.reference.moving {
                advance(&mut state.reference, tick, reach);
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
            let now = Now {
                motion,
                dt,
                reference: &state.reference,
                numbers: scene.numbers(effect.numbers),
                shared: &mut self.shared,
            };
            let own = effect.kind.render(gain, now, &mut state.memory);
            torque += own;
            if self.shared.parted {
                self.parts.add(own, gain, &mut self.shared, state.reference.moving);
            }
        }
        self.shared.end(&motion, dt);
        torque
    }

    /// Says whether [`render_in_tick`](Self::render_in_tick) also computes the parts of the torque,
    /// which [`parts`](Self::parts) returns.
    #[inline]
    pub(crate) fn part(&mut self, parted: bool) {
        self.shared.parted = parted;
    }

    /// Returns the parts of the last rendered torque.
    #[inline]
    pub(crate) fn parts(&self) -> Parts {
        self.parts
    }

    /// Returns the energy that the effects store at the orientation `q`, J, multiplied by their
    /// gains. It includes only effects whose torque, apart from damping, is the gradient of an
    /// energy. Returns `None` if there are none.
    #[must_use]
    pub fn energy(&self, scene: &CompiledScene, q: Quat) -> Option<Real> {
        let motion = Motion { q, omega: Vec3::ZERO };
        let mut shared = self.shared.copy_between_moments();
        let mut sum = None;
        for effect in scene.effects().iter().filter(|effect| !effect.leaving) {
            let state = &self.states[usize::from(effect.slot)];
            let mut now = Now {
                motion,
                dt: 0.0,
                reference: &state.reference,
                numbers: scene.numbers(effect.numbers),
                shared: &mut shared,
            };
            if let Some(energy) = effect.kind.energy(&mut now, &state.memory) {
                sum = Some(sum.unwrap_or(0.0) + energy * effect.gain);
            }
        }
        sum
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

/// Turns the orientation `q` towards `goal` by at most `reach` rad.
fn approach(q: &mut Quat, goal: Quat, reach: Real) {
    let way = rotation::difference(goal, *q);
    let step = limited(way, reach);
    *q = if step == way { goal } else { rotation::renormalized(rotation::exp(step) * *q) };
}
