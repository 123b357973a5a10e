//! A line to the simulated rig over a pair of sockets, for wall-clock time. It carries the bytes
//! that a serial line would carry, and moves them as a serial line does.

use std::io;

use hbot_sim::socket::{HostEnd, SharedTime};

use super::Line;
use super::serial::Serial;

/// A line to a simulated rig that runs in another thread of this process.
#[derive(Debug)]
pub struct Socket {
    line: Serial,
    time: SharedTime,
}

impl From<HostEnd> for Socket {
    fn from(end: HostEnd) -> Self {
        Self { line: Serial::of(end.line), time: end.time }
    }
}

impl Line for Socket {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        self.time.reach(now_ns);
        self.line.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        self.time.reach(now_ns);
        let written = self.line.write(now_ns, bytes)?;
        self.time.wrote(written);
        Ok(written)
    }
}
