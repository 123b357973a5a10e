//! The passivity observer and the passivity controller (Hannaford and Ryu 2002; physics notes,
//! section 9). The observer computes the energy given to the hand. The controller adds damping if
//! more energy would be given out than came in.
//!
//! The energy E grows by T . delta, where delta is the turn made while the torque T was really
//! held. A reading says which command it answers. So the turn is multiplied with the torque of that
//! command, not with the newest torque.

use crate::design::rig::PassivityLimit;
use crate::real::{Real, Vec3};

/// Number of past torques that are stored, one per tick. It is above the largest `timeout_ticks`
/// that a rig can have. So the torque is known for every turn of the sphere, unless the link is
/// lost.
const DEPTH: usize = 1024;

/// Computes the energy that the rig has given to the hand since the start, J. It stores the torques
/// of the last commands, until readings show how far the sphere turned under them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Observer {
    energy: Real,
    #[cfg_attr(feature = "exact", serde(with = "serde_big_array::BigArray"))]
    torques: [Vec3; DEPTH],
    /// Number of the last command whose torque was recorded.
    newest: u32,
}

impl Observer {
    pub(crate) const START: Self = Self { energy: 0.0, torques: [Vec3::ZERO; DEPTH], newest: 0 };

    /// Records the torque of the command with the number `sequence`, N m. If ticks were skipped
    /// since the last command, its torque was held in these ticks.
    #[inline]
    pub(crate) fn record(&mut self, sequence: u32, torque: Vec3) {
        let ahead = sequence.wrapping_sub(self.newest) as i32;
        if ahead > 1 {
            let held = self.torques[self.newest as usize % DEPTH];
            for k in 1..(ahead as u32).min(DEPTH as u32) {
                self.torques[self.newest.wrapping_add(k) as usize % DEPTH] = held;
            }
        }
        self.newest = sequence;
        self.torques[sequence as usize % DEPTH] = torque;
    }

    /// Adds the energy that was given to the hand while the sphere made `turn` (rotation vector in
    /// frame N, rad). The turn was made between the readings that answer the commands `from` and
    /// `to`. Returns this energy, J.
    #[inline]
    pub(crate) fn advance(&mut self, from: u32, to: u32, turn: Vec3) -> Real {
        let steps = (to.wrapping_sub(from) as usize).clamp(1, DEPTH);
        let mut sum = Vec3::ZERO;
        for k in 0..steps {
            sum += self.torques[from.wrapping_add(k as u32) as usize % DEPTH];
        }
        let given = sum.dot(turn) / steps as Real;
        self.energy += given;
        given
    }

    /// Returns the sum of the torques of the commands from number `answered` to the one before
    /// `tick`, N m. No reading shows yet how much energy these torques give to the hand.
    #[inline]
    fn on_their_way(&self, answered: u32, tick: u32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let ahead = tick.wrapping_sub(answered) as i32;
        for k in 0..ahead.clamp(0, DEPTH as i32) as u32 {
            let command = answered.wrapping_add(k);
            // In a skipped tick the last torque was held.
            let sent = if self.newest.wrapping_sub(command) as i32 >= 0 { command } else { self.newest };
            sum += self.torques[sent as usize % DEPTH];
        }
        sum
    }

    /// Returns the energy that the rig has given to the hand since the start, J. Negative if more
    /// was absorbed.
    #[inline]
    pub(crate) fn energy(&self) -> Real {
        self.energy
    }
}

/// The passivity controller. It adds damping if the rig would otherwise give more energy to the
/// hand than it has absorbed from it plus an allowance.
///
/// The newest commands are not answered by a reading yet, and their torques can no longer be
/// changed. So the controller predicts, from the last measured rate, how much energy these torques
/// will give out. It then chooses the damping so that the energy stays within the allowance until
/// the end of the present tick.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Guard {
    limit: PassivityLimit,
    /// Energy given to the hand since the motors were enabled, J. Negative if more was absorbed,
    /// but never below `-limit.store`.
    energy: Real,
    /// Damping that was added in the last tick, N m s/rad.
    damping: Real,
}

impl Guard {
    pub(crate) fn new(limit: PassivityLimit) -> Self {
        Self { limit, energy: 0.0, damping: 0.0 }
    }

    /// Resets the energy to zero. Called when the motors have just been enabled.
    pub(crate) fn restart(&mut self) {
        self.energy = 0.0;
    }

