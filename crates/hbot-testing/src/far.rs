//! Simulated motor controllers at the far end of a pseudo-terminal. They record all commands that
//! they receive.

use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hbot_config::RigConfig;
use hbot_link::{Command, Decoder, ToController};
use rustix::fs::{Mode, OFlags};
use rustix::termios::ioctl_tiocnxcl;
use serialport::{SerialPort as _, TTYPort};

use crate::prototype::simulated_as;

/// Time without a new command after which the line counts as silent. It is long enough that delays
/// on a busy computer do not count as silence.
const SILENCE: Duration = Duration::from_millis(200);

/// Opens a terminal as a program does that changes none of its settings.
pub fn open_plainly(path: &str) -> OwnedFd {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    rustix::fs::open(path, flags, Mode::empty()).expect("a terminal")
}

/// A simulated rig at the far end of a pseudo-terminal. It records the commands that it receives,
/// so that a test can check them.
pub struct Far {
    /// Path of the pseudo-terminal that the program under test opens as its serial port.
    pub path: String,
    heard: Arc<Mutex<Vec<Command>>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Far {
    /// Starts simulated motor controllers for `rig` in a thread, at the far end of a new
    /// pseudo-terminal.
    pub fn start(rig: &RigConfig) -> Self {
        let (mut near, far) = TTYPort::pair().expect("this test needs pseudo-terminals (/dev/ptmx)");
        let path = far.name().expect("a name");
        near.set_timeout(Duration::from_millis(5)).expect("a port");
        let heard = Arc::new(Mutex::new(Vec::new()));
        let over = Arc::new(AtomicBool::new(false));
        let mut simulated = simulated_as(rig, |_| ());
        let (record, stop) = (Arc::clone(&heard), Arc::clone(&over));
        let port = open_plainly(&path);
        let thread = std::thread::spawn(move || {
            // Keeps the far end open as long as this thread runs. If it closed, reads at the near
            // end would fail.
            let _far = far;
            let mut decoder = Decoder::<ToController>::new();
            let (start, mut buffer, mut reply) = (Instant::now(), [0; 4096], Vec::new());
            while !stop.load(Ordering::Relaxed) {
                // This process has the port open, so the exclusive use of a server would outlast
                // that server. Only root could then start the next one on this port.
                ioctl_tiocnxcl(&port).expect("a terminal");
                let Ok(n) = near.read(&mut buffer) else { continue };
                decoder.feed(&buffer[..n], |message| {
                    if let Ok(ToController::Command(command)) = message {
                        record.lock().expect("no panic").push(command);
                    }
                });
                reply.clear();
                simulated.receive(start.elapsed().as_nanos() as u64, &buffer[..n], &mut reply);
                // A failed write is ignored: for the loop it is only a missed reading.
                let _ = near.write(&reply);
            }
        });
        Self { path, heard, over, thread: Some(thread) }
    }

    /// Returns the number of commands received so far.
    pub fn count(&self) -> usize {
        self.heard.lock().expect("no panic").len()
    }

    /// Returns whether `so` accepts any of the recorded commands, not counting the first `count` of
    /// them.
    pub fn any_after(&self, count: usize, so: impl Fn(&Command) -> bool) -> bool {
        self.heard.lock().expect("no panic")[count..].iter().any(so)
    }

    /// Returns whether any command received so far enables the motors with a torque other than
    /// zero.
    pub fn pushed(&self) -> bool {
        self.any_after(0, |command| command.enable && !still(command))
    }

    /// Waits until the line is silent. Then checks that each of the last three commands has zero
    /// torque and switches the motors off. Returns the last command.
    pub fn ends_still(mut self) -> Command {
        let mut before = 0;
        while self.count() > before {
            before = self.count();
            // Sleeps for a fixed time, because silence has no condition to wait for.
            std::thread::sleep(SILENCE);
        }
        self.over.store(true, Ordering::Relaxed);
        self.thread.take().expect("it runs").join().expect("no panic");
        let heard = self.heard.lock().expect("no panic");
        let last = &heard[heard.len() - 3..];
        assert!(last.iter().all(|command| !command.enable && still(command)), "{last:?}");
        last[2].clone()
    }
}

impl Drop for Far {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // If the thread panicked, its message is already printed.
            let _ = thread.join();
        }
    }
}

fn still(command: &Command) -> bool {
    command.torque.iter().all(|torque| *torque == 0.0)
}
