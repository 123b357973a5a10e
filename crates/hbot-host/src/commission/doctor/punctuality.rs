//! Measures how late this machine wakes a thread, and grades the result.

use std::thread;
use std::time::Duration;

use hbot_core::controller::{LATE_FAULT_NS, SKIPPED_FAULT};
use serde::Serialize;

use super::{Finding, Mark};
use crate::run_loop::clock::{now_ns, sleep_until_ns};
use crate::run_loop::pace::Pace;
use crate::run_loop::processor::Processor;
use crate::run_loop::realtime::{LOOP_PRIORITY, real_time, touch_stack};

/// The measured lateness of a loop that only sleeps until its deadlines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Punctuality {
    /// Rate of the loop, Hz.
    pub rate_hz: u32,
    /// True if the loop ran under SCHED_FIFO.
    pub real_time: bool,
    /// Number of ticks that were measured.
    pub ticks: u64,
    /// Median lateness, µs.
    pub p50_us: f64,
    /// Lateness that 99 % of the ticks did not exceed, µs.
    pub p99_us: f64,
    /// Lateness that 99.9 % of the ticks did not exceed, µs.
    pub p99_9_us: f64,
    /// Lateness that 99.99 % of the ticks did not exceed, µs.
    pub p99_99_us: f64,
    /// Largest lateness, µs.
    pub max_us: f64,
    /// Number of ticks that were more than a quarter period late.
    pub late: u64,
    /// Number of ticks whose deadline passed before the previous tick ended.
    pub skipped: u64,
}

/// Measures how late the ticks of a loop start if it only sleeps until its deadlines, at `rate_hz`
/// for `time`. No other loop on this machine can be more punctual. The loop runs under SCHED_FIFO
/// if the system allows it, and on processor `cpu` if one is given and usable.
#[must_use]
pub fn punctuality(rate_hz: u32, cpu: Option<u32>, time: Duration) -> Punctuality {
    let period_ns = 1_000_000_000 / u64::from(rate_hz.max(1));
    let ticks = (time.as_nanos() / u128::from(period_ns)) as u64;
    let processor = cpu.and_then(|number| Processor::new(number).ok());
    let measured = thread::spawn(move || {
        // The processor was usable a moment ago. If it is no longer, the measurement covers the
        // others.
        let _ = processor.map(Processor::keep);
        let granted = real_time(LOOP_PRIORITY).is_ok();
        touch_stack();
        let mut lateness = Vec::with_capacity(ticks as usize);
        let (mut late, mut skipped) = (0, 0);
        let mut pace = Pace::new(now_ns() + period_ns, period_ns);
        for _ in 0..ticks {
            sleep_until_ns(pace.deadline_ns());
            let beat = pace.beat(now_ns());
            late += u64::from(beat.late);
            lateness.push(beat.lateness_ns);
            skipped += pace.end(now_ns());
        }
        (granted, lateness, late, skipped)
    });
    let (real_time, mut lateness, late, skipped) = measured.join().unwrap_or((false, Vec::new(), ticks, 0));
    lateness.sort_unstable();
    let at = |quantile: f64| {
        // The smallest lateness that this share of the ticks does not exceed.
        let place = (quantile * lateness.len() as f64).ceil() as usize;
        lateness.get(place.max(1) - 1).map_or(f64::MAX, |ns| *ns as f64 * 1e-3)
    };
    Punctuality {
        rate_hz,
        real_time,
        ticks,
        p50_us: at(0.5),
        p99_us: at(0.99),
        p99_9_us: at(0.999),
        p99_99_us: at(0.9999),
        max_us: at(1.0),
        late,
        skipped,
    }
}

/// Grades a measurement of lateness. It is good if at most one tick in 10,000 is late (by more than
/// a quarter period) and none by more than a period. It is usable if at most one in 100 is late and
/// no delay is long enough for the fault `deadline`. Otherwise it is not sufficient.
#[must_use]
pub fn verdict(measured: &Punctuality) -> Finding {
    let period_us = 1.0e6 / f64::from(measured.rate_hz);
    // After a longer delay, more than `SKIPPED_FAULT` ticks have been skipped.
    let fault_us = (SKIPPED_FAULT as f64 * period_us).min(1.0e-3 * LATE_FAULT_NS as f64);
    let mark = if measured.p99_99_us <= period_us / 4.0 && measured.max_us <= period_us {
        Mark::Good
    } else if measured.p99_us <= period_us / 4.0 && measured.max_us <= fault_us {
        Mark::Usable
    } else {
        Mark::NotSufficient
    };
    let found = format!(
        "at {} Hz{}: median {:.0} us late, 99 % {:.0}, 99.9 % {:.0}, 99.99 % {:.0}, most {:.0}; {} of {} ticks late, {} \
         skipped; a tick is late from {:.0} us on",
        measured.rate_hz,
        if measured.real_time { " under SCHED_FIFO" } else { "" },
        measured.p50_us,
        measured.p99_us,
        measured.p99_9_us,
        measured.p99_99_us,
        measured.max_us,
        measured.late,
        measured.ticks,
        measured.skipped,
        period_us / 4.0,
    );
    let mend = "mend what stands above, close other programs, and measure again for longer (`--seconds 60`); docs/realtime.md";
    Finding::new("punctuality", mark, found, mend)
}

