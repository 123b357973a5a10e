//! The monotonic clock and absolute sleeps.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

const NS: u64 = 1_000_000_000;

/// Now, ns on CLOCK_MONOTONIC.
#[inline]
#[must_use]
pub fn now_ns() -> u64 {
    let t = clock_gettime(ClockId::Monotonic);
    // Neither is negative on this clock.
    t.tv_sec.unsigned_abs() * NS + t.tv_nsec.unsigned_abs()
}

/// Sleeps until `deadline_ns` on CLOCK_MONOTONIC; returns at once where it has passed.
pub fn sleep_until_ns(deadline_ns: u64) {
    let request =
        Timespec { tv_sec: (deadline_ns / NS).cast_signed(), tv_nsec: (deadline_ns % NS).cast_signed() };
    // A signal wakes it early; the deadline is absolute, so asking again does no harm.
    while clock_nanosleep_absolute(ClockId::Monotonic, &request).is_err_and(|e| e == rustix::io::Errno::INTR)
    {
    }
}
