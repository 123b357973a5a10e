//! The input of an effect in one tick. Effects share derived quantities: each is computed at most
//! once per tick, and only if an effect asks for it.

use super::geometry::Dial;
use super::target::Reference;
use crate::real::{Quat, Real, Vec3, sqrt};
use crate::render::scene::MAX_EFFECTS;
use crate::rotation::{angle_over_sine, exp, renormalized, shortest, vector_part};

/// The motion of the sphere at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion {
    /// Orientation of the sphere: it maps sphere axes to frame N.
    pub q: Quat,
    /// Angular velocity of the sphere in frame N, rad/s.
    pub omega: Vec3,
}

/// The input of one effect in one tick: the sphere's motion, the time step and the effect's
/// reference.
pub(crate) struct Now<'a> {
    pub(crate) motion: Motion,
    /// Time since the last tick, s. It is 0 if the torque is only evaluated and the effect must not
    /// advance.
    pub(crate) dt: Real,
    /// Time by which the pose `motion.q` is ahead of its reading, s, and the part of this time that
    /// is still to come, s. Both are 0 without a lead.
    pub(crate) lead: Real,
    pub(crate) ahead: Real,
    /// The orientation from which the effect is measured, and its rate.
    pub(crate) reference: &'a Reference,
    /// The effect's part of the scene's table of numbers.
    pub(crate) numbers: &'a [Real],
    pub(crate) shared: &'a mut Shared,
    /// True if quantities are looked up in `shared`, because other effects may need them too.
    pub(crate) shares: bool,
}

impl Now<'_> {
    /// Returns x = q_d⁻¹ q: the sphere's orientation relative to the effect's reference q_d. Its
    /// scalar part eta is not negative.
    #[inline(always)]
    pub(crate) fn relative(&mut self) -> Quat {
        let (desired, q) = (self.reference.q, self.motion.q);
        let make = || shortest(desired.conjugate() * q);
        if self.shares { self.shared.relatives.get(desired, make) } else { make() }
    }

    /// Returns t / sin(t/2) and the rotation vector p of the sphere's orientation relative to the
    /// effect's reference, rad. t is the length of p.
    #[inline]
    pub(crate) fn log(&mut self) -> (Real, Vec3) {
        let x = self.relative();
        self.log_of(x)
    }

    /// Returns the same as [`log`](Self::log). `x` must be the result of
    /// [`relative`](Self::relative); a law that already has it saves a second search for it.
    #[inline(always)]
    pub(crate) fn log_of(&mut self, x: Quat) -> (Real, Vec3) {
        let make = || {
            let factor = angle_over_sine(x.w, vector_part(x));
            (factor, vector_part(x) * factor)
        };
        if self.shares { self.shared.logs.get(self.reference.q, make) } else { make() }
    }

    /// Returns the twist of the sphere about the unit vector `axis`, relative to the effect's
    /// reference.
    #[inline]
    pub(crate) fn dial(&mut self, axis: Vec3) -> Dial {
        let x = self.relative();
        let make = || Dial::new(x, axis);
        if self.shares { self.shared.dials.get((self.reference.q, axis), make) } else { make() }
    }

    /// Shortens the lead until the pose is at most `most` rad ahead of its reading. Returns whether
    /// the pose has changed.
    ///
    /// A law that bends within `most` calls it before it uses the pose. Let the torque be a wave of
    /// the wave number k that is crossed at the rate v, tau the delay and c tau the lead. With q =
    /// k v tau the loop gives out energy in proportion to sin(q)/q - c cos(q). So a lead takes
    /// energy out as long as it is below a quarter of a wave, q = pi/2, and gives energy out
    /// beyond. A lead of a constant angle does neither.
    #[inline]
    pub(crate) fn lead_at_most(&mut self, most: Real) -> bool {
        if self.lead == 0.0 {
            return false;
        }
        let turn = self.motion.omega * self.lead;
        let length2 = turn.length_squared();
        let is_longer = length2 > most * most;
        if is_longer {
            let back = turn * (most / sqrt(length2) - 1.0);
            self.motion.q = renormalized(exp(back) * self.motion.q);
            self.lead *= most / sqrt(length2);
            self.shares = false;
        }
        is_longer
    }

    /// Returns the sphere's angular velocity minus that of the effect's reference, in the
    /// reference's frame, rad/s.
    #[inline]
    pub(crate) fn rate(&self) -> Vec3 {
        self.reference.q.conjugate() * (self.motion.omega - self.reference.omega)
    }

    /// Returns the sphere's angular acceleration in frame N, rad/s²: the change of its rate since
    /// the last tick, not filtered. It is 0 in the first tick in which an effect asks for it.
    #[inline]
    pub(crate) fn acceleration(&mut self) -> Vec3 {
        let (omega, dt) = (self.motion.omega, self.dt);
        self.shared.accelerations.get((), || match self.shared.last_omega {
            Some(last) if dt > 0.0 => (omega - last) / dt,
            _ => Vec3::ZERO,
        })
    }

    /// Converts a torque from the frame of the effect's reference to frame N.
    #[inline]
    pub(crate) fn in_n(&self, torque: Vec3) -> Vec3 {
        self.reference.q * torque
    }
}

