//! A serial line as a motor bus sees it: it moves bytes and never waits.
//!
//! A line is a [`serial`] port, or the simulated rig in memory ([`Memory`]).

mod memory;
pub mod serial;

use std::io;

pub use self::memory::{Memory, SimulatorCall};

/// Moves bytes to and from motor controllers. `now_ns` is the time since the start of the loop.
/// Only a line in memory uses it; a serial port ignores it.
pub trait Line: Send {
    /// Reads the bytes that have arrived into `buffer` and returns their number, 0 if there are
    /// none. Never waits.
    ///
    /// # Errors
    /// Fails if the line is lost.
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes as many bytes as the line has room for and returns their number. Never waits.
    ///
    /// # Errors
    /// Fails if the line is lost.
    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize>;

    /// Returns a report if the line was lost and has been reopened since the last call. Never
    /// waits.
    fn renewed(&mut self) -> Option<Renewed> {
        None
    }

    /// Waits for a millisecond, outside the loop. A line in memory does not wait, because `now_ns`
    /// is its clock.
    fn pause(&mut self) {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }

    /// Informs the line that its motors are off and that nothing more is written. This call can
    /// block.
    fn release(&mut self) {}
}

/// The report that a lost line has been reopened and that the controllers on it are those of the
/// rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Renewed {
    /// True if the controllers lost power while the line was lost. Their zeros are then no longer
    /// valid.
    pub rebooted: bool,
}
