//! A serial line as the loop sees it: bytes in, bytes out, never waiting. Real ones are in [`serial`](crate::serial).

use std::io;
use std::sync::mpsc::Receiver;

use hbot_sim::rig::SimulatedRig;

/// Bytes to and from the motor controllers.
pub trait Wire: Send {
    /// Reads what has arrived, 0 where nothing has. Never waits.
    ///
    /// # Errors
    /// The line is gone.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes a whole frame, or as much as fits. Never waits.
    ///
    /// # Errors
    /// The line is gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Tells a simulated line what time it is, ns; a real one knows.
    fn set_time(&mut self, _now_ns: u64) {}

    /// Whether the line was gone and is there again since this was asked last. Never waits.
    fn renewed(&mut self) -> Option<Renewed> {
        None
    }

    /// Tells the line that its motors are off and that nothing more is written. May wait.
    fn all_said(&mut self) {}
}

impl Wire for Box<dyn Wire> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.as_mut().read(buffer)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.as_mut().write(bytes)
    }

    fn set_time(&mut self, now_ns: u64) {
        self.as_mut().set_time(now_ns);
    }

    fn renewed(&mut self) -> Option<Renewed> {
        self.as_mut().renewed()
    }

    fn all_said(&mut self) {
        self.as_mut().all_said();
    }
}

/// A line that was gone is there again, and the controllers on it are those of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Renewed {
    /// They have lost power meanwhile: their zeros are not those of before.
    pub rebooted: bool,
}

/// Something to do with the simulated rig between two ticks.
pub type SimulatorCall = Box<dyn FnOnce(&mut SimulatedRig) + Send>;

/// Room for all that an impaired line may bring at once, so that the loop never makes more.
const INBOX: usize = 256 * 1024;

/// The simulated rig in memory, in virtual time: the same bytes without a terminal.
pub struct Memory {
    rig: SimulatedRig,
    calls: Receiver<SimulatorCall>,
    now_ns: u64,
    inbox: Vec<u8>,
    read: usize,
}

impl Memory {
    /// A line to `rig`, at time 0; `calls` are done before what is written next.
    #[must_use]
    pub fn new(rig: SimulatedRig, calls: Receiver<SimulatorCall>) -> Self {
        Self { rig, calls, now_ns: 0, inbox: Vec::with_capacity(INBOX), read: 0 }
    }
}

impl Wire for Memory {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // What an impaired line has held back until some time before this tick.
        if self.rig.next_arrival_ns().is_some_and(|at_ns| at_ns < self.now_ns) {
            self.rig.deliver(self.now_ns, &mut self.inbox);
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

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for call in self.calls.try_iter() {
            call(&mut self.rig);
        }
        self.rig.receive(self.now_ns, bytes, &mut self.inbox);
        Ok(bytes.len())
    }

    fn set_time(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }
}
