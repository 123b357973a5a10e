//! The passivity observer: energy given out to the hand (Hannaford and Ryu 2002; physics notes, section 9).
//!
//! E grows by T . delta, where delta is the turn made while T was truly held. Feedback says which command it answers, so
//! the torque of that command, not the newest one, is paired with the turn.

use crate::real::{Real, Vec3};

/// Torques remembered; more ticks than this without feedback have long been a lost link.
const DEPTH: usize = 64;

/// Energy given out since the start, J, and the torques not yet paired with a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Observer {
    energy: Real,
    torques: [Vec3; DEPTH],
    /// The last command.
    newest: u32,
}

impl Observer {
    pub(crate) const START: Self = Self { energy: 0.0, torques: [Vec3::ZERO; DEPTH], newest: 0 };

    /// The torque that command `sequence` asks for. In ticks that were skipped since the last one, its torque was held on.
    #[inline]
    pub(crate) fn sent(&mut self, sequence: u32, torque: Vec3) {
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

    /// The sphere made `turn` (rad, N) between the readings that answer commands `from` and `to`.
    #[inline]
    pub(crate) fn turned(&mut self, from: u32, to: u32, turn: Vec3) {
        let steps = (to.wrapping_sub(from) as usize).clamp(1, DEPTH);
        let mut sum = Vec3::ZERO;
        for k in 0..steps {
            sum += self.torques[from.wrapping_add(k as u32) as usize % DEPTH];
        }
        self.energy += sum.dot(turn) / steps as Real;
    }

    /// Energy given out, J; negative where more came in.
    #[inline]
    pub(crate) fn energy(&self) -> Real {
        self.energy
    }
}
