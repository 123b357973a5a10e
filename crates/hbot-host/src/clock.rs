//! The monotonic clock, and sleeping until an absolute time.

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

/// Sleeps until `deadline_ns` on CLOCK_MONOTONIC. Returns at once if that time has passed.
pub fn sleep_until_ns(deadline_ns: u64) {
    let request =
        Timespec { tv_sec: (deadline_ns / NS).cast_signed(), tv_nsec: (deadline_ns % NS).cast_signed() };
    // A signal can end the sleep early. The deadline is absolute, so sleeping again is safe.
    while clock_nanosleep_absolute(ClockId::Monotonic, &request).is_err_and(|e| e == rustix::io::Errno::INTR)
    {
    }
}
