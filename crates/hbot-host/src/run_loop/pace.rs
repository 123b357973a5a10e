//! Absolute deadlines that keep their phase.

/// The deadlines of a loop, at whole periods after a start time. Deadlines that have passed are
/// skipped, not caught up.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    start_ns: u64,
    period_ns: u64,
    next: u64,
    /// What happens to the ticks whose deadlines have passed.
    passed: Passed,
}

/// What happens to a tick whose deadline passed before the tick before it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passed {
    /// The tick is left out, and the next tick has a higher number. The time of the loop follows
    /// the clock.
    Skipped,
    /// The tick is done one or more periods later. The time of the loop waits, which is possible
    /// only if the rig is simulated.
    Postponed,
}

/// The number and lateness of a tick that begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beat {
    /// Number of the tick, from 0.
    pub tick: u64,
    /// Time from the tick's deadline to its start, ns.
    pub lateness_ns: u64,
    /// True if the tick began more than a quarter period after its deadline.
    pub late: bool,
}

impl Pace {
    /// Creates the deadlines of a loop: that of tick 0 is `start_ns`, and one more follows every
    /// `period_ns`, which must not be zero. Ticks whose deadlines pass are skipped.
    #[must_use]
    pub fn new(start_ns: u64, period_ns: u64) -> Self {
        Self { start_ns, period_ns: period_ns.max(1), next: 0, passed: Passed::Skipped }
    }

    /// Sets what happens to the ticks whose deadlines pass.
    #[must_use]
    pub fn with(self, passed: Passed) -> Self {
        Self { passed, ..self }
    }

    /// Returns the deadline of the next tick, ns.
    #[must_use]
    pub fn deadline_ns(&self) -> u64 {
        self.start_ns + self.next * self.period_ns
    }

    /// Returns the number and the lateness of the tick that begins at `now_ns`. Its deadline must
    /// have passed.
    #[must_use]
    pub fn beat(&self, now_ns: u64) -> Beat {
        let lateness_ns = now_ns.saturating_sub(self.deadline_ns());
        Beat { tick: self.next, lateness_ns, late: lateness_ns > self.period_ns / 4 }
    }

    /// Ends a tick at `now_ns`. Returns how many deadlines have passed meanwhile. Their ticks are
    /// skipped or postponed.
    pub fn end(&mut self, now_ns: u64) -> u64 {
        self.next += 1;
        let behind = now_ns.saturating_sub(self.deadline_ns());
        // A deadline at exactly `now_ns` counts as met.
        let passed = behind.div_ceil(self.period_ns);
        match self.passed {
            Passed::Skipped => self.next += passed,
            Passed::Postponed => self.start_ns += passed * self.period_ns,
        }
        passed
    }

    /// Postpones the next tick to the first deadline after `now_ns`. Returns by how many periods.
    pub fn postpone(&mut self, now_ns: u64) -> u64 {
        let periods = 1 + now_ns.saturating_sub(self.deadline_ns()) / self.period_ns;
        self.start_ns += periods * self.period_ns;
        periods
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_tick_skips_deadlines_and_keeps_the_phase() {
        let mut pace = Pace::new(1_000, 100);
        assert_eq!(pace.deadline_ns(), 1_000);
        assert_eq!(pace.beat(1_020), Beat { tick: 0, lateness_ns: 20, late: false });
        assert_eq!(pace.end(1_050), 0);
        assert_eq!(pace.deadline_ns(), 1_100);
        assert!(!pace.beat(1_125).late, "a quarter of the period is in time");
        assert!(pace.beat(1_126).late);
        // The deadlines 1200 and 1300 pass while tick 1 runs.
        assert_eq!(pace.end(1_350), 2);
        assert_eq!(pace.deadline_ns(), 1_400);
        assert_eq!(pace.beat(1_400).tick, 4);
        assert_eq!(pace.end(1_500), 0, "a deadline that is just now is met");
    }

    #[test]
    fn a_postponed_tick_keeps_its_number_and_the_phase() {
        let mut pace = Pace::new(1_000, 100).with(Passed::Postponed);
        assert_eq!(pace.beat(1_000).tick, 0);
        // Tick 0 takes 250: the deadlines 1100 and 1200 pass, and tick 1 is due at 1300.
        assert_eq!(pace.end(1_250), 2);
        assert_eq!((pace.deadline_ns(), pace.beat(1_300).tick), (1_300, 1));
        assert_eq!(pace.end(1_310), 0);
        assert_eq!((pace.deadline_ns(), pace.beat(1_400).tick), (1_400, 2));
        // At 1430 tick 2 cannot begin yet.
        assert_eq!(pace.postpone(1_430), 1);
        assert_eq!((pace.deadline_ns(), pace.beat(1_500).tick), (1_500, 2));
        assert_eq!(pace.postpone(1_700), 3, "the next deadline is in the future");
        assert_eq!((pace.deadline_ns(), pace.beat(1_800).tick), (1_800, 2));
    }
}