/// Quantities that several effects need in one tick. Each is computed only once.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
// The tables are empty before each tick, so they are no part of a stored state.
#[cfg_attr(feature = "exact", serde(default = "Shared::empty"))]
pub(crate) struct Shared {
    #[cfg_attr(feature = "exact", serde(skip))]
    relatives: Memo<Quat, Quat, MAX_EFFECTS>,
    #[cfg_attr(feature = "exact", serde(skip))]
    logs: Memo<Quat, (Real, Vec3), MAX_EFFECTS>,
    #[cfg_attr(feature = "exact", serde(skip))]
    dials: Memo<(Quat, Vec3), Dial, MAX_EFFECTS>,
    #[cfg_attr(feature = "exact", serde(skip))]
    accelerations: Memo<(), Vec3, 1>,
    /// The sphere's angular velocity in the last tick, if an effect asked for the acceleration in
    /// that tick.
    last_omega: Option<Vec3>,
    /// Factor, 0 to 1, by which all virtual masses are scaled to keep them stable (see
    /// [`Inertia`](super::Inertia)).
    pub(crate) mass_scale: Real,
    /// True if the scene has several effects with a reference. If it has only one, no other can
    /// need its orientation relative to the reference, so it is not stored.
    pub(crate) several: bool,
}

impl Shared {
    pub(crate) const EMPTY: Self = Self {
        relatives: Memo::new(Quat::IDENTITY, Quat::IDENTITY),
        logs: Memo::new(Quat::IDENTITY, (0.0, Vec3::ZERO)),
        dials: Memo::new((Quat::IDENTITY, Vec3::ZERO), Dial::NONE),
        accelerations: Memo::new((), Vec3::ZERO),
        last_omega: None,
        mass_scale: 1.0,
        several: false,
    };

    #[cfg(feature = "exact")]
    fn empty() -> Self {
        Self::EMPTY
    }

    /// Returns a copy with which effects can be evaluated at another motion without changing the
    /// original.
    pub(crate) fn copy_between_moments(&self) -> Self {
        Self { last_omega: self.last_omega, mass_scale: self.mass_scale, ..Self::EMPTY }
    }

    /// Clears the quantities of the last tick. Called before the effects of a tick are rendered.
    #[inline]
    pub(crate) fn begin(&mut self) {
        self.relatives.len = 0;
        self.logs.len = 0;
        self.dials.len = 0;
        self.accelerations.len = 0;
    }

    /// Stores the sphere's angular velocity for the next tick, if an effect asked for the
    /// acceleration in this tick. `dt` is the time step of this tick, s.
    #[inline]
    pub(crate) fn end(&mut self, motion: &Motion, dt: Real) {
        if self.accelerations.len == 0 {
            self.last_omega = None;
        } else if dt > 0.0 {
            self.last_omega = Some(motion.omega);
        }
    }

    /// Clears the stored angular velocity of the last tick, so that the next acceleration is 0.
    pub(crate) fn restart(&mut self) {
        self.last_omega = None;
    }
}

/// A small table of values that were already computed in this tick, with the inputs from which they
/// were computed.
#[derive(Debug, Clone)]
struct Memo<K, V, const N: usize> {
    len: usize,
    keys: [K; N],
    values: [V; N],
}

impl<K: Copy + PartialEq, V: Copy, const N: usize> Memo<K, V, N> {
    const fn new(key: K, value: V) -> Self {
        Self { len: 0, keys: [key; N], values: [value; N] }
    }

    #[inline(always)]
    fn get(&mut self, key: K, make: impl FnOnce() -> V) -> V {
        let len = self.len;
        if let Some(i) = self.keys[..len].iter().position(|known| *known == key) {
            return self.values[i];
        }
        let value = make();
        // The table has as many places as there are effects. An effect that needs more than one
        // place computes its value again.
        if len < N {
            self.keys[len] = key;
            self.values[len] = value;
            self.len = len + 1;
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_not_computed_again() {
        let mut memo: Memo<u8, u8, 3> = Memo::new(0, 0);
        let mut made = 0;
        for key in [1, 2, 1, 3, 2, 3, 1] {
            let value = memo.get(key, || {
                made += 1;
                10 * key
            });
            assert_eq!(value, 10 * key);
        }
        assert_eq!(made, 3);
        // A full table still answers.
        assert_eq!(memo.get(9, || 90), 90);
    }
}
