//! The simulated rig in memory, in virtual time: the same bytes without a terminal.

use std::io;
use std::sync::mpsc::Receiver;

use hbot_sim::rig::SimulatedRig;

use super::Line;

/// Something to do with the simulated rig between two ticks.
pub type SimulatorCall = Box<dyn FnOnce(&mut SimulatedRig) + Send>;

/// Room for everything that an impaired line may bring at once, bytes, so that the loop never
/// allocates more.
const INBOX: usize = 256 * 1024;

/// A line to a simulated rig in memory.
pub struct Memory {
    rig: SimulatedRig,
    calls: Receiver<SimulatorCall>,
    inbox: Vec<u8>,
    read: usize,
}

impl Memory {
    /// A line to `rig`; `calls` are done before the next bytes are written.
    #[must_use]
    pub fn new(rig: SimulatedRig, calls: Receiver<SimulatorCall>) -> Self {
        Self { rig, calls, inbox: Vec::with_capacity(INBOX), read: 0 }
    }
}

impl Line for Memory {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        // What an impaired line has held back until some time before this tick.
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
        self.rig.receive(now_ns, bytes, &mut self.inbox);
        Ok(bytes.len())
    }
}
