//! The monotonic clock, sleeping until an absolute time, and the time of tick 0.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

const NS: u64 = 1_000_000_000;

/// Returns the current time of CLOCK_MONOTONIC, ns.
#[inline]
#[must_use]
pub fn now_ns() -> u64 {
    let t = clock_gettime(ClockId::Monotonic);
    // Neither part is negative on this clock.
    t.tv_sec.unsigned_abs() * NS + t.tv_nsec.unsigned_abs()
}

/// The time of tick 0 on two clocks of the system. With it, the time of any tick can be compared
/// with the time stamps of other devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// Deadline of tick 0 on CLOCK_MONOTONIC, ns.
    pub monotonic_ns: u64,
    /// The same moment on CLOCK_REALTIME: ns since 1970-01-01 00:00 UTC. It is measured when the
    /// loop starts, and does not follow later corrections of that clock.
    pub unix_ns: u64,
}

impl Origin {
    /// Returns the moment `monotonic_ns` of CLOCK_MONOTONIC on both clocks. Reads the two clocks
    /// once, so the error is at most the time between two reads of a clock, normally below 1 us.
    #[must_use]
    pub fn at(monotonic_ns: u64) -> Self {
        let before = now_ns();
        let real = clock_gettime(ClockId::Realtime);
        let middle = before + (now_ns() - before) / 2;
        let real_ns = i128::from(real.tv_sec) * i128::from(NS) + i128::from(real.tv_nsec);
        let unix_ns = real_ns + i128::from(monotonic_ns) - i128::from(middle);
        // A clock that is set to a time before 1970 is taken as 1970.
        Self { monotonic_ns, unix_ns: u64::try_from(unix_ns).unwrap_or(0) }
    }
}

/// Sleeps until `deadline_ns` on CLOCK_MONOTONIC. Returns at once if that time has passed.
pub fn sleep_until_ns(deadline_ns: u64) {
    let request =
        Timespec { tv_sec: (deadline_ns / NS).cast_signed(), tv_nsec: (deadline_ns % NS).cast_signed() };
    // A signal can end the sleep early. The deadline is absolute, so sleeping again is safe.
    while clock_nanosleep_absolute(ClockId::Monotonic, &request).is_err_and(|e| e == rustix::io::Errno::INTR)
    {
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::mpsc;
    use std::time::{Duration, SystemTime, UNIX_EPOCH};

    use rustix::process::{Signal, kill_process};
    use rustix::thread::gettid;

    use super::*;

    #[test]
    fn an_origin_is_one_moment_on_both_clocks() {
        let second = Duration::from_secs(1);
        let before = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        let ahead = Origin::at(now_ns() + NS);
        let after = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        let unix = Duration::from_nanos(ahead.unix_ns);
        // The system may correct its clock a little between these reads.
        let correction = Duration::from_millis(1);
        assert!(unix + correction >= before + second && unix <= after + second + correction, "{unix:?}");
    }

    /// Sleeps in a thread that gets a signal each millisecond. Checks that the sleep does not end
    /// before its deadline. The system prefers that thread for the signals, but promises nothing.
    fn sleep_with_signals() {
        let (tell, told) = mpsc::channel();
        let (release, released) = mpsc::channel::<()>();
        let deadline_ns = now_ns() + 150_000_000;
        let sleeper = std::thread::spawn(move || {
            tell.send(gettid()).expect("the test listens");
            sleep_until_ns(deadline_ns);
            let woken_ns = now_ns();
            // The thread stays until no more signals are sent to it.
            let _ = released.recv();
            woken_ns
        });
        let thread = told.recv().expect("the thread's id");
        while now_ns() < deadline_ns {
            kill_process(thread, Signal::WINCH).expect("the thread is there");
            std::thread::sleep(Duration::from_millis(1));
        }
        drop(release);
        let woken_ns = sleeper.join().expect("no panic");
        assert!(woken_ns >= deadline_ns, "{} ns too early", deadline_ns - woken_ns);
    }

    /// This test takes some time because time is its subject. On a busy machine an attempt can end
    /// before its first signal.
    #[test]
    fn signals_do_not_end_a_sleep_before_its_deadline() {
        let caught = Arc::new(AtomicBool::new(false));
        // A signal that nothing else in the tests uses, and which is ignored without a handler.
        signal_hook::flag::register(signal_hook::consts::SIGWINCH, Arc::clone(&caught)).expect("a handler");
        let has_come = (0..20).any(|_| {
            sleep_with_signals();
            caught.load(Ordering::Relaxed)
        });
        assert!(has_come, "no signal has come");
        // A deadline that has passed is not waited for.
        sleep_until_ns(0);
    }
}
