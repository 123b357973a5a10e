//! The loop's thread, in wall-clock or in virtual time.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::clock::now_ns;
use crate::early::Early;
use crate::engine::{Engine, TickTime};
use crate::pace::{Beat, Pace};
use crate::realtime::{LOOP_PRIORITY, real_time, touch_stack};

/// Asks the loop to end after its next tick.
#[derive(Debug, Clone, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Asks.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// The flag itself, for signal handlers, which can only set it.
    pub(crate) fn shared(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }

    /// Whether somebody has asked.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Which time a loop runs in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// The clock's.
    Wall,
    /// As fast as the machine goes, in lock-step with the simulated rig.
    Virtual,
}

/// How a loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// As asked, or after the ticks it was given.
    Stopped,
    /// By a fault of its own; motors were switched off.
    Panicked,
}

/// Ticks at absolute deadlines every `period_ns` until stopped, or for `ticks` periods, awake up to `early_ns` before them. Zero torque
/// is sent at the end, whatever ends it. `settled` hears whether the thread has its real-time priority, or why not, before the first tick.
pub fn wall(
    mut engine: Engine,
    period_ns: u64,
    early_ns: u64,
    ticks: Option<u64>,
    stop: &StopFlag,
    settled: impl FnOnce(Result<(), String>),
) -> Ended {
    settled(real_time(LOOP_PRIORITY));
    touch_stack();
    let mut early = Early::new(early_ns, period_ns);
    let mut pace = Pace::new(now_ns() + period_ns, period_ns);
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

/// Ticks as fast as the machine goes, in lock-step with a simulated rig at the other end of the line. It waits only for
/// somebody to fetch its samples, so none is lost.
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

/// Runs `ticks` and switches the motors off at the end, even where it panics.
fn guarded(engine: &mut Engine, pause: Duration, ticks: impl FnOnce(&mut Engine) -> u64) -> Ended {
    // What a panic leaves behind in the engine is not used again: stop() writes a fresh frame.
    let last = catch_unwind(AssertUnwindSafe(|| ticks(engine)));
    engine.stop(last.as_ref().map_or(u32::MAX, |tick| *tick as u32), pause);
    if last.is_ok() { Ended::Stopped } else { Ended::Panicked }
}
