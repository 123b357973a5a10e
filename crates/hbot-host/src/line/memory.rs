//! A line to the simulated rig in memory, for virtual time. It carries the bytes that a serial line
//! would carry.

use std::io;
use std::sync::mpsc::Receiver;

use hbot_sim::rig::SimulatedRig;

use super::Line;

/// A function that is run on the simulated rig between two ticks.
pub type SimulatorCall = Box<dyn FnOnce(&mut SimulatedRig) + Send>;

/// Capacity of the receive buffer, bytes. It has room for everything that an impaired line can
/// deliver at once, so that the loop never allocates memory.
const INBOX: usize = 256 * 1024;

/// A line to a simulated rig in the memory of this process, for virtual time.
pub struct Memory {
    rig: SimulatedRig,
    calls: Receiver<SimulatorCall>,
    inbox: Vec<u8>,
    read: usize,
    /// Time of the line at which its user's clock last started again from 0, in ns. A conversation
    /// before the first tick has its own clock.
    base_ns: u64,
    /// Last time of the user's clock, in ns.
    last_ns: u64,
}

impl Memory {
    /// Returns a line to `rig`. Functions from `calls` are run on the rig before the next bytes are
    /// written.
    #[must_use]
    pub fn new(rig: SimulatedRig, calls: Receiver<SimulatorCall>) -> Self {
        Self { rig, calls, inbox: Vec::with_capacity(INBOX), read: 0, base_ns: 0, last_ns: 0 }
    }

    /// Converts the time of the user's clock to the time of the line, in ns.
    fn time(&mut self, now_ns: u64) -> u64 {
        if now_ns < self.last_ns {
            self.base_ns += self.last_ns;
        }
        self.last_ns = now_ns;
        self.base_ns + now_ns
    }
}

impl Line for Memory {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let now_ns = self.time(now_ns);
        // Fetches bytes that an impaired line has delayed and that are due before this tick.
        if self.rig.next_arrival_ns().is_some_and(|at_ns| at_ns < now_ns) {
            self.rig.deliver(now_ns, &mut self.inbox);
        }
        let waiting = &self.inbox[self.read..];
        let n = waiting.len().min(buffer.len());
        buffer[..n].copy_from_slice(&waiting[..n]);
        self.read += n;
        if self.read == self.inbox.len() {
            self.inbox.clear();
            self.read = 0;
        }
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        for call in self.calls.try_iter() {
            call(&mut self.rig);
        }
        let now_ns = self.time(now_ns);
        self.rig.receive(now_ns, bytes, &mut self.inbox);
        Ok(bytes.len())
    }

    fn pause(&mut self) {}
}
