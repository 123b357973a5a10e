//! Real serial lines: opened for this process alone, and reopened if they are lost.
//!
//! The loop neither opens nor closes a port, because both can wait. Each line has a thread for
//! this. If the line fails, the loop hands the dead port to that thread. The thread opens the port
//! again, with growing pauses between its attempts. It then switches the motors off, checks that
//! the controllers are those of the rig, and hands the line back. Torque returns only after a reset
//! and an enable.

mod keeper;
mod latency;
#[cfg(test)]
mod tests;

use std::fmt::Display;
use std::io::{self, ErrorKind};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{isatty, tcgetsid};
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort as _, StopBits, TTYPort};
use thiserror::Error;

use self::keeper::{Kept, Reopening};
pub use self::latency::LatencyTimer;
use crate::bus::{Expected, Protocol};
use crate::line::{Line, Renewed};
use crate::rig::last_word::{LastWord, Program, Watched};

/// How often the thread that reopens a line checks whether the line is lost.
const LOOK: Duration = Duration::from_millis(20);
/// How long opening a port is retried while another program has it open. After a server was killed,
/// its helper process keeps the port open until it has sent the command that switches the motors
/// off.
const PATIENCE: Duration = Duration::from_millis(500);

/// A serial port, or a pseudo-terminal that behaves like one.
#[derive(Debug)]
pub struct Serial {
    /// The open port, or `None` after the line was lost. A lost line therefore costs the control
    /// loop no system calls.
    port: Option<Held>,
    reopening: Option<Reopening>,
}

/// An open serial port with its helper process.
#[derive(Debug)]
struct Held {
    /// Helper process that switches the motors off if this process dies. The first field, because
    /// it has to end before the exclusive use of the port does.
    last_word: Option<LastWord>,
    /// What the loop reads and writes. Its calls return at once.
    line: OwnedFd,
    /// The port with its settings and its exclusive use, or `None` for a pair of sockets. It is not
    /// read or written: its handle is one that waits, in `write` for room for all bytes, and every
    /// call of it costs a second system call.
    _port: Option<TTYPort>,
}

/// The motor controllers that must be on a line, and their protocol.
#[derive(Debug, Clone)]
pub struct Peer {
    /// Protocol that the controllers use.
    pub protocol: &'static dyn Protocol,
    /// Controllers that the rig file expects.
    pub expected: Expected,
}

/// The error for a serial port that cannot be opened. Its message lists the ports of this machine.
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
    /// Opens `port` at `baud` for this process alone: 8 data bits, no parity, 1 stop bit, no flow
    /// control.
    ///
    /// # Errors
    /// Fails if the port does not exist, is in use, or must not be opened by this user. The error
    /// lists the ports of this machine.
    pub fn open(port: &str, baud: u32) -> Result<Self, OpenError> {
        let opened = open_patiently(Path::new(port), baud);
        opened.map(Self::holding).map_err(|error| OpenError {
            port: port.to_owned(),
            reason: match error.kind() {
                ErrorKind::PermissionDenied => format!("{error} (`hbot doctor` says how to get the right)"),
                ErrorKind::ResourceBusy => "another program has it open".to_owned(),
                ErrorKind::NotFound => "it does not exist".to_owned(),
                _ => error.to_string(),
            },
            available: serialport::available_ports()
                .map(|ports| ports.into_iter().map(|p| p.port_name).collect())
                .unwrap_or_default(),
        })
    }

    /// Returns the line of a descriptor that is already open and whose reads and writes return at
    /// once.
    pub(super) fn of(line: OwnedFd) -> Self {
        Self::holding(Held { last_word: None, line, _port: None })
    }

    fn holding(port: Held) -> Self {
        Self { port: Some(port), reopening: None }
    }

    /// Starts a helper process. If this process dies, the helper writes the bytes `off` to the
    /// port, which switch the motors off.
    ///
    /// # Errors
    /// Fails if the helper does not start, or if the line is lost.
    pub fn guard(&mut self, helper: &Program, off: &[u8]) -> io::Result<()> {
        let Some(port) = &mut self.port else { return Err(io::ErrorKind::BrokenPipe.into()) };
        port.last_word = Some(LastWord::start(helper, &port.line, off)?);
        Ok(())
    }

    /// Starts a thread that reopens the line whenever it is lost. The thread accepts a reopened
    /// line only if the motor controllers that `peer` lists answer on it. It then starts a new
    /// helper process with the program `helper`.
    ///
    /// # Errors
    /// Fails if the system cannot start a thread.
    pub fn keep_open(
        &mut self,
        port: &str,
        baud: u32,
        peer: Peer,
        helper: Option<Program>,
    ) -> io::Result<()> {
        let kept = Kept { path: port.into(), baud, peer, helper };
        self.reopening = Some(keeper::keep(kept, self.watched())?);
        Ok(())
    }

    fn watched(&self) -> Option<Watched> {
        self.port.as_ref()?.last_word.as_ref().map(LastWord::watched)
    }

    /// Returns the number of bytes that a read or write moved. If the call would have had to wait,
    /// this is 0. After any other error, the port is given to the thread that reopens the line.
    fn moved(&mut self, result: Result<usize, Errno>) -> io::Result<usize> {
        match result {
            Ok(n) => Ok(n),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(errno) => {
                if let (Some(port), Some(reopening)) = (self.port.take(), &mut self.reopening) {
                    // This cannot fail: the ring has one place, and there is only one port.
                    let _ = reopening.lost.push(port);
                }
                Err(errno.into())
            }
        }
    }
}

