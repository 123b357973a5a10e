//! Wakes the loop before a tick's deadline, rehearses the tick, and waits awake until the deadline.
//!
//! A thread that sleeps wakes late, and other work has meanwhile displaced its data from the
//! caches. A thread that wakes early starts its tick on time, with code and data in the caches.
//! Lateness and computing time then no longer depend on other work on the machine. The price is a
//! processor that is busy for the lead time, so the lead is adapted to what this machine needs.

use crate::run_loop::clock::{now_ns, sleep_until_ns};

/// The lead is the time by which the loop wakes before a deadline. It is adapted so that one of
/// this many wake-ups comes too late for a rehearsal of the tick.
const MISSES: u64 = 100;
/// Number of consecutive on-time wake-ups after which the lead has decayed from its maximum to
/// zero.
const FORGET: u64 = 20_000;

/// The time by which the loop wakes before its deadlines, called the lead. It adapts to how late
/// this machine wakes the thread.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Early {
    most_ns: u64,
    lead_ns: u64,
    /// Duration of the most recent rehearsal that directly followed a sleep, ns.
    rehearsal_ns: u64,
}

impl Early {
    /// Creates the lead, which starts at its maximum: `most_ns`, but at most a quarter of the
    /// period. If `most_ns` is 0, the loop sleeps until the deadline.
    pub(crate) fn new(most_ns: u64, period_ns: u64) -> Self {
        let most_ns = most_ns.min(period_ns / 4);
        Self { most_ns, lead_ns: most_ns, rehearsal_ns: 0 }
    }

    /// Waits until `deadline_ns`. If there is time, it runs `rehearse`, a trial run of the tick, at
    /// least once, the last time shortly before the deadline. Returns how long the thread was awake
    /// before the deadline, ns.
    pub(crate) fn wait(&mut self, deadline_ns: u64, mut rehearse: impl FnMut()) -> u64 {
        sleep_until_ns(deadline_ns.saturating_sub(self.lead_ns));
        if self.most_ns == 0 {
            return 0;
        }
        let mut now = now_ns();
        let awake_ns = deadline_ns.saturating_sub(now);
        let in_time = awake_ns > 2 * self.rehearsal_ns;
        self.learn(in_time);
        if in_time {
            let mut took = rehearsed(&mut now, &mut rehearse);
            // The limit keeps one rehearsal that was itself delayed from preventing all later ones.
            self.rehearsal_ns = took.min(self.most_ns / 4);
            // Other work can displace the caches again, so rehearse again after half of the
            // remaining time, and so on.
            while let Some(pause) = pause_ns(deadline_ns.saturating_sub(now), took) {
                now = awake_until(now + pause);
                took = rehearsed(&mut now, &mut rehearse);
            }
        }
        awake_until(deadline_ns);
        awake_ns
    }

    /// Adapts the lead so that one wake-up in [`MISSES`] comes too late for a rehearsal. A late
    /// wake-up raises the lead by `MISSES - 1` times the step by which an on-time one lowers it
    /// (stochastic approximation of a quantile, Robbins and Monro, 1951).
    fn learn(&mut self, in_time: bool) {
        let step = (self.most_ns / FORGET).max(1);
        self.lead_ns = if in_time {
            self.lead_ns.saturating_sub(step)
        } else {
            (self.lead_ns + (MISSES - 1) * step).min(self.most_ns)
        };
    }
}

/// Returns the pause before the next rehearsal, ns, if `left` ns remain and one rehearsal takes
/// `took` ns. Returns `None` if the next one might end too late.
fn pause_ns(left: u64, took: u64) -> Option<u64> {
    (left > 4 * took).then_some(left / 2)
}

/// Runs `rehearse` and sets `now` to the current time. Returns how long the rehearsal took, ns.
fn rehearsed(now: &mut u64, rehearse: &mut impl FnMut()) -> u64 {
    rehearse();
    let start = std::mem::replace(now, now_ns());
    *now - start
}

