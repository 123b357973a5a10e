//! The guard against a sphere that shakes by itself, for example because a spring is too stiff for
//! the delay of the loop.
//!
//! The sphere shakes by itself if its rate about an axis of frame N reverses again and again and
//! the motors give out energy while it does. One cycle is the time between two crossings of the
//! rate above `LEAST_RATE`, with a crossing below minus this rate in between. The guard acts
//! after `CYCLES` cycles in a row that are each shorter than `LONGEST_CYCLE_S`, if the
//! passivity observer says that the rig has given out energy in them: at least `LEAST_ENERGY`
//! times the kinetic energy of the sphere at its largest rate.
//!
//! A spring that rings out gives no energy, but the observer alone could say so: the spring gives
//! to the sphere's own friction what it had stored, and sphere and spring exchange it with another
//! phase about each axis. So what the effects have stored less at the end of the cycles than at
//! their beginning does not count. The guard takes the lesser of the two energies.
//!
//! A client's stream, a reference that moves, and effects that give out energy on purpose are
//! reasons to swing. So after the first cycle the guard adds up the energy that each effect gives
//! out, by the torques and delays of the observer. If an effect that does so on purpose gives half
//! as much as the worst of the others, or more, it does nothing. To blame is the effect that gave
//! most while it gave: in a swing that grows, even the culprit has just stored more than it gave.
//!
//! The guard halves the torque, and halves it again in each further cycle, until the sphere is
//! calm. Then the torque comes back slowly. If the sphere shakes again on the way, the torque stays
//! below 60 % of the fraction at which it did, until the scene changes or the rig is enabled.

use crate::real::{Real, Vec3};
use crate::render::scene::MAX_EFFECTS;

/// Rate that counts as a swing, rad/s.
const LEAST_RATE: Real = 0.2;
/// Number of cycles in a row after which the guard acts.
const CYCLES: usize = 3;
/// Longest cycle, s. Hands hardly swing faster than 5 Hz, and hardly give less energy than they
/// take when they do.
const LONGEST_CYCLE_S: Real = 0.2;
/// Longest cycle while the torque is lowered, s. Less torque swings more slowly.
const LONGEST_LOWERED_S: Real = 0.4;
/// Energy that the motors give out in [`CYCLES`] cycles, relative to the kinetic energy of the
/// sphere at its largest rate.
const LEAST_ENERGY: Real = 0.1;
/// Time in which the torque falls from its full value to zero, s.
const FALL_S: Real = 0.05;
/// Time in which the torque rises from zero to its full value, s.
const RISE_S: Real = 4.0;
/// Time without a cycle after which the sphere is calm, s.
const CALM_S: Real = 0.5;
/// If the sphere shakes again, the torque stays below this part of the fraction at which it did.
const BELOW: Real = 0.6;
/// Number of past ticks whose torques are stored for each effect. Older readings count as this old.
const DEPTH: usize = 8;

/// What the guard has found, and how much it lowers the torque.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Shaking {
    /// Number of the tick in which the guard has found the sphere shaking the last time.
    pub tick: u64,
    /// Frequency at which the sphere shook, Hz.
    pub frequency: Real,
    /// Largest rate about the axis of frame N about which it shook most clearly, rad/s.
    pub amplitude: Real,
    /// Slot of the effect that gave the most energy (see
    /// [`Effect::slot`](crate::render::effects::Effect::slot)). `None` if no effect made a torque.
    pub slot: Option<u8>,
    /// Fraction of the torque that the guard leaves, 0 to 1.
    pub gain: Real,
}

/// The guard of one rig.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Guard {
    on: bool,
    /// One bit per axis of frame N. It is set if the rate was above [`LEAST_RATE`] since it was
    /// last below minus this rate.
    positive: u8,
    axes: [Axis; 3],
    suspect: Option<Suspect>,
    lowered: Option<Lowered>,
}

/// The energy that the effects had stored at each of the last crossings. It is apart from
/// [`Guard`], so that recordings of before can be read.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Stored {
    /// False in recordings of before, whose guard did not look at stored energy.
    counts: bool,
    /// The energy at the same places as [`Axis::crossings`], J.
    at: [[Real; CYCLES + 1]; 3],
    /// Energy that each effect has given out about the suspect's axis while it gave, J. What it has
    /// taken in between is not subtracted. So the sum does not depend on the phase of the swing.
    gave: [Real; MAX_EFFECTS],
}

