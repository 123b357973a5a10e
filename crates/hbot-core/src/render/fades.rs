//! Limits what effects ask for while they fade, so that every change of scene follows its fade.
//!
//! Each effect i makes the torque T_i and has a fade factor f_i, 0 to 1. If the sum of f_i T_i were
//! limited, an effect that asks for a hundred times the limit L would reach the limit after a
//! hundredth of its fade. If each T_i were limited by itself, a scene would make another torque
//! than without fades: a wall that asks for 5 N m would not hold a spring that asks for 3 N m any
//! more.
//!
//! So the limit is applied to whole sums, and the fades blend between these. A change of scene is a
//! way from one set of effects to another. A number u from 0 to 1 names a place on this way:
//! effects that come take part where u < f_i, and effects that go where u > 1 - f_i. The torque is
//! the mean
//!
//! ```text
//! T = integral over u from 0 to 1 of L(sum of the torques of the effects that take part at u)
//! ```
//!
//! where L shortens a vector to the limit. If all factors are 1, T is the limited sum of all
//! torques. If no sum is above the limit, T is the sum of f_i T_i. An effect that comes alone and
//! asks for more than the limit makes f_i L(T_i). If one effect comes while another goes, T goes
//! straight from the torque of the one to that of the other. T is continuous in the factors and
//! never above the limit. For effects that only come, this is the Lovász extension of the function
//! that gives a set of effects its limited sum (Lovász 1983, Submodular functions and convexity).

use crate::real::{Real, Vec3, sqrt};
use crate::render::effects::{Effect, EffectState};
use crate::render::scene::MAX_EFFECTS;

/// Whether a change of scene is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Fades {
    /// No controller has it. It keeps the numbers of the others in recordings.
    #[cfg_attr(not(feature = "exact"), expect(dead_code, reason = "recordings number the variants"))]
    Unused,
    /// No effect fades.
    Over,
    /// An effect may be fading.
    Running,
}

/// The torques of a scene's effects in one tick, with their fade factors.
#[derive(Debug)]
pub(crate) struct Parts {
    /// Sum of the torques of the effects that do not fade, N m.
    pub(crate) full: Vec3,
    /// Sum of the torques of the elastic effects with their fade factors, before the limit, N m.
    pub(crate) elastic: Vec3,
    len: usize,
    fading: [Part; MAX_EFFECTS],
}

/// The torque of an effect that fades.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Torque of the effect without its fade factor, N m.
    torque: Vec3,
    leaving: bool,
    /// Fade factor of this tick, 0 to 1.
    factor: Real,
    /// Fade factor of the next tick, if the fade takes its time.
    next: Real,
}

impl Part {
    /// Returns the place at which the effect begins or ends to take part, 0 to 1, with the fade
    /// `advance` ticks further than in this tick.
    fn edge(&self, advance: Real) -> Real {
        let factor = self.factor + (self.next - self.factor) * advance;
        if self.leaving { 1.0 - factor } else { factor }
    }
}

impl Parts {
    pub(crate) const NONE: Self = {
        let none = Part { torque: Vec3::ZERO, leaving: false, factor: 0.0, next: 0.0 };
        Self { full: Vec3::ZERO, elastic: Vec3::ZERO, len: 0, fading: [none; MAX_EFFECTS] }
    };

    /// Adds the torque of an effect, N m, without its fade factor. `time` is the time step of the
    /// tick, s.
    pub(crate) fn add(&mut self, effect: &Effect, state: &EffectState, torque: Vec3, time: Real) {
        let factor = factor(effect, state);
        let next = factor_after(effect, state, time);
        if effect.kind.is_elastic() {
            self.elastic += torque * factor;
        }
        if factor == 1.0 && next == 1.0 {
            self.full += torque;
            return;
        }
        // A scene has no more effects than the list has places.
        if let Some(place) = self.fading.get_mut(self.len) {
            *place = Part { torque, leaving: effect.leaving, factor, next };
            self.len += 1;
        }
    }

    /// Returns true if no effect fades.
    pub(crate) fn is_over(&self) -> bool {
        self.len == 0
    }

