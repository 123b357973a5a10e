//! The thread of the control loop, in wall-clock or in virtual time.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::clock::{Origin, now_ns};
use crate::early::Early;
use crate::engine::{Engine, TickTime};
use crate::pace::{Beat, Pace};
use crate::realtime::{LOOP_PRIORITY, real_time, touch_stack};

/// A flag that asks the loop to end. At most one more tick begins after it is set. Clones share one
/// flag.
#[derive(Debug, Clone, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Asks the loop to end.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns the flag's atomic value, for signal handlers, which can only set such a value.
    pub(crate) fn shared(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }

    /// Returns whether the loop has been asked to end.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Whether a loop runs in wall-clock time or in simulated time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// Wall-clock time: each tick has a deadline on the system clock.
    Wall,
    /// Virtual time: as fast as the machine allows, in lock-step with the simulated rig.
    Virtual,
}

/// How a loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The loop was asked to end, or has run all its ticks.
    Stopped,
    /// The loop panicked. The motors were switched off.
    Panicked,
}

/// Runs ticks at absolute deadlines, one every `period_ns`, until `stop` is set or the tick number
/// reaches `ticks`. The thread wakes up to `early_ns` before each deadline. The motors are switched
/// off at the end, even if a tick panics. Before the first tick, `settled` is called with the
/// result of requesting real-time priority (`Ok`, or the reason for the refusal) and with the time
/// of tick 0.
pub fn wall(
    mut engine: Engine,
    period_ns: u64,
    early_ns: u64,
    ticks: Option<u64>,
    stop: &StopFlag,
    settled: impl FnOnce(Result<(), String>, Origin),
) -> Ended {
    let urgent = real_time(LOOP_PRIORITY);
    touch_stack();
    let mut early = Early::new(early_ns, period_ns);
    let origin = Origin::at(now_ns() + period_ns);
    settled(urgent, origin);
    let mut pace = Pace::new(origin.monotonic_ns, period_ns);
    let mut tick = 0;
    guarded(&mut engine, Duration::from_nanos(period_ns), |engine| {
        let mut skipped = 0;
        while !stop.is_set() && ticks.is_none_or(|n| tick < n) {
            let awake_ns = early.wait(pace.deadline_ns(), || engine.rehearse(tick));
            let beat = pace.beat(now_ns());
            tick = beat.tick;
            let t_ns = tick * period_ns;
            let Beat { lateness_ns, late, .. } = beat;
            engine.tick(&TickTime { tick, t_ns, awake_ns, lateness_ns, late, skipped });
            skipped = pace.end(now_ns());
            tick += 1;
        }
        tick
    })
}

/// Runs ticks as fast as the machine allows, in lock-step with a simulated rig at the other end of
/// the line. It waits only while the ring of samples is full, so that no sample is lost.
pub fn lockstep(mut engine: Engine, period_ns: u64, ticks: Option<u64>, stop: &StopFlag) -> Ended {
    let mut tick = 0;
    guarded(&mut engine, Duration::ZERO, |engine| {
        while !stop.is_set() && ticks.is_none_or(|n| tick < n) {
            while engine.bridge().is_full() && !stop.is_set() {
                std::thread::yield_now();
            }
            let t_ns = tick * period_ns;
            engine.tick(&TickTime { tick, t_ns, awake_ns: 0, lateness_ns: 0, late: false, skipped: 0 });
            tick += 1;
        }
        tick
    })
}

/// Runs `ticks`, which runs the loop and returns the next tick number. Then switches the motors
/// off, even if `ticks` panics.
fn guarded(engine: &mut Engine, pause: Duration, ticks: impl FnOnce(&mut Engine) -> u64) -> Ended {
    // The engine's state is not used after a panic: `stop` writes a newly built frame.
    let last = catch_unwind(AssertUnwindSafe(|| ticks(engine)));
    engine.stop(last.as_ref().map_or(u32::MAX, |tick| *tick as u32), pause);
    if last.is_ok() { Ended::Stopped } else { Ended::Panicked }
}
