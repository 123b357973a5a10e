//! A serial line as a motor bus sees it: bytes in, bytes out, never waiting.
//!
//! A line is a [`serial`] port, or the simulated rig in memory ([`Memory`]).

mod memory;
pub mod serial;

use std::io;

pub use self::memory::{Memory, SimulatorCall};

/// Bytes to and from motor controllers. `now_ns` is the time since the start of the loop; a real line
/// has no use for it.
pub trait Line: Send {
    /// Reads what has arrived, 0 where nothing has. Never waits.
    ///
    /// # Errors
    /// The line is gone.
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes as many bytes as there is room for and returns their number. Never waits.
    ///
    /// # Errors
    /// The line is gone.
    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize>;

    /// Whether the line was gone and is back since this was asked last. Never waits.
    fn renewed(&mut self) -> Option<Renewed> {
        None
    }

    /// Tells the line that its motors are off and that nothing more is written. May wait.
    fn release(&mut self) {}
}

/// A line that was gone is back, and the controllers on it are those of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Renewed {
    /// They have lost power meanwhile: their zeros are not those of before.
    pub rebooted: bool,
}