impl Stored {
    pub(crate) const OFF: Self = Self { counts: false, at: [[0.0; CYCLES + 1]; 3], gave: [0.0; MAX_EFFECTS] };

    pub(crate) fn switch(&mut self, on: bool) {
        *self = Self { counts: on, ..Self::OFF };
    }

    /// Returns true unless the guard is that of older recordings.
    pub(crate) fn counts(&self) -> bool {
        self.counts
    }
}

/// The last crossings of the rate about an axis, the newest last.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Axis {
    crossings: [Crossing; CYCLES + 1],
    len: u8,
}

#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Crossing {
    tick: u64,
    /// Energy given to the hand until then, J.
    energy: Real,
}

/// What is recorded after the first cycle: who gives the energy.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Suspect {
    /// The axis of frame N that has made a cycle: 0, 1 or 2.
    axis: u8,
    /// Tick of the newest crossing about any axis.
    seen: u64,
    /// Largest rate about any axis, rad/s.
    peak: Real,
    /// Torques of the effects about the axis in the last ticks, N m, at the index tick % DEPTH.
    torques: [[Real; MAX_EFFECTS]; DEPTH],
    /// Energy that each effect has given out about the axis, J.
    given: [Real; MAX_EFFECTS],
}

/// The state of the torque while it is lowered.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Lowered {
    shaking: Shaking,
    /// Fraction of the torque towards which the gain falls.
    target: Real,
    /// Fraction that the gain does not exceed.
    ceiling: Real,
    /// Tick of the last cycle.
    last: u64,
}

/// Data of a tick that the guard needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) tick: u64,
    /// Angular velocity of the sphere in frame N, rad/s.
    pub(crate) omega: Vec3,
    /// Energy given to the hand since the start, J.
    pub(crate) energy: Real,
    /// Period of the loop, s.
    pub(crate) period: Real,
    /// Inertia of the sphere, kg m².
    pub(crate) inertia: Real,
}

impl Guard {
    pub(crate) const OFF: Self = {
        let none = Axis { crossings: [Crossing { tick: 0, energy: 0.0 }; CYCLES + 1], len: 0 };
        Self { on: false, positive: 0, axes: [none; 3], suspect: None, lowered: None }
    };

    pub(crate) fn switch(&mut self, on: bool) {
        *self = Self { on, ..Self::OFF };
    }

    /// Forgets everything. Called when the rig is enabled.
    pub(crate) fn restart(&mut self) {
        self.switch(self.on);
    }

    /// Lets the torque come back to its full value, because the scene has changed.
    pub(crate) fn allow(&mut self) {
        if let Some(lowered) = &mut self.lowered {
            lowered.ceiling = 1.0;
        }
    }

    /// Returns true if the guard has something to do in this tick. `omega` is the sphere's angular
    /// velocity, rad/s. Most ticks need no more than this.
    #[inline(always)]
    pub(crate) fn is_needed(&mut self, omega: Vec3) -> bool {
        self.on && (self.suspect.is_some() || self.lowered.is_some() || self.reversed(omega) != 0)
    }

    /// Returns true if the guard needs the torque of each effect in this tick.
    #[inline(always)]
    pub(crate) fn suspects(&self) -> bool {
        self.suspect.is_some()
    }

    /// Returns the fraction of the torque that the guard leaves, 0 to 1.
    #[inline(always)]
    pub(crate) fn gain(&self) -> Real {
        self.lowered.as_ref().map_or(1.0, |lowered| lowered.shaking.gain)
    }

    /// Returns what the guard has found, while it lowers the torque.
    #[inline(always)]
    pub(crate) fn found(&self) -> Option<Shaking> {
        self.lowered.as_ref().map(|lowered| lowered.shaking)
    }

    /// Returns one bit for each axis whose rate has gone beyond [`LEAST_RATE`] in the other
    /// direction.
    #[inline(always)]
    fn reversed(&self, omega: Vec3) -> u8 {
        let bit = |is: bool, axis: u8| u8::from(is) << axis;
        let above = |v: Vec3| bit(v.x > LEAST_RATE, 0) | bit(v.y > LEAST_RATE, 1) | bit(v.z > LEAST_RATE, 2);
        (above(omega) & !self.positive) | (above(-omega) & self.positive)
    }