/// Estimates the lead that the loop will need if it can wake up to `early_ns` before each deadline,
/// and the share of a processor that this costs. The mark is `Usable` instead of `Good` if even the
/// largest lead is too short for 1 % of the wake-ups or more.
#[must_use]
pub fn lead(measured: &Punctuality, early_ns: u64) -> Finding {
    let period_us = 1.0e6 / f64::from(measured.rate_hz);
    let most_us = (early_ns as f64 * 1e-3).min(period_us / 4.0);
    let needed_us = measured.p99_us;
    if early_ns == 0 {
        return Finding::new("early", Mark::Good, "off: ticks start as late as the machine wakes", "");
    }
    if needed_us < most_us {
        let share = 100.0 * needed_us / period_us;
        let found = format!(
            "the loop wakes some {needed_us:.0} us before its deadlines (at most {most_us:.0}) and waits awake: {share:.0} % of a processor"
        );
        return Finding::new("early", Mark::Good, found, "");
    }
    let found = format!(
        "the loop wakes at most {most_us:.0} us before its deadlines, and more than 1 % of the wake-ups are later than that"
    );
    let mend = if needed_us < period_us / 4.0 {
        format!("early_us = {:.0} in the rig file's [loop]", (1.5 * needed_us).min(period_us / 4.0).floor())
    } else {
        "a quarter of the period is the most: mend what stands above, or lower the rate".to_owned()
    };
    Finding::new("early", Mark::Usable, found, &mend)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_follows_the_numbers() {
        let measured = Punctuality {
            rate_hz: 1000,
            real_time: true,
            ticks: 10_000,
            p50_us: 5.0,
            p99_us: 20.0,
            p99_9_us: 40.0,
            p99_99_us: 250.0,
            max_us: 1000.0,
            late: 1,
            skipped: 0,
        };
        assert_eq!(verdict(&measured).mark, Mark::Good);
        assert_eq!(verdict(&Punctuality { p99_99_us: 251.0, ..measured }).mark, Mark::Usable);
        assert_eq!(verdict(&Punctuality { max_us: 1001.0, ..measured }).mark, Mark::Usable);
        for (rate_hz, most_us) in [(100, 20_000.0), (1000, 10_000.0), (4000, 2500.0)] {
            let late = |max_us| Punctuality { rate_hz, p99_99_us: 5000.0, max_us, ..measured };
            assert_eq!(verdict(&late(most_us)).mark, Mark::Usable);
            assert_eq!(verdict(&late(most_us + 1.0)).mark, Mark::NotSufficient);
        }
        assert_eq!(
            verdict(&Punctuality { p99_us: 251.0, p99_99_us: 251.0, ..measured }).mark,
            Mark::NotSufficient
        );
        // A quarter period at 4 kHz is a quarter of that at 1 kHz.
        assert_eq!(verdict(&Punctuality { rate_hz: 4000, ..measured }).mark, Mark::Usable);
    }

    #[test]
    fn a_loop_is_measured_and_none_of_its_ticks_is_lost() {
        let measured = punctuality(1000, None, Duration::from_millis(200));
        assert_eq!(measured.ticks, 200);
        let rising =
            [measured.p50_us, measured.p99_us, measured.p99_9_us, measured.p99_99_us, measured.max_us];
        assert!(rising.is_sorted() && measured.max_us < f64::MAX, "{measured:?}");
        // No machine wakes without delay, and every tick that counts as late is more than 250 µs
        // late.
        assert!(measured.p50_us > 0.0 && (measured.late == 0 || measured.max_us > 250.0), "{measured:?}");
    }

    #[test]
    fn how_early_it_wakes_follows_from_how_late_the_machine_is() {
        let measured = Punctuality {
            rate_hz: 1000,
            real_time: true,
            ticks: 10_000,
            p50_us: 30.0,
            p99_us: 120.0,
            p99_9_us: 200.0,
            p99_99_us: 250.0,
            max_us: 300.0,
            late: 2,
            skipped: 0,
        };
        let told = |measured: &Punctuality, early_ns| {
            let Finding { mark, found, mend, .. } = lead(measured, early_ns);
            (mark, found, mend.unwrap_or_default())
        };
        let (mark, found, _) = told(&measured, 200_000);
        assert!(mark == Mark::Good && found.contains("some 120 us") && found.contains(": 12 %"), "{found}");
        let (mark, found, mend) = told(&measured, 100_000);
        assert!(mark == Mark::Usable && found.contains("at most 100 us"), "{found}");
        assert!(mend.contains("early_us = 180"), "{mend}");
        let (mark, found, mend) = told(&Punctuality { rate_hz: 4000, ..measured }, 200_000);
        assert!(mark == Mark::Usable && found.contains("at most 62 us"), "{found}");
        assert!(mend.contains("lower the rate"), "{mend}");
        assert_eq!(told(&measured, 0).0, Mark::Good);
    }
}
