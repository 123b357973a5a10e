//! Which ticks of a recording are there, and which are missing between them.

use std::fmt;

use crate::messages::hbot::State;

/// States that are missing between two others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// How many are missing.
    pub states: u64,
    /// Number of ticks from one state to the next: 1, unless the recording has only some of them.
    pub step: u64,
    /// Times of the first and the last of them, s of the run.
    pub range: (f64, f64),
    /// Whether a part of the file is damaged there. Otherwise the recorder has lost these ticks, or
    /// the loop has skipped them.
    pub damaged: bool,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { states, step, range: (from, to), .. } = *self;
        let are = if states == 1 { " is" } else { "s are" };
        write!(f, "{states} {}{are} missing ({from:.3} to {to:.3} s)", name(step))?;
        if self.damaged { Ok(()) } else { f.write_str(", not recorded or skipped by the loop") }
    }
}

/// Returns what to call a state: a tick, unless there is none for most ticks.
fn name(step: u64) -> &'static str {
    if step > 1 { "state" } else { "tick" }
}

/// The ticks of a recording, from its states in the order of the file. A gap that the lateness of
/// the loop explains is none: the loop has skipped these ticks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ticks {
    /// Number of states.
    pub states: u64,
    /// Times of the first and the last state, s of the run.
    pub range: Option<(f64, f64)>,
    /// The gaps, in the order of the file.
    pub gaps: Vec<Gap>,
    /// Whether a part before the first state is damaged.
    pub damaged_before: bool,
    /// Whether a part after the last state is damaged.
    pub damaged_after: bool,
    /// Number and time of the last state, and how long its tick took from its deadline, us.
    last: Option<(u64, f64, f64)>,
    /// Least number of ticks from one state to the next.
    step: u64,
}

impl Ticks {
    /// Notes that a part is damaged here.
    pub fn damaged(&mut self) {
        self.damaged_after = true;
    }

    /// Takes the next state.
    pub fn state(&mut self, state: &State) {
        self.states += 1;
        self.range = Some((self.range.map_or(state.t, |(first, _)| first), state.t));
        let damaged = std::mem::take(&mut self.damaged_after);
        let took_us = state.timing.map_or(0.0, |time| time.lateness_us + time.compute_us + time.link_us);
        let Some((tick, t, took_us)) = self.last.replace((state.tick, state.t, took_us)) else {
            self.damaged_before = damaged;
            return;
        };
        let step = state.tick.saturating_sub(tick);
        if step == 0 {
            return;
        }
        self.step = if self.step == 0 { step } else { self.step.min(step) };
        let (states, period) = (step / self.step - 1, (state.t - t) / step as f64);
        // The loop skips what passes until a tick ends.
        let skipped = !damaged && 1.0e-6 * took_us > (step as f64 - 1.5) * period;
        if states > 0 && !skipped {
            let each = self.step as f64 * period;
            let range = (t + each, t + states as f64 * each);
            self.gaps.push(Gap { states, step: self.step, range, damaged });
        }
    }

    /// Returns what to call one of the states: a tick, unless there is none for most ticks.
    #[must_use]
    pub fn name(&self) -> &'static str {
        name(self.step)
    }

    /// Returns how many states are missing in all gaps.
    #[must_use]
    pub fn missing(&self) -> u64 {
        self.gaps.iter().map(|gap| gap.states).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::hbot::Timing;

    fn ticks(of: &[(u64, f64)], damaged_before: u64) -> Ticks {
        let mut ticks = Ticks::default();
        for (tick, lateness_us) in of.iter().copied() {
            if tick == damaged_before {
                ticks.damaged();
            }
            let timing = Some(Timing { lateness_us, ..Timing::default() });
            ticks.state(&State { tick, t: tick as f64 * 1.0e-3, timing, ..State::default() });
        }
        ticks
    }

    #[test]
    fn a_gap_is_what_is_neither_there_nor_skipped_by_a_late_loop() {
        let said = |of: &[(u64, f64)], damaged| -> Vec<String> {
            ticks(of, damaged).gaps.iter().map(ToString::to_string).collect()
        };
        let unknown = "3 ticks are missing (0.002 to 0.004 s), not recorded or skipped by the loop";
        assert_eq!(said(&[(0, 0.0), (1, 0.0), (5, 0.0)], 0), [unknown]);
        assert_eq!(said(&[(0, 0.0), (1, 0.0), (5, 0.0)], 5), ["3 ticks are missing (0.002 to 0.004 s)"]);
        assert_eq!(said(&[(0, 0.0), (1, 3100.0), (5, 0.0)], 0), [""; 0], "the loop was late");
        assert_eq!(said(&[(0, 0.0), (1, 3100.0), (5, 0.0)], 5).len(), 1, "and the file is damaged");
        let outside = |damaged| {
            let mut ticks = ticks(&[(0, 0.0), (1, 0.0)], damaged);
            if damaged == 2 {
                ticks.damaged();
            }
            (ticks.damaged_before, ticks.damaged_after, ticks.gaps.len())
        };
        assert_eq!([0, 1, 2].map(outside), [(true, false, 0), (false, false, 0), (false, true, 0)]);
        // A client records one of ten.
        let every: Vec<_> = [20, 30, 40, 70, 80].map(|tick| (tick, 0.0)).into();
        let gaps = ticks(&every, 70).gaps;
        assert!(gaps.len() == 1 && gaps[0].to_string().starts_with("2 states are missing (0.050 to 0.060"));
    }
}