impl Line for Serial {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let Some(port) = &self.port else { return Err(io::ErrorKind::BrokenPipe.into()) };
        let result = rustix::io::read(&port.line, buffer);
        self.moved(result)
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        let Some(port) = &self.port else { return Err(io::ErrorKind::BrokenPipe.into()) };
        let result = rustix::io::write(&port.line, bytes);
        self.moved(result)
    }

    fn renewed(&mut self) -> Option<Renewed> {
        if self.port.is_some() {
            return None;
        }
        let (port, renewed) = self.reopening.as_mut()?.back.pop().ok()?;
        self.port = Some(port);
        Some(renewed)
    }

    fn release(&mut self) {
        if let Some(last_word) = self.port.as_mut().and_then(|port| port.last_word.as_mut()) {
            last_word.all_said();
        }
    }
}

/// Returns the notice that tells the user that [`Serial::guard`] could not start a helper process
/// for `port`.
#[must_use]
pub fn unguarded(port: &impl Display, error: &io::Error) -> String {
    format!(
        "{port}: no helper process ({error}): if this program is killed or aborts, motors stop by their controllers' watchdog alone"
    )
}

/// Opens a port as [`open`] does. If another program has it open, retries for the time
/// [`PATIENCE`].
fn open_patiently(path: &Path, baud: u32) -> io::Result<Held> {
    let until = Instant::now() + PATIENCE;
    loop {
        match open(path, baud) {
            Err(error) if error.kind() == ErrorKind::ResourceBusy && Instant::now() < until => {
                std::thread::sleep(LOOK);
            }
            result => return result,
        }
    }
}

/// Opens a port in raw mode: 8 data bits, no parity, 1 stop bit, no flow control, for this program
/// alone, and with the shortest latency that its driver allows. The loop's descriptor of it does
/// not wait. An error of the kind [`ErrorKind::ResourceBusy`] says that another program has the
/// port.
fn open(path: &Path, baud: u32) -> io::Result<Held> {
    // Opened first, because nobody can open the port after `TTYPort` has it exclusively.
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let line = rustix::fs::open(path, flags, Mode::empty())?;
    if !isatty(&line) {
        return Err(io::Error::other("it is no serial port"));
    }
    // Only the terminal that controls this process tells its session. To change its settings would
    // leave the user's shell unusable, or stop this process if it runs in the background.
    if tcgetsid(&line).is_ok() {
        return Err(io::Error::other("it is the terminal of this command; name the port of the controllers"));
    }
    let port = serialport::new(path.to_string_lossy(), baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .exclusive(true);
    let port = TTYPort::open(&port).map_err(|error| match error.kind() {
        // The device is there, since it was opened above: another program has locked it.
        serialport::ErrorKind::NoDevice => Errno::BUSY.into(),
        _ => io::Error::from(error),
    })?;
    port.clear(ClearBuffer::All)?;
    if let Some(timer) = LatencyTimer::of(path) {
        timer.shorten();
    }
    Ok(Held { last_word: None, line, _port: Some(port) })
}
