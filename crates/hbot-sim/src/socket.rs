//! Serves a simulated rig over a pair of sockets, to a control loop in the same process.
//!
//! The bytes are those of a serial line. Compared with a pseudo-terminal there are two differences,
//! so that other programs on the machine cannot make the simulated rig fail:
//!
//! - No worker thread of the kernel carries the bytes. On a busy machine such a worker holds them
//!   back for tens of milliseconds.
//! - Loop and rig share one time ([`SharedTime`]). The time of the rig goes on to the next tick and
//!   no further, so it waits for a loop that is late. The loop can ask whether the rig has answered
//!   everything, so it can wait for the rig.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::io::Errno;

use crate::rig::SimulatedRig;
use crate::served::{End, IDLE, ServeError, ServedRig, monotonic_ns, serve};

/// The time that a control loop and its simulated rig share, and the bytes between them. Clones
/// share one value.
#[derive(Debug, Clone, Default)]
pub struct SharedTime(Arc<Progress>);

#[derive(Debug, Default)]
struct Progress {
    /// Time of the loop's newest tick, ns. It is 0 before the second tick; the rig's time then
    /// follows the clock.
    reached_ns: AtomicU64,
    /// Number of bytes that the loop has written.
    written: AtomicU64,
    /// Number of bytes that the rig has answered.
    answered: AtomicU64,
}

impl SharedTime {
    /// Informs the rig that the loop has reached the time `now_ns` since its start. Call it before
    /// the bytes of that time are written.
    pub fn reach(&self, now_ns: u64) {
        self.0.reached_ns.store(now_ns, Ordering::Release);
    }

    /// Adds `count` to the number of bytes that the loop has written.
    pub fn wrote(&self, count: usize) {
        self.0.written.fetch_add(count as u64, Ordering::Relaxed);
    }

    /// Returns whether the rig has answered all bytes that the loop has written.
    #[must_use]
    pub fn is_answered(&self) -> bool {
        self.0.answered.load(Ordering::Acquire) >= self.0.written.load(Ordering::Relaxed)
    }
}

/// The control loop's end of the line to a simulated rig.
#[derive(Debug)]
pub struct HostEnd {
    /// The line. Reads and writes return at once.
    pub line: OwnedFd,
    /// The time that the loop shares with the rig.
    pub time: SharedTime,
}

/// Serves `rig` on a new pair of sockets, from a thread named `hbot-sim`, until the returned
/// [`ServedRig`] is stopped or dropped, or the other end of the line is closed. `period_ns` is the
/// period of the loop, ns. The thread calls `on_start` first.
///
/// # Errors
/// Fails if the system provides no sockets or the thread cannot be started.
pub fn spawn_socket(
    rig: SimulatedRig,
    period_ns: u64,
    on_start: impl FnOnce() + Send + 'static,
) -> Result<(ServedRig, HostEnd), ServeError> {
    let (near, far) = pair().map_err(ServeError::NoSocket)?;
    let time = SharedTime::default();
    let end = RigEnd { line: near, time: time.clone(), period_ns, read: 0, clock: Clock::default() };
    let served = serve(rig, end, IDLE, Box::new(on_start))?;
    Ok((served, HostEnd { line: far, time }))
}

fn pair() -> std::io::Result<(OwnedFd, OwnedFd)> {
    let (near, far) = UnixStream::pair()?;
    near.set_nonblocking(true)?;
    far.set_nonblocking(true)?;
    Ok((near.into(), far.into()))
}

/// The rig's end of a pair of sockets.
struct RigEnd {
    line: OwnedFd,
    time: SharedTime,
    period_ns: u64,
    /// Number of bytes read so far.
    read: u64,
    clock: Clock,
}

/// The time of the simulated rig, ns.
#[derive(Debug, Clone, Copy, Default)]
struct Clock {
    now_ns: u64,
    /// The newest time of the loop that the rig has seen, and when it saw it.
    reached_ns: u64,
    seen_ns: u64,
    /// The rig's time minus the loop's time.
    base_ns: u64,
}

impl Clock {
    /// Advances the rig's time to the wall-clock time `wall_ns`, but at most to one period after
    /// `reached_ns`, the time of the loop's newest tick. Returns the rig's time.
    fn advance(&mut self, wall_ns: u64, reached_ns: u64, period_ns: u64) -> u64 {
        let target_ns = if reached_ns == 0 {
            wall_ns
        } else {
            if self.reached_ns == 0 {
                self.base_ns = wall_ns.saturating_sub(reached_ns);
            }
            if self.reached_ns != reached_ns {
                (self.reached_ns, self.seen_ns) = (reached_ns, wall_ns);
            }
            self.base_ns + reached_ns + wall_ns.saturating_sub(self.seen_ns).min(period_ns)
        };
        self.now_ns = self.now_ns.max(target_ns);
        self.now_ns
    }
}

impl End for RigEnd {
    fn descriptor(&self) -> BorrowedFd<'_> {
        self.line.as_fd()
    }

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno> {
        match rustix::io::read(&self.line, buffer) {
            // The loop has closed its end.
            Ok(0) => Err(Errno::PIPE),
            Ok(count) => {
                self.read += count as u64;
                Ok(count)
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(errno) => Err(errno),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Errno> {
        match rustix::io::write(&self.line, bytes) {
            Ok(_) | Err(Errno::AGAIN | Errno::INTR) => Ok(()),
            Err(errno) => Err(errno),
        }
    }

    fn answered(&mut self) {
        self.time.0.answered.store(self.read, Ordering::Release);
    }

    fn now_ns(&mut self) -> u64 {
        let reached_ns = self.time.0.reached_ns.load(Ordering::Acquire);
        self.clock.advance(monotonic_ns(), reached_ns, self.period_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rig's time follows the clock until the loop begins, then the loop's ticks.
    #[test]
    fn the_time_of_the_rig_waits_for_a_loop_that_is_late() {
        const MS: u64 = 1_000_000;
        let mut clock = Clock::default();
        assert_eq!(clock.advance(500 * MS, 0, MS), 500 * MS);
        // Tick 1, at 1 ms of the loop's time.
        assert_eq!(clock.advance(600 * MS, MS, MS), 600 * MS);
        assert_eq!(clock.advance(600 * MS + MS / 2, MS, MS), 600 * MS + MS / 2);
        // The loop is 80 ms late: the rig has simulated one period and waits.
        assert_eq!(clock.advance(680 * MS, MS, MS), 601 * MS);
        assert_eq!(clock.advance(681 * MS, 2 * MS, MS), 601 * MS);
        assert_eq!(clock.advance(682 * MS, 3 * MS, MS), 602 * MS);
        // A tick that comes a little early takes no time back.
        assert_eq!(clock.advance(682 * MS + MS / 2, 3 * MS, MS), 602 * MS + MS / 2);
        assert_eq!(clock.advance(682 * MS + MS * 3 / 4, 4 * MS, MS), 603 * MS);
    }
}
