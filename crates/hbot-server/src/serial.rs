//! Real serial lines: opened for this process alone, and opened anew where they vanish.
//!
//! The loop neither opens nor closes anything, because both may wait: a thread of the line's own does. Where the line fails, the
//! loop hands the dead port to that thread, which tries to open it again with growing pauses, switches the motors off, has
//! the controllers say who they are, and hands the line back. Torque comes back by nothing but reset and enable.

use std::fs;
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush, tcgetattr,
    tcsetattr,
};
use thiserror::Error;

use crate::handshake::{Expected, handshake, switch_off};
use crate::wire::{Renewed, Wire};

/// How long after a line was lost it is first looked for, and the longest pause between two looks.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// How often the thread looks whether there is something to do.
const LOOK: Duration = Duration::from_millis(20);
/// Stack of that thread, bytes.
const STACK: usize = 256 * 1024;
/// The time that an FTDI chip is asked to wait for more bytes, ms. Its own default of 16 is 16 ticks.
const LATENCY_MS: u32 = 1;

/// A serial port, or a pseudo-terminal that looks like one.
#[derive(Debug)]
pub struct Serial {
    /// `None` once the line is gone: it is not asked again, so a dead line costs the loop nothing.
    port: Option<OwnedFd>,
    reopening: Option<Reopening>,
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
        let opened = open(Path::new(port), baud);
        opened.map(|port| Self { port: Some(port), reopening: None }).map_err(|errno| OpenError {
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

    /// From now on, has the line opened anew where it vanishes, once the controllers on it are those `expected`.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn keep_open(&mut self, port: &str, baud: u32, expected: Expected) -> io::Result<()> {
        let (lost, to_reopen) = RingBuffer::new(1);
        let (into, back) = RingBuffer::new(1);
        let over = Arc::new(AtomicBool::new(false));
        let keeper = Keeper {
            path: port.into(),
            baud,
            expected,
            lost: to_reopen,
            back: into,
            over: Arc::clone(&over),
        };
        std::thread::Builder::new().name("hbot-port".to_owned()).stack_size(STACK).spawn(|| keeper.run())?;
        self.reopening = Some(Reopening { lost, back, over });
        Ok(())
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

impl Wire for Serial {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Some(port) = &self.port else { return Err(io::ErrorKind::BrokenPipe.into()) };
        let result = rustix::io::read(port, buffer);
        self.moved(result)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(port) = &self.port else { return Err(io::ErrorKind::BrokenPipe.into()) };
        let result = rustix::io::write(port, bytes);
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
}

/// The loop's end of a line that is kept open.
#[derive(Debug)]
struct Reopening {
    lost: Producer<OwnedFd>,
    back: Consumer<(OwnedFd, Renewed)>,
    over: Arc<AtomicBool>,
}

impl Drop for Reopening {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// The other end.
struct Keeper {
    path: PathBuf,
    baud: u32,
    expected: Expected,
    lost: Consumer<OwnedFd>,
    back: Producer<(OwnedFd, Renewed)>,
    over: Arc<AtomicBool>,
}

impl Keeper {
    fn run(mut self) {
        while !self.over.load(Ordering::Relaxed) {
            let Ok(port) = self.lost.pop() else {
                std::thread::sleep(LOOK);
                continue;
            };
            tracing::warn!(port = %self.path.display(), "the serial line is gone; looking for it");
            // Some drivers wait for bytes that nobody takes any more.
            drop(port);
            if let Some(found) = self.find() {
                tracing::warn!(port = %self.path.display(), rebooted = found.1.rebooted, "the serial line is back");
                // There is a place: the loop has none of its own.
                let _ = self.back.push(found);
            }
        }
    }

    /// Looks for the line until it is there, or nobody wants it any more.
    fn find(&self) -> Option<(OwnedFd, Renewed)> {
        let mut told = String::new();
        let mut rebooted = false;
        for pause in pauses() {
            for _ in 0..pause.as_millis() / LOOK.as_millis() {
                if self.over.load(Ordering::Relaxed) {
                    return None;
                }
                std::thread::sleep(LOOK);
            }
            match self.try_once(&mut rebooted) {
                Ok(port) => return Some((port, Renewed { rebooted })),
                Err(reason) if reason != told => {
                    tracing::warn!(port = %self.path.display(), reason, "not yet");
                    told = reason;
                }
                Err(_) => {}
            }
        }
        None
    }

    /// Notes in `rebooted` whether the controllers have lost power, even where the line is not to be had yet: they say so only until they
    /// are asked who they are, and the next try would not hear of it.
    fn try_once(&self, rebooted: &mut bool) -> Result<OwnedFd, String> {
        let port = open(&self.path, self.baud).map_err(|errno| errno.to_string())?;
        let mut wire = Serial { port: Some(port), reopening: None };
        // Off first.
        *rebooted |= switch_off(&mut wire, &self.expected).map_err(|error| error.to_string())?;
        handshake(&mut wire, &self.expected).map_err(|error| error.to_string())?;
        wire.port.ok_or_else(|| "gone again".to_owned())
    }
}

/// How long to wait before each look for a line that is lost, for ever.
fn pauses() -> impl Iterator<Item = Duration> {
    std::iter::successors(Some(FIRST_PAUSE), |pause| Some((2 * *pause).min(LONGEST_PAUSE)))
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

/// How long a USB serial chip waits for more bytes before it hands on what it has; FTDI's have such a timer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LatencyTimer {
    /// The file that sets it.
    pub path: PathBuf,
    /// What it says, ms.
    pub ms: u32,
}

impl LatencyTimer {
    /// The timer of the device behind `port`; `None` where its driver has none.
    #[must_use]
    pub fn of(port: &Path) -> Option<Self> {
        Self::listed(Path::new("/sys/class/tty"), port)
    }

    fn listed(devices: &Path, port: &Path) -> Option<Self> {
        let device = fs::canonicalize(port).ok()?;
        let path = devices.join(device.file_name()?).join("device/latency_timer");
        let ms = fs::read_to_string(&path).ok()?.trim().parse().ok()?;
        Some(Self { path, ms })
    }

    /// Sets it to the least. Where it may not be written it stays as it is, and `hbot doctor` says so.
    fn shorten(&self) {
        if self.ms > LATENCY_MS {
            let _ = fs::write(&self.path, LATENCY_MS.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::time::Instant;

    use hbot_config::RigConfig;
    use hbot_link::{Decoder, FromController, encode};
    use hbot_sim::rig::{RigConfig as SimulatedConfig, SimulatedRig};
    use serialport::{SerialPort as _, TTYPort};

    use super::*;
    use crate::engine::Line;

    #[test]
    fn a_lost_line_is_looked_for_with_growing_pauses() {
        let ms: Vec<_> = pauses().take(7).map(|pause| pause.as_millis()).collect();
        assert_eq!(ms, [100, 200, 400, 800, 1600, 2000, 2000]);
    }

    #[test]
    fn a_chip_that_holds_readings_back_is_asked_not_to() {
        let folder = tempfile::tempdir().unwrap();
        let (devices, port) = (folder.path().join("tty"), folder.path().join("ttyUSB7"));
        fs::create_dir_all(devices.join("ttyUSB7/device")).unwrap();
        fs::write(&port, "").unwrap();
        // By the name of the device, whatever link leads to it.
        let link = folder.path().join("hbot");
        std::os::unix::fs::symlink(&port, &link).unwrap();
        assert_eq!(LatencyTimer::listed(&devices, &link), None, "a driver that has none");
        let file = devices.join("ttyUSB7/device/latency_timer");
        for (was, is) in [("16\n", "1"), ("1\n", "1\n"), ("0\n", "0\n")] {
            fs::write(&file, was).unwrap();
            LatencyTimer::listed(&devices, &link).unwrap().shorten();
            assert_eq!(fs::read_to_string(&file).unwrap(), is, "from {was:?}");
        }
    }

    #[test]
    fn a_loss_of_power_is_not_forgotten_where_the_first_question_gets_no_answer() {
        let Ok((mut near, far)) = TTYPort::pair() else {
            println!("no pseudo-terminal on this machine: not tested here");
            return;
        };
        let path = far.name().unwrap();
        near.set_timeout(Duration::from_millis(5)).unwrap();
        let rig = RigConfig::prototype();
        let mut simulated = SimulatedRig::new(&SimulatedConfig::new(&rig.rig)).unwrap();
        let over = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&over);
        // Fresh from power-on, and what it says of itself is lost on the line until after the first try (1 s).
        let controllers = std::thread::spawn(move || {
            let _far = far;
            let (mut buffer, mut reply, mut decoder) =
                ([0; 4096], Vec::new(), Decoder::<FromController>::new());
            let (start, mut first) = (Instant::now(), None);
            while !stop.load(Ordering::Relaxed) {
                let Ok(n) = near.read(&mut buffer) else { continue };
                reply.clear();
                simulated.receive(start.elapsed().as_nanos() as u64, &buffer[..n], &mut reply);
                decoder.feed(&reply, |message| {
                    let Ok(message) = message else { return };
                    let described = matches!(message, FromController::Description(_));
                    if described
                        && first.get_or_insert_with(Instant::now).elapsed() < Duration::from_millis(1500)
                    {
                        return;
                    }
                    let mut frame = [0; 512];
                    let n = encode(&message, &mut frame).unwrap();
                    let _ = near.write(&frame[..n]);
                });
            }
        });
        let (_lost, to_reopen) = RingBuffer::new(1);
        let (back, _back) = RingBuffer::new(1);
        let expected = Expected::new(&path, &rig.rig, &Line::single(0..4, 20), 0);
        let over_too = Arc::clone(&over);
        let keeper = Keeper {
            path: path.into(),
            baud: rig.link.baud,
            expected,
            lost: to_reopen,
            back,
            over: over_too,
        };
        let (_, renewed) = keeper.find().unwrap();
        assert_eq!(renewed, Renewed { rebooted: true });
        over.store(true, Ordering::Relaxed);
        controllers.join().unwrap();
    }
}
