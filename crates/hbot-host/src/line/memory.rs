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

/// A line to a simulated rig that runs in the same process in virtual time. It needs no serial
/// port.
pub struct Memory {
    rig: SimulatedRig,
    calls: Receiver<SimulatorCall>,
    inbox: Vec<u8>,
    read: usize,
    /// Offset from the caller's time to the line's time, ns. It grows whenever the caller's time
    /// starts again from 0, as it does between the check of the motor controllers and the first
    /// tick.
    base_ns: u64,
    /// The time that the caller gave in its last call, ns.
    last_ns: u64,
}

impl Memory {
    /// Returns a line to `rig`. Functions that are sent through the channel `calls` are run on the
    /// rig before the next bytes are written.
    #[must_use]
    pub fn new(rig: SimulatedRig, calls: Receiver<SimulatorCall>) -> Self {
        Self { rig, calls, inbox: Vec::with_capacity(INBOX), read: 0, base_ns: 0, last_ns: 0 }
    }

    /// Converts the caller's time `now_ns` to the line's time, in ns. The caller's time can start
    /// again from 0; the line's time never goes back. For this, the function stores the caller's
    /// last time.
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