    /// Stores the torque of the effect in `slot`, N m, that is commanded in tick `tick`.
    #[inline]
    pub(crate) fn record(&mut self, tick: u64, slot: u8, torque: Vec3) {
        if let Some(suspect) = &mut self.suspect
            && let Some(place) = suspect.torques[tick as usize % DEPTH].get_mut(usize::from(slot))
        {
            *place = torque[usize::from(suspect.axis)];
        }
    }

    /// Adds the energy that each effect has given out while the sphere made `turn` (rotation
    /// vector, rad), between the readings that answer the commands `from` and `to`.
    #[inline(never)]
    pub(crate) fn attribute(&mut self, stored: &mut Stored, from: u32, to: u32, turn: Vec3) {
        let Some(suspect) = &mut self.suspect else { return };
        let steps = (to.wrapping_sub(from) as usize).clamp(1, DEPTH);
        let turn = turn[usize::from(suspect.axis)] / steps as Real;
        for k in 0..steps {
            let torques = &suspect.torques[from.wrapping_add(k as u32) as usize % DEPTH];
            for (slot, torque) in torques.iter().enumerate() {
                suspect.given[slot] += torque * turn;
                if stored.counts {
                    stored.gave[slot] += (torque * turn).max(0.0);
                }
            }
        }
    }

    /// Looks at a tick for which [`is_needed`](Self::is_needed) is true: counts cycles, and lowers
    /// or raises the torque. `reason` is true if a client moves the sphere. `on_purpose` has one
    /// bit per slot, which is set for effects that give out energy on purpose. `energy` returns the
    /// energy that the effects store now, J, as far as limits let them act.
    #[inline(never)]
    pub(crate) fn look(
        &mut self,
        now: &Moment,
        stored: &mut Stored,
        (reason, on_purpose): (bool, u32),
        dt: Real,
        energy: impl Fn() -> Real,
    ) {
        let reversed = self.reversed(now.omega);
        let rising = reversed & !self.positive;
        self.positive ^= reversed;
        let longest = if self.lowered.is_some() { LONGEST_LOWERED_S } else { LONGEST_CYCLE_S } / now.period;
        if reason {
            self.forget();
        }
        if rising != 0 && !reason {
            let energy = if stored.counts { energy() } else { 0.0 };
            for axis in (0..3).filter(|axis| rising & (1 << axis) != 0) {
                self.cross(axis, now, (stored, energy), longest as u64, on_purpose);
            }
        }
        if let Some(suspect) = &mut self.suspect {
            suspect.peak = suspect.peak.max(now.omega.abs().max_element());
            if now.tick.saturating_sub(suspect.seen) > longest as u64 {
                self.suspect = None;
            }
        }
        if let Some(lowered) = &mut self.lowered
            && lowered.advance(now, dt)
        {
            self.lowered = None;
        }
    }

    fn forget(&mut self) {
        self.suspect = None;
        self.axes = Self::OFF.axes;
    }

