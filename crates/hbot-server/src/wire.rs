//! A serial line, real or simulated: bytes in, bytes out, never waiting.

use std::io::{self, Read as _, Write as _};
use std::sync::mpsc::Receiver;
use std::time::Duration;

use hbot_sim::rig::SimulatedRig;
use serialport::{SerialPort as _, TTYPort};
use thiserror::Error;

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
}

/// A serial port, or a pseudo-terminal that looks like one.
#[derive(Debug)]
pub struct Serial {
    port: TTYPort,
    /// Once the line is gone it is not asked again, so a dead line costs the loop nothing.
    gone: bool,
}

/// A port that does not open.
#[derive(Debug, Error)]
#[error("cannot open serial port {port}: {reason}\n{}", list(.available))]
pub struct OpenError {
    port: String,
    reason: String,
    available: Vec<String>,
}

fn list(available: &[String]) -> String {
    if available.is_empty() {
        "no serial port was found on this machine; `--port sim` runs without hardware".to_owned()
    } else {
        format!("ports on this machine: {}; `--port sim` runs without hardware", available.join(", "))
    }
}

impl Serial {
    /// Opens `port` at `baud`, 8N1, without flow control, and for this process alone.
    ///
    /// # Errors
    /// It is not there, is in use, or may not be opened; the error lists the ports that are there.
    pub fn open(port: &str, baud: u32) -> Result<Self, OpenError> {
        let opened = serialport::new(port, baud).timeout(Duration::ZERO).open_native();
        opened.map(|port| Self { port, gone: false }).map_err(|error| OpenError {
            port: port.to_owned(),
            reason: error.to_string(),
            available: serialport::available_ports()
                .map(|ports| ports.into_iter().map(|p| p.port_name).collect())
                .unwrap_or_default(),
        })
    }

    fn check<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        self.gone |= result.as_ref().is_err_and(|e| !would_block(e));
        result
    }
}

fn would_block(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

impl Wire for Serial {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.gone {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        // Asked first, because the port's read makes (and allocates) an error where there is nothing to read.
        let waiting = self.port.bytes_to_read().map_err(io::Error::from);
        match self.check(waiting)? {
            0 => Ok(0),
            _ => {
                let result = self.port.read(buffer);
                match self.check(result) {
                    Err(e) if would_block(&e) => Ok(0),
                    other => other,
                }
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.gone {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let result = self.port.write(bytes);
        match self.check(result) {
            Err(e) if would_block(&e) => Ok(0),
            other => other,
        }
    }
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