    /// Adds `energy` to the energy given to the hand, J. Negative if it was absorbed.
    #[inline]
    pub(crate) fn add(&mut self, energy: Real) {
        self.energy = (self.energy + energy).max(-self.limit.store);
    }

    /// Computes the damping for this tick, so that the torque `wanted` (N m) does not give out too
    /// much energy. `omega` is the sphere's angular velocity in the last reading, rad/s. Returns
    /// `wanted` plus the damping torque, N m.
    #[inline]
    pub(crate) fn damp(
        &mut self,
        observer: &Observer,
        ledger: Option<&Ledger>,
        now: Moment,
        wanted: Vec3,
        omega: Vec3,
    ) -> Vec3 {
        let held = observer.on_their_way(now.answered, now.tick) + wanted;
        let given = held.dot(omega) * now.period;
        let counted = match ledger {
            Some(ledger) => ledger.predicted(now.answered, now.tick, omega * now.period, given),
            None => given,
        };
        let excess = self.energy + counted - self.limit.allowance;
        let square = omega.length_squared() * now.period;
        // At rest no energy is given out and none can be absorbed.
        self.damping = if excess > 0.0 && square > 0.0 {
            (excess / square).min(self.limit.damping) * now.gain
        } else {
            0.0
        };
        wanted - omega * self.damping
    }

    /// Sets the damping of this tick to zero. Called if the motors make no torque.
    pub(crate) fn rest(&mut self) {
        self.damping = 0.0;
    }

    /// Returns the damping that was added in the last tick, N m s/rad.
    pub(crate) fn damping(&self) -> Real {
        self.damping
    }
}

/// Finds the part of the energy given to the hand that delay and sampling have created.
///
/// A law without delay would make the torque P at the measured orientation, and its damping. The
/// held torque differs, because it answers an older reading. So the energy that delay creates is
/// the work of the held torque on a turn, minus the work of P on the same turn. P at both ends of
/// the turn is known as soon as both are measured. The damping has no part in P: what it absorbs
/// pays for what the delay creates. Torque of effects that are not elastic, of streams and of
/// blends moves the sphere on purpose. It does not count.
///
/// For a spring of the stiffness K and the damping b this is (K tau - b) w² per second, with the
/// delay tau and the rate w. A lead takes tau away; P stays that of the measured orientation.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Ledger {
    /// Parts of the last commands' torques, at the index of the command's number modulo the length.
    #[cfg_attr(feature = "exact", serde(with = "serde_big_array::BigArray"))]
    sent: [Parts; SENT],
    /// Number of the last command that was recorded.
    newest: u32,
    /// Parts of the torque of this tick. They are recorded when it is sent.
    pending: Parts,
    /// The whole torque that is wanted in this tick, N m.
    wanted: Vec3,
    /// Torque P at the last two rendered orientations, N m, the newer one first.
    law: [Vec3; 2],
    /// Turn of the sphere since the last rendered orientation, rad.
    turn: Vec3,
    /// Energy that was given during this turn by torque that counts, J.
    given: Real,
    /// Energy that the passivity controller's damping has absorbed during this turn, J.
    absorbed: Real,
    /// Fraction of the last wanted torque that motors and contacts could make.
    kept: Real,
}

/// Parts of the torque of one command, or the sums over several commands, in frame N, N m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Parts {
    /// Torque that moves the sphere on purpose.
    driving: Vec3,
    /// Torque that the passivity controller has added.
    damping: Vec3,
}

impl Parts {
    const NOTHING: Self = Self { driving: Vec3::ZERO, damping: Vec3::ZERO };
}

/// Number of commands whose torque is known. Energy given by older commands counts in full.
const SENT: usize = 64;

/// Part by which the energy that delay creates counts more than it is. So a swing on a spring that
/// is too stiff dies out even if neither hand nor device damp it.
const MARGIN: Real = 0.25;

impl Ledger {
    pub(crate) const START: Self = Self {
        sent: [Parts::NOTHING; SENT],
        newest: 0,
        pending: Parts::NOTHING,
        wanted: Vec3::ZERO,
        law: [Vec3::ZERO; 2],
        turn: Vec3::ZERO,
        given: 0.0,
        absorbed: 0.0,
        kept: 1.0,
    };

