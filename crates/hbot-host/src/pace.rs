//! Absolute deadlines that keep their phase.

/// Deadlines at whole periods from a start; those that have passed are skipped, not caught up.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    start_ns: u64,
    period_ns: u64,
    next: u64,
}

/// Which tick it is, and how late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beat {
    /// The tick's number.
    pub tick: u64,
    /// From its deadline to now, ns.
    pub lateness_ns: u64,
    /// More than a quarter period late.
    pub late: bool,
}

impl Pace {
    /// Tick 0 at `start_ns`, then one every `period_ns` (not zero).
    #[must_use]
    pub fn new(start_ns: u64, period_ns: u64) -> Self {
        Self { start_ns, period_ns: period_ns.max(1), next: 0 }
    }

    /// The next tick's deadline, ns.
    #[must_use]
    pub fn deadline_ns(&self) -> u64 {
        self.start_ns + self.next * self.period_ns
    }

    /// The tick that begins at `now_ns`, its deadline having passed.
    #[must_use]
    pub fn beat(&self, now_ns: u64) -> Beat {
        let lateness_ns = now_ns.saturating_sub(self.deadline_ns());
        Beat { tick: self.next, lateness_ns, late: lateness_ns > self.period_ns / 4 }
    }

    /// Ends a tick at `now_ns`: how many deadlines have passed meanwhile and are skipped.
    pub fn end(&mut self, now_ns: u64) -> u64 {
        self.next += 1;
        let behind = now_ns.saturating_sub(self.deadline_ns());
        // A deadline that is just now counts as met.
        let skipped = behind.div_ceil(self.period_ns);
        self.next += skipped;
        skipped
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
        assert!(pace.beat(1_126).late);
        // Deadlines 1200 and 1300 pass while tick 1 runs.
        assert_eq!(pace.end(1_350), 2);
        assert_eq!(pace.deadline_ns(), 1_400);
        assert_eq!(pace.beat(1_400).tick, 4);
        assert_eq!(pace.end(1_500), 0, "a deadline that is just now is met");
    }
}
