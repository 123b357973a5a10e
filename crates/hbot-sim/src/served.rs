//! Serves a simulated rig from a separate thread, in wall time.
//!
//! The thread owns the rig and one end of the line. It answers as soon as bytes arrive and
//! simulates the plant in between. The line is a pseudo-terminal ([`crate::pty`]) or a pair of
//! sockets ([`crate::socket`]). To do anything else with the rig (set the hand, inject a fault,
//! read the true state), pass a closure, which the thread runs between two steps.

use std::any::Any;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::io::Errno;
use rustix::time::{ClockId, clock_gettime};

use crate::rig::SimulatedRig;

/// Longest time between two updates of the plant while no bytes arrive on the line.
pub(crate) const IDLE: Duration = Duration::from_millis(2);

/// Why a simulated rig could not be served, or is no longer served.
#[derive(Debug)]
pub enum ServeError {
    /// The machine provides no pseudo-terminal.
    NoPty(io::Error),
    /// The machine provides no pair of sockets.
    NoSocket(io::Error),
    /// The thread that serves the simulated rig could not be started.
    Thread(io::Error),
    /// The line failed while the thread served it.
    Line(io::Error),
    /// The thread has panicked, with this message.
    Panicked(String),
    /// The thread has ended.
    Stopped,
}

impl std::fmt::Display for ServeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoPty(error) => write!(
                f,
                "no pseudo-terminal for the simulated rig ({error}): /dev/ptmx and a mounted /dev/pts are needed; the port \
                 `sim` needs neither"
            ),
            Self::NoSocket(error) => write!(f, "no pair of sockets for the simulated rig: {error}"),
            Self::Thread(error) => write!(f, "the simulated rig's thread does not start: {error}"),
            Self::Line(error) => write!(f, "the simulated rig's line broke: {error}"),
            Self::Panicked(message) => write!(f, "the simulated rig's thread has panicked: {message}"),
            Self::Stopped => write!(f, "the simulated rig's thread has stopped"),
        }
    }
}

impl std::error::Error for ServeError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NoPty(error) | Self::NoSocket(error) | Self::Thread(error) | Self::Line(error) => {
                Some(error)
            }
            Self::Panicked(_) | Self::Stopped => None,
        }
    }
}

/// The rig's end of a line.
pub(crate) trait End: Send + 'static {
    /// Returns the descriptor that becomes readable when bytes arrive.
    fn descriptor(&self) -> BorrowedFd<'_>;

    /// Reads the bytes that have arrived into `buffer`, without waiting. Returns their number,
    /// which is 0 if there are none.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno>;

    /// Writes `bytes` in one call. If the line has no room because no program reads, the remaining
    /// bytes are lost.
    fn write(&mut self, bytes: &[u8]) -> Result<(), Errno>;

    /// Informs the line that the bytes of the last `read` have been simulated and answered.
    fn answered(&mut self) {}

    /// Informs the line that no bytes have arrived for a while.
    fn idle(&mut self) {}

    /// Returns the present time of the simulated rig, ns.
    fn now_ns(&mut self) -> u64 {
        monotonic_ns()
    }
}

enum Message {
    Call(Box<dyn FnOnce(&mut SimulatedRig) + Send>),
    Stop,
}

/// A simulated rig that a thread serves. Dropping this value stops the thread.
#[derive(Debug)]
pub struct ServedRig {
    messages: Sender<Message>,
    wake: Arc<OwnedFd>,
    /// Why the thread failed.
    failure: Arc<OnceLock<String>>,
    thread: Option<JoinHandle<Result<SimulatedRig, ServeError>>>,
}

/// Serves `rig` on the line of `end`, from a thread named `hbot-sim`, until the returned value is
/// stopped or dropped. The thread calls `on_start` first.
pub(crate) fn serve(
    rig: SimulatedRig,
    end: impl End,
    idle: Duration,
    on_start: Box<dyn FnOnce() + Send>,
) -> Result<ServedRig, ServeError> {
    let wake = eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)
        .map_err(|errno| ServeError::Thread(errno.into()))?;
    let wake = Arc::new(wake);
    let (messages, inbox) = channel();
    let server = Server { rig, end, wake: Arc::clone(&wake), inbox, idle };
    let failure = Arc::new(OnceLock::new());
    let failed = Arc::clone(&failure);
    let thread = std::thread::Builder::new()
        .name("hbot-sim".into())
        .spawn(move || {
            // The rig is not used after a panic.
            let served = catch_unwind(AssertUnwindSafe(|| {
                on_start();
                server.run()
            }));
            let served = served.unwrap_or_else(|panic| Err(ServeError::Panicked(message(&*panic))));
            // A line that ends is no failure: a loop that stops closes it.
            if let Err(error @ ServeError::Panicked(_)) = &served {
                // Nobody else sets it.
                let _ = failed.set(error.to_string());
            }
            served
        })
        .map_err(ServeError::Thread)?;
    Ok(ServedRig { messages, wake, failure, thread: Some(thread) })
}

