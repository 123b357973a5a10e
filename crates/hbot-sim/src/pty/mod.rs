//! Serves a simulated rig over a pseudo-terminal, like a serial port, in wall time.
//!
//! A separate thread owns the rig and one end of the line. It answers as soon as bytes arrive and
//! simulates the plant in between. The other end is a path that a server opens like a real port. To
//! do anything else with the rig (set the hand, inject a fault, read the true state), pass a
//! closure, which the thread runs between two steps.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::io::Errno;
use rustix::time::{ClockId, clock_gettime};

use crate::rig::SimulatedRig;

mod line;

use line::Line;

/// Options of the thread that serves a simulated rig.
pub struct PtyOptions {
    /// Longest time between two updates of the plant while no bytes arrive on the line. The default
    /// is 2 ms.
    pub idle: Duration,
    /// Function that the thread calls when it starts, for example to set its scheduling priority.
    /// The default does nothing.
    pub on_start: Box<dyn FnOnce() + Send>,
}

impl Default for PtyOptions {
    fn default() -> Self {
        Self { idle: Duration::from_millis(2), on_start: Box::new(|| ()) }
    }
}

impl std::fmt::Debug for PtyOptions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PtyOptions").field("idle", &self.idle).finish_non_exhaustive()
    }
}

/// Why the pseudo-terminal of a simulated rig could not be opened, or has stopped.
#[derive(Debug)]
pub enum PtyError {
    /// The machine provides no pseudo-terminal.
    NoPty(io::Error),
    /// The thread that serves the simulated rig could not be started.
    Thread(io::Error),
    /// The pseudo-terminal failed while the thread served it.
    Line(io::Error),
    /// The thread has ended, or a closure that it ran has panicked.
    Stopped,
}

impl std::fmt::Display for PtyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoPty(error) => write!(
                f,
                "no pseudo-terminal for the simulated rig ({error}): /dev/ptmx and a mounted /dev/pts are needed; in \
                 virtual time the rig needs neither"
            ),
            Self::Thread(error) => write!(f, "the simulated rig's thread does not start: {error}"),
            Self::Line(error) => write!(f, "the simulated rig's pseudo-terminal broke: {error}"),
            Self::Stopped => write!(f, "the simulated rig's thread has stopped"),
        }
    }
}

impl std::error::Error for PtyError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NoPty(error) | Self::Thread(error) | Self::Line(error) => Some(error),
            Self::Stopped => None,
        }
    }
}

enum Message {
    Call(Box<dyn FnOnce(&mut SimulatedRig) + Send>),
    Stop,
}

/// A simulated rig behind a pseudo-terminal. Dropping this value stops its thread and removes the
/// port.
#[derive(Debug)]
pub struct PtyRig {
    path: PathBuf,
    messages: Sender<Message>,
    wake: Arc<OwnedFd>,
    thread: Option<JoinHandle<Result<SimulatedRig, PtyError>>>,
}

/// Serves `rig` on a new pseudo-terminal, from a thread named `hbot-sim`, until the returned
/// [`PtyRig`] is stopped or dropped.
///
/// # Errors
/// Fails if the machine provides no pseudo-terminal or the thread cannot be started.
pub fn spawn_pty(rig: SimulatedRig, options: PtyOptions) -> Result<PtyRig, PtyError> {
    let (line, path) = Line::open().map_err(|errno| PtyError::NoPty(errno.into()))?;
    serve(rig, line, path, options)
}

fn serve(rig: SimulatedRig, line: Line, path: PathBuf, options: PtyOptions) -> Result<PtyRig, PtyError> {
    let wake = eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)
        .map_err(|errno| PtyError::Thread(errno.into()))?;
    let wake = Arc::new(wake);
    let (messages, inbox) = channel();
    let server = Server { rig, line, wake: Arc::clone(&wake), inbox, idle: options.idle };
    let thread = std::thread::Builder::new()
        .name("hbot-sim".into())
        .spawn(move || {
            (options.on_start)();
            server.run()
        })
        .map_err(PtyError::Thread)?;
    Ok(PtyRig { path, messages, wake, thread: Some(thread) })
}

impl PtyRig {
    /// Returns the path of the port to open, such as `/dev/pts/3`. The port can be closed and
    /// opened again.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Runs `call` on the rig between two steps and returns its result.
    ///
    /// # Errors
    /// Fails with [`PtyError::Stopped`] if the thread has ended. [`stop`](Self::stop) then returns
    /// the reason.
    pub fn call<R: Send + 'static>(
        &self,
        call: impl FnOnce(&mut SimulatedRig) -> R + Send + 'static,
    ) -> Result<R, PtyError> {
        let (result, answer): (SyncSender<R>, Receiver<R>) = sync_channel(1);
        self.post(move |rig| {
            // The caller can have stopped waiting.
            let _ = result.send(call(rig));
        })?;
        answer.recv().map_err(|_| PtyError::Stopped)
    }

    /// Runs `call` on the rig between two steps, without waiting for it.
    ///
    /// # Errors
    /// Fails with [`PtyError::Stopped`] if the thread has ended.
    pub fn post(&self, call: impl FnOnce(&mut SimulatedRig) + Send + 'static) -> Result<(), PtyError> {
        self.send(Message::Call(Box::new(call)))
    }

    /// Returns whether the thread is still serving the line.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Stops the thread and returns the rig in its last state.
    ///
    /// # Errors
    /// Fails with the error that ended the thread earlier, if any.
    pub fn stop(mut self) -> Result<SimulatedRig, PtyError> {
        self.join()
    }

    fn join(&mut self) -> Result<SimulatedRig, PtyError> {
        // A thread that has already ended does not receive this. Its result gives the reason.
        let _ = self.send(Message::Stop);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(PtyError::Stopped),
        }
    }

    fn send(&self, message: Message) -> Result<(), PtyError> {
        self.messages.send(message).map_err(|_| PtyError::Stopped)?;
        // The write fails only while 2^64 wake-ups are pending. The thread then wakes anyway.
        let _ = rustix::io::write(&self.wake, &1u64.to_ne_bytes());
        Ok(())
    }
}

