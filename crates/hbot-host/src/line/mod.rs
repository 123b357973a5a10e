//! A serial line as a motor bus sees it: it moves bytes and never waits.
//!
//! A line is a [`serial`] port, the simulated rig behind a pair of sockets ([`Socket`]), or the
//! simulated rig in memory ([`Memory`]).

mod memory;
pub mod serial;
mod socket;

use std::io;

pub use self::memory::{Memory, SimulatorCall};
pub use self::socket::Socket;

/// A connection that carries bytes to and from motor controllers. `now_ns` is the time since the
/// start of the control loop, in ns. Only a simulated line uses it.
pub trait Line: Send {
    /// Reads the bytes that have arrived into `buffer` and returns their number. Returns 0 if none
    /// have arrived. Never waits.
    ///
    /// # Errors
    /// Fails if the line is lost.
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes as many bytes as the line has room for and returns their number. Never waits.
    ///
    /// # Errors
    /// Fails if the line is lost.
    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize>;

    /// Returns a report if the line was lost and has been reopened since the last call. Otherwise
    /// returns `None`. Never waits.
    fn renewed(&mut self) -> Option<Renewed> {
        None
    }

    /// Waits for a millisecond; it is called only outside the control loop. A simulated line in
    /// memory does not wait, because its time is the `now_ns` of the other calls.
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
