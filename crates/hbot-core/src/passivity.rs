//! The passivity observer and the passivity controller (Hannaford and Ryu 2002; physics notes,
//! section 9). The observer computes the energy given to the hand. The controller adds damping if
//! more energy would be given out than came in.
//!
//! The energy E grows by T . delta, where delta is the turn made while the torque T was really
//! held. A reading says which command it answers. So the turn is multiplied with the torque of that
//! command, not with the newest torque.

use crate::real::{Real, Vec3};
use crate::rig::PassivityLimit;

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
    pub(crate) fn damp(&mut self, observer: &Observer, now: Moment, wanted: Vec3, omega: Vec3) -> Vec3 {
        let held = observer.on_their_way(now.answered, now.tick) + wanted;
        let excess = self.energy + held.dot(omega) * now.period - self.limit.allowance;
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
    const LIMIT: PassivityLimit = PassivityLimit { allowance: 1.0, store: 4.0, damping: 2.0 };

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
        let torque = guard.damp(&observer, MOMENT, Vec3::X, Vec3::X);
        assert_eq!((torque, guard.damping()), (Vec3::ZERO, 1.0));
        // A turn in the opposite direction absorbs energy by itself.
        assert_eq!(guard.damp(&observer, MOMENT, Vec3::X, -Vec3::X), Vec3::X);
        assert_eq!(guard.damping(), 0.0);
    }

    #[test]
    fn damping_is_bounded_and_fades_with_the_motors_and_a_sphere_at_rest_has_none() {
        let (observer, mut guard) = pushing();
        guard.add(50.0);
        for (gain, damping) in [(1.0, 2.0), (0.5, 1.0), (0.0, 0.0)] {
            let omega = Vec3::new(0.0, 1e-3, 0.0);
            let torque = guard.damp(&observer, Moment { gain, ..MOMENT }, Vec3::Z, omega);
            assert_eq!((torque, guard.damping()), (Vec3::Z - omega * damping, damping));
        }
        assert_eq!(guard.damp(&observer, MOMENT, Vec3::Z, Vec3::ZERO), Vec3::Z);
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