    /// Adds the energy `given` (J) that the commands from number `from` to the one before `to` gave
    /// while the sphere made `turn`, rad.
    #[inline]
    pub(crate) fn turned(&mut self, from: u32, to: u32, turn: Vec3, given: Real) {
        let steps = to.wrapping_sub(from).clamp(1, SENT as u32);
        let sum = self.sum(from, steps);
        let each = turn / steps as Real;
        let absorbed = -sum.damping.dot(each);
        self.turn += turn;
        self.given += given - sum.driving.dot(each) + absorbed;
        self.absorbed += absorbed;
    }

    /// Takes the torque P at the present orientation, and the torque that does not count of the
    /// command that is being computed, N m. Returns the energy that delay has created since the
    /// last torque was computed, less the energy that the scene has absorbed, J.
    #[inline]
    pub(crate) fn render(&mut self, law: Vec3, driving: Vec3) -> Real {
        self.pending = Parts { driving, damping: Vec3::ZERO };
        self.law = [law * self.kept, self.law[0]];
        let lawful = 0.5 * (self.law[0] + self.law[1]).dot(core::mem::take(&mut self.turn));
        counted(core::mem::take(&mut self.given) - lawful) - core::mem::take(&mut self.absorbed)
    }

    /// Forgets the turns that were not rendered. Called if the motors make no torque.
    pub(crate) fn rest(&mut self) {
        *self = Self { sent: self.sent, newest: self.newest, ..Self::START };
    }

    /// Takes the whole torque that is wanted in this tick, and the part of it that the passivity
    /// controller has added, both in N m.
    #[inline]
    pub(crate) fn want(&mut self, wanted: Vec3, damping: Vec3) {
        self.wanted = wanted;
        self.pending.damping = damping;
    }

    /// Records the torque `made` (N m) as that of the command `sequence`. `kept` is the fraction of
    /// the wanted torque that motors and contacts could make.
    ///
    /// The rest of the difference between `made` and the wanted torque comes from the slew limit,
    /// which delays all torque. The driving part has its share of it, which does not count.
    #[inline]
    pub(crate) fn record(&mut self, sequence: u32, made: Vec3, kept: Real) {
        let ahead = sequence.wrapping_sub(self.newest) as i32;
        if ahead > 1 {
            let held = self.sent[self.newest as usize % SENT];
            for k in 1..(ahead as u32).min(SENT as u32) {
                self.sent[self.newest.wrapping_add(k) as usize % SENT] = held;
            }
        }
        self.newest = sequence;
        self.kept = kept;
        if made == Vec3::ZERO {
            self.sent[sequence as usize % SENT] = Parts::NOTHING;
            return;
        }
        let Parts { driving, damping } = self.pending;
        let own = driving.length_squared();
        let rest = (self.wanted - driving).length_squared();
        let share = if own > 0.0 { own / (own + rest) } else { 0.0 };
        let driving = driving * kept + (made - self.wanted * kept) * share;
        self.sent[sequence as usize % SENT] = Parts { driving, damping: damping * kept };
    }

    /// Adds `torque` (N m) to the torque of the last recorded command `sequence`. It moves the
    /// sphere on purpose.
    #[inline]
    pub(crate) fn drive(&mut self, sequence: u32, torque: Vec3) {
        self.sent[sequence as usize % SENT].driving += torque;
    }

    /// Returns the energy that will count at the end of tick `tick`, J. `given` is the energy that
    /// the torques under way will give until then. `step` is the turn of the sphere in a tick, rad.
    /// P is assumed to change as it has changed in the last tick.
    #[inline]
    fn predicted(&self, answered: u32, tick: u32, step: Vec3, given: Real) -> Real {
        let ticks = (tick.wrapping_sub(answered) as i32).max(0) as u32;
        let sum = self.sum(answered, ticks);
        let driving = sum.driving + self.pending.driving;
        let absorbed = -sum.damping.dot(step);
        let [now, before] = self.law;
        let count = (ticks + 1) as Real;
        let lawful = (now + (now - before) * (0.5 * count)).dot(step) * count;
        counted(given + absorbed - driving.dot(step) - lawful) - absorbed
    }