/// Waits until `deadline_ns` without sleeping. Returns the time when the wait ended, ns.
fn awake_until(deadline_ns: u64) -> u64 {
    loop {
        let now = now_ns();
        if now >= deadline_ns {
            return now;
        }
        std::hint::spin_loop();
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Adapts `early` to `n` simulated wake-ups, of which wake-up `k` is `late(k)` ns late. Returns
    /// the share of the second half that came too late.
    fn learnt(early: &mut Early, n: u64, late: impl Fn(u64) -> u64) -> f64 {
        let mut misses = 0;
        for k in 0..n {
            let in_time = late(k) < early.lead_ns;
            misses += u64::from(!in_time && k >= n / 2);
            early.learn(in_time);
        }
        misses as f64 / (n - n / 2) as f64
    }

    #[test]
    fn it_wakes_as_early_as_the_machine_needs() {
        // Lateness is spread evenly between 30 and 70 µs: 99 % of the wake-ups are within 69.6 µs.
        let spread = |k: u64| 30_000 + 40_000 * (k * 7919 % 10_000) / 10_000;
        let mut early = Early::new(200_000, 1_000_000);
        let misses = learnt(&mut early, 200_000, spread);
        assert!((66_000..74_000).contains(&early.lead_ns), "{early:?}");
        assert!((0.009..0.011).contains(&misses), "{misses}");
        // On the same machine under load the lead grows, up to its maximum.
        learnt(&mut early, 20_000, |k| 3 * spread(k));
        assert!((180_000..=200_000).contains(&early.lead_ns), "{early:?}");
        // On a machine that wakes threads without delay, the lead shrinks to almost nothing.
        learnt(&mut early, 40_000, |_| 2_000);
        assert!(early.lead_ns < 5_000, "{early:?}");
    }

    #[test]
    fn it_keeps_to_a_quarter_of_the_period_and_to_what_it_is_given() {
        assert_eq!(Early::new(200_000, 1_000_000).lead_ns, 200_000);
        assert_eq!(Early::new(200_000, 125_000).lead_ns, 31_250);
        let mut early = Early::new(200_000, 125_000);
        learnt(&mut early, 1_000, |_| 1_000_000);
        assert_eq!(early.lead_ns, 31_250);
    }

    #[test]
    fn it_rehearses_and_returns_at_the_deadline() {
        let mut early = Early::new(20_000_000, 1_000_000_000);
        let rehearsals = Cell::new(0);
        // A busy machine can miss some rehearsals, but not all of fifty.
        let awake: u64 = (0..50)
            .map(|_| {
                let deadline = now_ns() + 25_000_000;
                let awake = early.wait(deadline, || rehearsals.set(rehearsals.get() + 1));
                assert!(now_ns() >= deadline);
                assert!(awake <= 20_000_000, "{awake}");
                awake
            })
            .sum();
        assert!(awake > 0 && rehearsals.get() > 0, "{awake} ns awake, {} rehearsals", rehearsals.get());
    }

    #[test]
    fn a_rehearsal_that_might_end_too_late_is_not_begun() {
        assert_eq!(pause_ns(100_000, 5_000), Some(50_000));
        assert_eq!(pause_ns(20_000, 5_000), None);
        // A first rehearsal that took longer than the whole lead does not prevent later ones.
        let mut early = Early::new(2_000_000, 1_000_000_000);
        let rehearsals = Cell::new(0);
        for _ in 0..200 {
            let slow = rehearsals.get() == 0;
            early.wait(now_ns() + 3_000_000, || {
                rehearsals.set(rehearsals.get() + 1);
                if slow {
                    std::thread::sleep(std::time::Duration::from_millis(5));
                }
            });
        }
        assert!(rehearsals.get() > 1);
    }

    /// A thread that wakes 4 ms or less before its deadline has no time for a rehearsal of 3 ms: it
    /// must not take more than half of the time that is left. A late wake-up raises the lead.
    #[test]
    fn a_wake_up_that_leaves_too_little_time_is_followed_by_no_rehearsal() {
        let mut early = Early::new(4_000_000, 1_000_000_000);
        early.rehearsal_ns = 3_000_000;
        let deadline = now_ns() + 10_000_000;
        let awake = early.wait(deadline, || panic!("it would end too late"));
        assert!(awake <= 4_000_000 && now_ns() >= deadline);
        assert_eq!((early.lead_ns, early.rehearsal_ns), (4_000_000, 3_000_000));
        early.lead_ns = 1_000_000;
        early.wait(now_ns() + 10_000_000, || panic!("it would end too late"));
        // The step is a 20,000th of the largest lead, 200 ns, and a late wake-up counts 99 times.
        assert_eq!(early.lead_ns, 1_000_000 + 99 * 200);
    }

    /// Before the first rehearsal its duration counts as 0. No time left must not count as enough
    /// for it.
    #[test]
    fn a_wake_up_after_its_deadline_is_followed_by_no_rehearsal() {
        let mut early = Early::new(4_000_000, 1_000_000_000);
        assert_eq!(early.wait(now_ns() - 1, || panic!("the tick is late already")), 0);
        assert_eq!((early.lead_ns, early.rehearsal_ns), (4_000_000, 0));
    }

    /// After each rehearsal half of the time that is left passes before the next one.
    #[test]
    fn rehearsals_are_repeated_in_shorter_and_shorter_pauses() {
        let mut early = Early::new(20_000_000, 1_000_000_000);
        let mut most = 0;
        // A busy machine can miss some rehearsals, but not all of twenty.
        for _ in 0..20 {
            let count = Cell::new(0);
            early.wait(now_ns() + 25_000_000, || count.set(count.get() + 1));
            // 20 ms are halved 25 times until no nanosecond is left.
            assert!(count.get() <= 27, "{} rehearsals", count.get());
            most = most.max(count.get());
        }
        assert!(most > 1, "{most} rehearsals");
    }

    /// The duration of a rehearsal is remembered, up to a quarter of the largest lead. This test
    /// sleeps because time is its subject.
    #[test]
    fn a_slow_rehearsal_is_remembered_as_a_quarter_of_the_largest_lead() {
        let mut early = Early::new(40_000_000, 1_000_000_000);
        let done = Cell::new(0);
        while done.get() == 0 {
            early.wait(now_ns() + 45_000_000, || {
                done.set(done.get() + 1);
                std::thread::sleep(std::time::Duration::from_millis(12));
            });
        }
        assert_eq!(early.rehearsal_ns, 10_000_000);
    }

    #[test]
    fn without_a_lead_it_only_sleeps() {
        let mut early = Early::new(0, 1_000_000);
        let deadline = now_ns() + 2_000_000;
        assert_eq!(early.wait(deadline, || panic!("nothing to rehearse for")), 0);
        assert!(now_ns() >= deadline);
    }
}
