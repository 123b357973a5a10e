//! Waking before a tick's deadline, as early as this machine needs, to rehearse the tick and wait out the rest awake.
//!
//! A sleep ends late, and whatever ran meanwhile has taken the caches. A thread that wakes early starts its tick on time all the
//! same, with code and data at hand: its lateness and computing time no longer depend on what else the machine does. The price is
//! a processor kept busy for that long, so it learns how early is enough.

use crate::clock::{now_ns, sleep_until_ns};

/// One wake-up in this many may come too late for a rehearsal.
const MISSES: u64 = 100;
/// Wake-ups in time, without one too late, that take it from the longest lead to none.
const FORGET: u64 = 20_000;

/// How early the loop wakes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Early {
    most_ns: u64,
    lead_ns: u64,
    /// What the first rehearsal after a sleep took last, ns.
    rehearsal_ns: u64,
}

impl Early {
    /// Up to `most_ns` before a deadline, and not more than a quarter of the period; 0: it sleeps until the deadline.
    pub(crate) fn new(most_ns: u64, period_ns: u64) -> Self {
        let most_ns = most_ns.min(period_ns / 4);
        Self { most_ns, lead_ns: most_ns, rehearsal_ns: 0 }
    }

    /// Returns at `deadline_ns`, or as soon after it as the system lets it; `rehearse` has run at least once, if there was time for
    /// it, and the last time shortly before. How long it was awake before the deadline, ns.
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
            // A rehearsal that was itself held up must not keep all later ones from being tried.
            self.rehearsal_ns = took.min(self.most_ns / 4);
            // Others may share the caches, so again after half of what is left, and so on.
            while let Some(pause) = pause_ns(deadline_ns.saturating_sub(now), took) {
                now = awake_until(now + pause);
                took = rehearsed(&mut now, &mut rehearse);
            }
        }
        awake_until(deadline_ns);
        awake_ns
    }

    /// Moves the lead to where one wake-up in [`MISSES`] is too late: up by as much more for each as it goes down for the others
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

/// The pause before the next rehearsal, ns, where `left` ns remain and one takes `took`; `None` where the next might end too late.
fn pause_ns(left: u64, took: u64) -> Option<u64> {
    (left > 4 * took).then_some(left / 2)
}

/// Runs it and moves `now` on: how long it took, ns.
fn rehearsed(now: &mut u64, rehearse: &mut impl FnMut()) -> u64 {
    rehearse();
    let start = std::mem::replace(now, now_ns());
    *now - start
}

/// Waits without sleeping; the time when it ended, ns.
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

    /// A lead after `n` wake-ups, each late by what `late` says of it, and the share of the last half that came too late.
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
        // Evenly between 30 and 70 us late: 99 % within 69.6 us.
        let spread = |k: u64| 30_000 + 40_000 * (k * 7919 % 10_000) / 10_000;
        let mut early = Early::new(200_000, 1_000_000);
        let misses = learnt(&mut early, 200_000, spread);
        assert!((66_000..74_000).contains(&early.lead_ns), "{early:?}");
        assert!((0.009..0.011).contains(&misses), "{misses}");
        // The same machine under load: it follows, up to what it was given.
        learnt(&mut early, 20_000, |k| 3 * spread(k));
        assert!((180_000..=200_000).contains(&early.lead_ns), "{early:?}");
        // One that wakes at once costs next to nothing.
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
        // A busy machine may miss some: not all of fifty.
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
        // One that took the whole lead once is tried again after all.
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

    #[test]
    fn without_a_lead_it_only_sleeps() {
        let mut early = Early::new(0, 1_000_000);
        let deadline = now_ns() + 2_000_000;
        assert_eq!(early.wait(deadline, || panic!("nothing to rehearse for")), 0);
        assert!(now_ns() >= deadline);
    }
}