    /// Takes a crossing of the rate about `axis`, at which the effects store the energy `energy`,
    /// J.
    fn cross(
        &mut self,
        axis: u8,
        now: &Moment,
        (stored, energy): (&mut Stored, Real),
        longest: u64,
        on_purpose: u32,
    ) {
        let gain = self.gain();
        let own = &mut self.axes[usize::from(axis)];
        let was_full = usize::from(own.len) > CYCLES;
        let cycles = own.add(Crossing { tick: now.tick, energy: now.energy }, longest);
        let kept = &mut stored.at[usize::from(axis)];
        if was_full && cycles == CYCLES {
            kept.rotate_left(1);
        }
        kept[cycles] = energy;
        if cycles == 0 {
            return;
        }
        // The energy that the motors have given out since an earlier crossing.
        let given_since = |k: usize| {
            let given = own.crossings[cycles].energy - own.crossings[k].energy;
            given.min(given + gain * (kept[cycles] - kept[k]))
        };
        let (in_last, in_all) = (given_since(cycles - 1), given_since(0));
        let Some(suspect) = &mut self.suspect else {
            self.suspect = Some(Suspect {
                axis,
                seen: now.tick,
                peak: 0.0,
                torques: [[0.0; MAX_EFFECTS]; DEPTH],
                given: [0.0; MAX_EFFECTS],
            });
            stored.gave = [0.0; MAX_EFFECTS];
            return;
        };
        suspect.seen = now.tick;
        let kinetic = 0.5 * now.inertia * suspect.peak * suspect.peak;
        if let Some(lowered) = &mut self.lowered
            && lowered.is_falling(now)
            && in_last >= LEAST_ENERGY / CYCLES as Real * kinetic
        {
            lowered.last = now.tick;
            if lowered.shaking.gain <= lowered.target {
                lowered.target *= 0.5;
            }
        }
        let (first, peak) = (own.crossings[0], suspect.peak);
        if cycles < CYCLES || in_all < LEAST_ENERGY * kinetic {
            return;
        }
        let (mut slot, purposeful) = worst(&suspect.given, on_purpose);
        if stored.counts {
            slot = worst(&stored.gave, on_purpose).0;
        }
        let frequency = CYCLES as Real / ((now.tick - first.tick) as Real * now.period);
        self.forget();
        if purposeful {
            return;
        }
        let shaking = Shaking { tick: now.tick, frequency, amplitude: peak, slot, gain: self.gain() };
        self.lowered = Some(match self.lowered {
            None => Lowered { shaking, target: 0.5, ceiling: 1.0, last: now.tick },
            Some(before) => before.again(shaking),
        });
    }
}

impl Axis {
    /// Adds a crossing. Returns the number of cycles in a row, at most [`CYCLES`].
    fn add(&mut self, crossing: Crossing, longest: u64) -> usize {
        let len = usize::from(self.len);
        if len > 0 && crossing.tick.saturating_sub(self.crossings[len - 1].tick) > longest {
            self.len = 0;
        } else if len > CYCLES {
            self.crossings.rotate_left(1);
            self.len = CYCLES as u8;
        }
        self.crossings[usize::from(self.len)] = crossing;
        self.len += 1;
        usize::from(self.len) - 1
    }
}

/// Returns the effect that has given out the most energy, and whether an effect that does so on
/// purpose has given at least half as much.
fn worst(given: &[Real; MAX_EFFECTS], on_purpose: u32) -> (Option<u8>, bool) {
    let (mut worst, mut most, mut purpose) = (None, Real::NEG_INFINITY, 0.0);
    for (slot, given) in given.iter().enumerate() {
        if on_purpose & (1 << slot) != 0 {
            purpose += given;
        } else if *given != 0.0 && *given > most {
            (worst, most) = (Some(slot as u8), *given);
        }
    }
    (worst, purpose > 0.5 * most.max(0.0))
}

impl Lowered {
    /// Returns true until the sphere has been calm for [`CALM_S`].
    fn is_falling(&self, now: &Moment) -> bool {
        (now.tick.saturating_sub(self.last) as Real) * now.period < CALM_S
    }

    /// Takes a further finding.
    fn again(self, shaking: Shaking) -> Self {
        let gain = shaking.gain;
        Self { shaking, target: 0.5 * gain, ceiling: self.ceiling.min(BELOW * gain), last: shaking.tick }
    }

    /// Advances the gain by `dt` seconds. Returns true if the torque has its full value again.
    fn advance(&mut self, now: &Moment, dt: Real) -> bool {
        let falls = self.is_falling(now);
        let gain = &mut self.shaking.gain;
        if falls {
            *gain = (*gain - dt / FALL_S).max(self.target.min(*gain));
            return false;
        }
        self.target = 1.0;
        *gain = (*gain + dt / RISE_S).min(self.ceiling.max(*gain));
        *gain >= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guard_is_small_and_off_at_first() {
        assert!(size_of::<Guard>() < 4096, "{}", size_of::<Guard>());
        let mut guard = Guard::OFF;
        assert!(!guard.is_needed(Vec3::X * 100.0) && !guard.suspects() && guard.found().is_none());
        assert_eq!(guard.gain(), 1.0);
    }
}