    /// Returns the sums over the `steps` commands from number `from` on.
    #[inline]
    fn sum(&self, from: u32, steps: u32) -> Parts {
        let mut sum = Parts::NOTHING;
        for k in 0..steps.min(SENT as u32) {
            let command = from.wrapping_add(k);
            // In a skipped tick the last torque was held.
            let sent = if self.newest.wrapping_sub(command) as i32 >= 0 { command } else { self.newest };
            if self.newest.wrapping_sub(sent) < SENT as u32 {
                let part = &self.sent[sent as usize % SENT];
                sum.driving += part.driving;
                sum.damping += part.damping;
            }
        }
        sum
    }
}

/// Returns how much `energy`, J, counts. It is positive if the delay creates more than the scene
/// absorbs.
#[inline]
fn counted(energy: Real) -> Real {
    energy + MARGIN * energy.max(0.0)
}

/// Data about the present tick that the passivity controller needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) tick: u32,
    /// Number of the last command that a reading has answered: the low 32 bits of the number of the
    /// tick that sent it.
    pub(crate) answered: u32,
    /// Time for which the motors hold the torque of one command, s.
    pub(crate) period: Real,
    /// Factor of the soft start or of the disable ramp, 0 to 1. The damping is multiplied by it,
    /// like all other torque.
    pub(crate) gain: Real,
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOMENT: Moment = Moment { tick: 11, answered: 10, period: 0.25, gain: 1.0 };
    const LIMIT: PassivityLimit = PassivityLimit { allowance: 1.0, store: 4.0, damping: 2.0, strict: true };

    fn pushing() -> (Observer, Guard) {
        let mut observer = Observer::START;
        observer.record(10, Vec3::X * 2.0);
        (observer, Guard::new(LIMIT))
    }

    #[test]
    fn the_predicted_energy_ends_at_the_allowance() {
        let (observer, mut guard) = pushing();
        guard.add(0.5);
        // 0.5 J given out, 2 N m held but not answered, and 1 N m wanted, at 1 rad/s for 1/4 s
        // each: 1.25 J. The allowance is 1 J, so the damping takes 0.25 J.
        let torque = guard.damp(&observer, None, MOMENT, Vec3::X, Vec3::X);
        assert_eq!((torque, guard.damping()), (Vec3::ZERO, 1.0));
        // A turn in the opposite direction absorbs energy by itself.
        assert_eq!(guard.damp(&observer, None, MOMENT, Vec3::X, -Vec3::X), Vec3::X);
        assert_eq!(guard.damping(), 0.0);
    }

    #[test]
    fn damping_is_bounded_and_fades_with_the_motors_and_a_sphere_at_rest_has_none() {
        let (observer, mut guard) = pushing();
        guard.add(50.0);
        for (gain, damping) in [(1.0, 2.0), (0.5, 1.0), (0.0, 0.0)] {
            let omega = Vec3::new(0.0, 1e-3, 0.0);
            let torque = guard.damp(&observer, None, Moment { gain, ..MOMENT }, Vec3::Z, omega);
            assert_eq!((torque, guard.damping()), (Vec3::Z - omega * damping, damping));
        }
        assert_eq!(guard.damp(&observer, None, MOMENT, Vec3::Z, Vec3::ZERO), Vec3::Z);
        assert_eq!(guard.damping(), 0.0);
    }

    #[test]
    fn what_was_dissipated_long_ago_buys_no_more_than_the_store() {
        let (_, mut guard) = pushing();
        guard.add(-1000.0);
        guard.add(4.0);
        assert_eq!(guard.energy, 0.0);
        guard.add(3.0);
        guard.restart();
        assert_eq!(guard.energy, 0.0);
    }

    #[test]
    fn torques_under_way_are_those_of_commands_not_answered() {
        let mut observer = Observer::START;
        for (tick, torque) in [(1, 1.0), (2, 10.0), (3, 100.0)] {
            observer.record(tick, Vec3::X * torque);
        }
        assert_eq!(observer.on_their_way(3, 4).x, 100.0);
        assert_eq!(observer.on_their_way(1, 4).x, 111.0);
        assert_eq!(observer.on_their_way(3, 6).x, 300.0, "two ticks skipped");
        assert_eq!(observer.on_their_way(4, 4).x, 0.0, "the reading answers this very tick");
        assert_eq!(observer.on_their_way(5, 4).x, 0.0);
        // However long no reading came, only the remembered torques count.
        assert_eq!(observer.on_their_way(3, 3 + 1_000_000).x, 102_400.0);
    }
}