/// Returns the message of a panic.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().map(str::to_owned);
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_owned())
}

impl ServedRig {
    /// Runs `call` on the rig between two steps and returns its result.
    ///
    /// # Errors
    /// Fails with [`ServeError::Stopped`] if the thread has ended. [`stop`](Self::stop) then
    /// returns the reason.
    pub fn call<R: Send + 'static>(
        &self,
        call: impl FnOnce(&mut SimulatedRig) -> R + Send + 'static,
    ) -> Result<R, ServeError> {
        let (result, answer): (SyncSender<R>, Receiver<R>) = sync_channel(1);
        self.post(move |rig| {
            // The caller can have stopped waiting.
            let _ = result.send(call(rig));
        })?;
        answer.recv().map_err(|_| ServeError::Stopped)
    }

    /// Runs `call` on the rig between two steps, without waiting for it.
    ///
    /// # Errors
    /// Fails with [`ServeError::Stopped`] if the thread has ended.
    pub fn post(&self, call: impl FnOnce(&mut SimulatedRig) + Send + 'static) -> Result<(), ServeError> {
        self.send(Message::Call(Box::new(call)))
    }

    /// Returns why the thread has failed: something in it panicked. Returns `None` while it runs,
    /// and after it was stopped or its line has ended.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Stops the thread and returns the rig in its last state.
    ///
    /// # Errors
    /// Fails with the error that ended the thread earlier, if any.
    pub fn stop(mut self) -> Result<SimulatedRig, ServeError> {
        self.join()
    }

    fn join(&mut self) -> Result<SimulatedRig, ServeError> {
        // A thread that has already ended does not receive this. Its result gives the reason.
        let _ = self.send(Message::Stop);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(ServeError::Stopped),
        }
    }

    fn send(&self, message: Message) -> Result<(), ServeError> {
        self.messages.send(message).map_err(|_| ServeError::Stopped)?;
        // The write fails only while 2^64 wake-ups are pending. The thread then wakes anyway.
        let _ = rustix::io::write(&self.wake, &1u64.to_ne_bytes());
        Ok(())
    }
}

impl Drop for ServedRig {
    fn drop(&mut self) {
        if self.thread.is_some() {
            // The error is dropped here. Call `stop` to get it.
            let _ = self.join();
        }
    }
}

struct Server<E> {
    rig: SimulatedRig,
    end: E,
    wake: Arc<OwnedFd>,
    inbox: Receiver<Message>,
    idle: Duration,
}

impl<E: End> Server<E> {
    fn run(mut self) -> Result<SimulatedRig, ServeError> {
        self.serve().map_err(|errno| ServeError::Line(errno.into()))?;
        Ok(self.rig)
    }

    fn serve(&mut self) -> Result<(), Errno> {
        let mut bytes = [0; 4096];
        let mut reply = Vec::with_capacity(16 * 1024);
        let mut hung_up = false;
        self.rig.set_clock(self.end.now_ns());
        loop {
            let woken = self.wait(&mut hung_up)?;
            let now_ns = self.end.now_ns();
            let count = self.end.read(&mut bytes)?;
            // Call it without bytes too: frames delayed by an impaired line can be due.
            self.rig.receive(now_ns, &bytes[..count], &mut reply);
            if !reply.is_empty() {
                self.end.write(&reply)?;
                reply.clear();
            }
            self.end.answered();
            if woken {
                let _ = rustix::io::read(&self.wake, &mut [0; 8]);
                for message in self.inbox.try_iter() {
                    match message {
                        Message::Call(call) => call(&mut self.rig),
                        Message::Stop => return Ok(()),
                    }
                }
            } else if count == 0 {
                self.end.idle();
            }
        }
    }

    /// Waits for bytes, a message, a delayed frame, or the next update of the plant. Returns
    /// whether a message is waiting.
    ///
    /// A line that is hung up would end every wait at once. Therefore, the first wait after a
    /// hang-up does not watch the line.
    fn wait(&mut self, hung_up: &mut bool) -> Result<bool, Errno> {
        let arrival = self.rig.next_arrival_ns();
        let idle = arrival.map_or(self.idle, |at_ns| {
            self.idle.min(Duration::from_nanos(at_ns.saturating_sub(self.end.now_ns())))
        });
        let mut fds = [
            PollFd::from_borrowed_fd(self.wake.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.end.descriptor(), PollFlags::IN),
        ];
        let watched = if *hung_up { 1 } else { 2 };
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

pub(crate) fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // The clock counts from boot and is never negative.
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}