impl Drop for PtyRig {
    fn drop(&mut self) {
        if self.thread.is_some() {
            // The error is dropped here. Call `stop` to get it.
            let _ = self.join();
        }
    }
}

struct Server {
    rig: SimulatedRig,
    line: Line,
    wake: Arc<OwnedFd>,
    inbox: Receiver<Message>,
    idle: Duration,
}

impl Server {
    fn run(mut self) -> Result<SimulatedRig, PtyError> {
        self.serve().map_err(|errno| PtyError::Line(errno.into()))?;
        Ok(self.rig)
    }

    fn serve(&mut self) -> Result<(), Errno> {
        let mut bytes = [0; 4096];
        let mut reply = Vec::with_capacity(16 * 1024);
        let mut hung_up = false;
        self.rig.set_clock(monotonic_ns());
        loop {
            let woken = self.wait(&mut hung_up)?;
            let now_ns = monotonic_ns();
            let count = self.line.read(&mut bytes)?;
            // Call it without bytes too: frames delayed by an impaired line can be due.
            self.rig.receive(now_ns, &bytes[..count], &mut reply);
            if !reply.is_empty() {
                self.line.write(&reply)?;
                reply.clear();
            }
            if woken {
                let _ = rustix::io::read(&self.wake, &mut [0; 8]);
                for message in self.inbox.try_iter() {
                    match message {
                        Message::Call(call) => call(&mut self.rig),
                        Message::Stop => return Ok(()),
                    }
                }
            } else if count == 0 {
                self.line.unbar();
            }
        }
    }

    /// Waits for bytes, a message, a delayed frame, or the next update of the plant. Returns
    /// whether a message is waiting.
    ///
    /// A line that is hung up would end every wait at once. Therefore, the first wait after a
    /// hang-up does not watch the line.
    fn wait(&self, hung_up: &mut bool) -> Result<bool, Errno> {
        let mut fds = [
            PollFd::from_borrowed_fd(self.wake.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.line.near.as_fd(), PollFlags::IN),
        ];
        let watched = if *hung_up { 1 } else { 2 };
        let arrival = self.rig.next_arrival_ns();
        let idle = arrival.map_or(self.idle, |at_ns| {
            self.idle.min(Duration::from_nanos(at_ns.saturating_sub(monotonic_ns())))
        });
        let timeout = Timespec::try_from(idle).unwrap_or(Timespec { tv_sec: 1, tv_nsec: 0 });
        match poll(&mut fds[..watched], Some(&timeout)) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(errno) => return Err(errno),
        }
        let line = fds[1].revents();
        *hung_up = watched == 2 && line.contains(PollFlags::HUP) && !line.contains(PollFlags::IN);
        Ok(fds[0].revents().contains(PollFlags::IN))
    }
}

fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // The clock counts from boot and is never negative.
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::SimulatedConfig;
    use hbot_testing::patience::eventually;
    use rustix::fs::{Mode, OFlags};

    // Not that of hbot-testing, whose simulated rig is of the library that this test replaces.
    fn rig() -> SimulatedRig {
        SimulatedRig::new(&SimulatedConfig::new(&hbot_config::RigConfig::prototype().rig)).unwrap()
    }

    /// A rig is served again after its line hangs up, which happens here whenever no program has
    /// the port open. While the line is hung up, the thread neither ends nor spins.
    #[test]
    fn a_line_that_hangs_up_is_served_again() {
        let (mut line, path) = Line::open().unwrap();
        line.far = rustix::fs::open("/dev/null", OFlags::RDWR, Mode::empty()).unwrap();
        let rig = serve(rig(), line, path, PtyOptions::default()).unwrap();
        for opened in 0..3 {
            let busy = || rig.call(|_| clock_gettime(ClockId::ThreadCPUTime)).unwrap();
            let before = busy();
            // What is measured is the processor time of a while in which nothing happens.
            std::thread::sleep(Duration::from_millis(100));
            let spent = busy() - before;
            assert!(spent.tv_sec == 0 && spent.tv_nsec < 50_000_000, "{spent:?} of 100 ms");

            let far = rustix::fs::open(rig.path(), OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
            // Two zeros and a byte: an empty frame, and a frame that is refused.
            rustix::io::write(&far, &[0, 1, 0]).unwrap();
            eventually("a frame is refused", || rig.call(|rig| rig.refused_frames()).unwrap() > opened);
        }
        rig.stop().unwrap();
    }
}
