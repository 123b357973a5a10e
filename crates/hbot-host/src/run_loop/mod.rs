//! The thread of the control loop, in wall-clock or in virtual time: it waits for the next tick
//! ([`clock`], [`pace`], `early`, [`realtime`], [`processor`]) and runs it ([`engine`]).
//! [`signals`] lists the signals that end a program, [`stop_signal`] is an emergency stop by
//! signal.

pub mod bridge;
pub mod clock;
mod early;
pub mod engine;
pub mod pace;
pub mod processor;
pub mod realtime;
pub mod sample;
pub mod signals;
pub mod stop_signal;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use hbot_sim::socket::SharedTime;

use crate::run_loop::clock::{Origin, now_ns};
use crate::run_loop::early::Early;
use crate::run_loop::engine::{Engine, TickTime};
use crate::run_loop::pace::{Beat, Pace, Passed};
use crate::run_loop::realtime::{LOOP_PRIORITY, real_time, touch_stack};

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

/// When the ticks of a loop in wall-clock time take place.
#[derive(Debug, Clone)]
pub struct Schedule {
    /// Time between two deadlines, ns.
    pub period_ns: u64,
    /// Longest time by which the thread wakes before a deadline, ns.
    pub early_ns: u64,
    /// Number of ticks after which the loop ends. With `None` it runs until it is stopped.
    pub ticks: Option<u64>,
    /// The time that the loop shares with a simulated rig. The loop's time then waits if a tick
    /// comes too late or the rig has not answered. With `None` the time does not wait, and ticks
    /// whose deadlines have passed are skipped.
    pub shared: Option<SharedTime>,
}

/// Longest time for which a loop waits for its simulated rig, ns. After that it goes on without a
/// reading, so that a rig whose thread has ended is reported as a lost link.
const RIG_PATIENCE_NS: u64 = 2_000_000_000;

/// Runs ticks at absolute deadlines until `stop` is set or the last tick of `schedule` is done. The
/// motors are switched off at the end, even if a tick panics. Before the first tick, `settled` is
/// called with the result of requesting real-time priority (`Ok`, or the reason for the refusal)
/// and with the time of tick 0.
pub fn wall(
    mut engine: Engine,
    schedule: &Schedule,
    stop: &StopFlag,
    settled: impl FnOnce(Result<(), String>, Origin),
) -> Ended {
    let urgent = real_time(LOOP_PRIORITY);
    touch_stack();
    let Schedule { period_ns, early_ns, ticks, shared } = schedule;
    let mut early = Early::new(*early_ns, *period_ns);
    let passed = if shared.is_some() { Passed::Postponed } else { Passed::Skipped };
    let origin = Origin::at(now_ns() + period_ns);
    settled(urgent, origin);
    let mut pace = Pace::new(origin.monotonic_ns, *period_ns).with(passed);
    let mut tick = 0;
    guarded(&mut engine, Duration::from_nanos(*period_ns), |engine| {
        let (mut skipped, mut waited_ns) = (0, 0);
        while !stop.is_set() && ticks.is_none_or(|n| tick < n) {
            let awake_ns = early.wait(pace.deadline_ns(), || engine.rehearse(tick));
            let answered = shared.as_ref().is_none_or(SharedTime::is_answered);
            if answered {
                waited_ns = 0;
            } else if waited_ns < RIG_PATIENCE_NS {
                let periods = pace.postpone(now_ns());
                skipped += periods;
                waited_ns += periods * period_ns;
                continue;
            }
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

/// Longest time after which a loop that waits for permission looks for a stop.
const LOOK_FOR_STOP: Duration = Duration::from_millis(10);

/// Runs ticks as fast as the machine allows, in lock-step with a simulated rig at the other end of
/// the line. It waits while the ring of samples is full, so that no sample is lost, and after the
/// ticks that [`advance`](bridge::ServiceEnd::advance) permits.
pub fn lockstep(mut engine: Engine, period_ns: u64, ticks: Option<u64>, stop: &StopFlag) -> Ended {
    let mut tick = 0;
    guarded(&mut engine, Duration::ZERO, |engine| {
        while !stop.is_set() && ticks.is_none_or(|n| tick < n) {
            while engine.bridge().is_full() && !stop.is_set() {
                std::thread::yield_now();
            }
            if !engine.bridge().may_run(tick) {
                // The service unparks this thread when it permits a tick. An emergency stop does
                // not, so the thread looks for one.
                std::thread::park_timeout(LOOK_FOR_STOP);
                continue;
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
