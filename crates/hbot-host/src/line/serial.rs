//! Real serial lines: opened for this process alone, and opened anew where they vanish.
//!
//! The loop neither opens nor closes anything, because both may wait: a thread of the line's own does. Where the line fails, the
//! loop hands the dead port to that thread, which tries to open it again with growing pauses, switches the motors off, has
//! the controllers say who they are, and hands the line back. Torque comes back by nothing but reset and enable.

mod keeper;
mod latency;

use std::fmt::Display;
use std::io;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush, tcgetattr,
    tcsetattr,
};
use thiserror::Error;

use self::keeper::{Kept, Reopening};
pub use self::latency::LatencyTimer;
use crate::bus::{Expected, Protocol};
use crate::last_word::{LastWord, Program, Watched};
use crate::line::{Line, Renewed};

/// How often the thread looks whether there is something to do.
const LOOK: Duration = Duration::from_millis(20);
/// How long a port that another program has open is tried again. The helper of a server that was killed has it open until it has said
/// the last word.
const PATIENCE: Duration = Duration::from_millis(500);

/// A serial port, or a pseudo-terminal that looks like one.
#[derive(Debug)]
pub struct Serial {
    /// `None` once the line is gone: it is not asked again, so a dead line costs the loop nothing.
    port: Option<Held>,
    reopening: Option<Reopening>,
}

/// An open line.
#[derive(Debug)]
struct Held {
    line: OwnedFd,
    /// Switches its motors off if this process cannot.
    last_word: Option<LastWord>,
}

/// Who must be on a line, and what they speak.
#[derive(Debug, Clone)]
pub struct Peer {
    /// What they speak.
    pub protocol: &'static dyn Protocol,
    /// Who they are.
    pub expected: Expected,
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
        let opened = open_patiently(Path::new(port), baud);
        opened.map(Self::of).map_err(|errno| OpenError {
            port: port.to_owned(),
            reason: match errno {
                Errno::ACCESS => format!("{errno} (`hbot doctor` says how to get the right)"),
                Errno::BUSY | Errno::AGAIN => "another program has it open".to_owned(),
                _ => errno.to_string(),
            },
            available: serialport::available_ports()
                .map(|ports| ports.into_iter().map(|p| p.port_name).collect())
                .unwrap_or_default(),
        })
    }

    fn of(line: OwnedFd) -> Self {
        Self { port: Some(Held { line, last_word: None }), reopening: None }
    }

    /// From now on, a helper process writes `off`, the bytes that switch the motors off, if this
    /// process dies.
    ///
    /// # Errors
    /// The helper does not start.
    pub fn guard(&mut self, helper: &Program, off: &[u8]) -> io::Result<()> {
        let Some(port) = &mut self.port else { return Err(io::ErrorKind::BrokenPipe.into()) };
        port.last_word = Some(LastWord::start(helper, &port.line, off)?);
        Ok(())
    }

    /// From now on, has the line opened anew where it vanishes, once its
    /// `peer` is on it again, and guarded anew by `helper`.
    ///
    /// # Errors
    /// The system gives no thread.
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

    /// Takes what a system call says of the line: none of the bytes moved where it would have to wait.
    fn moved(&mut self, result: Result<usize, Errno>) -> io::Result<usize> {
        match result {
            Ok(n) => Ok(n),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(errno) => {
                if let (Some(port), Some(reopening)) = (self.port.take(), &mut self.reopening) {
                    // There is a place for the one port that there is.
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

/// What there is to know where [`Serial::guard`] fails.
#[must_use]
pub fn unguarded(port: &impl Display, error: &io::Error) -> String {
    format!(
        "{port}: no helper process ({error}): if this program is killed or aborts, motors stop by their controllers' watchdog alone"
    )
}

/// As [`open`], for a while again where another program has the port open.
fn open_patiently(path: &Path, baud: u32) -> Result<OwnedFd, Errno> {
    let until = Instant::now() + PATIENCE;
    loop {
        match open(path, baud) {
            Err(Errno::BUSY | Errno::AGAIN) if Instant::now() < until => std::thread::sleep(LOOK),
            result => return result,
        }
    }
}

/// Opens a port: raw, 8N1, no flow control, never waiting, barred for others, with as little delay as its driver lets it have.
fn open(path: &Path, baud: u32) -> Result<OwnedFd, Errno> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let port = rustix::fs::open(path, flags, Mode::empty())?;
    ioctl_tiocexcl(&port)?;
    if let Err(errno) = flock(&port, FlockOperation::NonBlockingLockExclusive) {
        // The other one barred it before us; what we have barred would stay so.
        let _ = ioctl_tiocnxcl(&port);
        return Err(errno);
    }
    let mut settings = tcgetattr(&port)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL | ControlModes::CS8;
    settings.control_modes -= ControlModes::CSTOPB | ControlModes::PARENB | ControlModes::CRTSCTS;
    settings.set_speed(baud)?;
    tcsetattr(&port, OptionalActions::Now, &settings)?;
    tcflush(&port, QueueSelector::IOFlush)?;
    if let Some(timer) = LatencyTimer::of(path) {
        timer.shorten();
    }
    Ok(port)
}
