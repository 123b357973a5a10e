//! How late the last commands were sent. Rates that follow from angles need the time between two
//! readings, and a reading is as late as the command that it answers.

use crate::design::rig::Rig;
use crate::inputs::Inputs;
use crate::real::Real;

/// Number of ticks of which the lateness is known. A reading that answers an older command counts
/// as punctual.
const DEPTH: usize = 32;

/// Least time between two readings, ticks. After a late tick it can be so short that the rounding
/// to counts would decide.
const LEAST: Real = 0.25;

/// How late the last ticks began.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Lateness {
    on: bool,
    /// How late each of the last ticks began, in ticks. 0 for a tick that was skipped.
    late: [Real; DEPTH],
    newest: u32,
}

impl Lateness {
    pub(crate) const OFF: Self = Self { on: false, late: [0.0; DEPTH], newest: 0 };

    pub(crate) fn switch(&mut self, on: bool) {
        *self = Self { on, ..Self::OFF };
    }

    /// Takes how late a tick begins.
    #[inline]
    pub(crate) fn begin(&mut self, inputs: &Inputs, rig: &Rig) {
        if !self.on {
            return;
        }
        let tick = inputs.tick as u32;
        let ahead = (tick.wrapping_sub(self.newest) as i32).clamp(1, DEPTH as i32) as u32;
        for skipped in 1..ahead {
            self.late[tick.wrapping_sub(skipped) as usize % DEPTH] = 0.0;
        }
        self.late[tick as usize % DEPTH] = inputs.lateness_ns as Real / rig.timing.period_ns as Real;
        self.newest = tick;
    }

    /// Returns the time between the readings that answer the commands of two ticks, in ticks.
    #[inline]
    pub(crate) fn between(&self, from: u32, to: u32) -> Real {
        let ticks = to.wrapping_sub(from).max(1) as Real;
        if !self.on {
            return ticks;
        }
        (ticks + self.of(to) - self.of(from)).max(LEAST)
    }

    fn of(&self, tick: u32) -> Real {
        let known = self.newest.wrapping_sub(tick) < DEPTH as u32;
        if known { self.late[tick as usize % DEPTH] } else { 0.0 }
    }
}