    /// Returns the torque of the scene, N m, as the module's documentation defines it, and the
    /// fraction that remains after the limit, 0 to 1. The fades are `advance` ticks further than in
    /// this tick, 0 to 1. `limit` returns the limited form of a sum of torques, and the fraction of
    /// it that remains.
    pub(crate) fn torque(&self, advance: Real, limit: impl Fn(Vec3) -> (Vec3, Real)) -> (Vec3, Real) {
        let parts = &self.fading[..self.len];
        // The places at which an effect begins or ends to take part, in order.
        let mut edges = [1.0; MAX_EFFECTS + 1];
        for (k, part) in parts.iter().enumerate() {
            let edge = part.edge(advance);
            let at = edges[..k].iter().position(|other| *other > edge).unwrap_or(k);
            edges.copy_within(at..k, at + 1);
            edges[at] = edge;
        }
        edges[self.len] = 1.0;
        let (mut torque, mut share, mut from) = (Vec3::ZERO, 0.0, 0.0);
        for to in &edges[..=self.len] {
            // Effects with equal factors fade together.
            if *to > from {
                let mut sum = self.full;
                for part in parts {
                    let edge = part.edge(advance);
                    let takes_part = if part.leaving { edge <= from } else { edge >= *to };
                    if takes_part {
                        sum += part.torque;
                    }
                }
                let (limited, remains) = limit(sum);
                torque += limited * (to - from);
                share += remains * (to - from);
                from = *to;
            }
        }
        // The weights add up to 1, except for rounding.
        (torque, share.min(1.0))
    }

    /// Returns how far the fades and a blend go until the next tick, 0 to 1 of the usual way.
    ///
    /// It is less than 1 if the torque would otherwise change by more than `most`, N m, from their
    /// progress alone. `blend` is the change that the blend makes in its usual way, and `gain` the
    /// factor of the soft start.
    pub(crate) fn advance_within(
        &self,
        most: Real,
        blend: Vec3,
        gain: Real,
        limit: impl Fn(Vec3) -> (Vec3, Real),
    ) -> Real {
        let (now, _) = self.torque(0.0, &limit);
        let change = |advance: Real| {
            ((self.torque(advance, &limit).0 - now) * gain + blend * advance).length_squared()
        };
        let whole = change(1.0);
        // A blend at its steepest may exceed the bound by its rounding.
        let bound = most * most * (1.0 + 256.0 * Real::EPSILON);
        if !(whole > bound) {
            return 1.0;
        }
        // The torque is piecewise linear in the progress. So this is exact unless the order of the
        // effects on the way changes within the tick.
        let mut advance = most / sqrt(whole);
        if change(advance) > bound {
            let (mut low, mut high) = (0.0, advance);
            for _ in 0..16 {
                let middle = 0.5 * (low + high);
                if change(middle) > bound { high = middle } else { low = middle }
            }
            advance = low;
        }
        advance
    }
}

/// Returns the fade factor of an effect, 0 to 1.
pub(crate) fn factor(effect: &Effect, state: &EffectState) -> Real {
    factor_after(effect, state, 0.0)
}

/// Returns the fade factor of an effect in `time` seconds, 0 to 1.
fn factor_after(effect: &Effect, state: &EffectState, time: Real) -> Real {
    let [age, left] = clock_after(effect, state, time);
    let fade_in = if age < effect.fade_s { age / effect.fade_s } else { 1.0 };
    let fade_out = if effect.leaving { (effect.fade_out_s - left) / effect.fade_out_s } else { 1.0 };
    fade_in * fade_out
}

/// Returns the times since the fade-in and the fade-out of an effect began, s, in `time` seconds.
/// An effect that leaves before its fade-in has ended does not get stronger.
fn clock_after(effect: &Effect, state: &EffectState, time: Real) -> [Real; 2] {
    if effect.leaving {
        [state.age_s, (state.leaving_s + time).min(effect.fade_out_s)]
    } else {
        [(state.age_s + time).min(effect.fade_s), state.leaving_s]
    }
}

/// Advances the fade of an effect by the fraction `advance` of its way in a tick of `time` seconds.
pub(crate) fn advance(effect: &Effect, state: &mut EffectState, time: Real, advance: Real) {
    let [age, left] = clock_after(effect, state, time);
    for (clock, next) in [(&mut state.age_s, age), (&mut state.leaving_s, left)] {
        // A fade that is over stays over.
        if next > *clock {
            *clock = if advance == 1.0 { next } else { *clock + (next - *clock) * advance };
        }
    }
}
