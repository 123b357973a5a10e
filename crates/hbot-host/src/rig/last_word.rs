//! The last word of a process that can no longer write it, because it aborts, runs out of memory,
//! or is killed by SIGKILL while motors are on.
//!
//! For each serial line the server starts this program a second time as a *helper*. The helper gets
//! a duplicate of the line's file descriptor and, through a pipe, the frame that switches the
//! motors off. It then sleeps until something happens on the pipe:
//!
//! - One byte arrives: the server has switched the motors off itself. The helper ends.
//! - The pipe is closed: the server is gone, and the system has closed its end. The helper writes
//!   the frame `TIMES` times and ends.
//!
//! The helper runs in a separate process group and ignores the signals of a terminal or a service
//! manager. The loop spends no time on it.

#[cfg(test)]
mod tests;

use std::io::{self, Read, Write as _};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::run_loop::realtime::{LOOP_PRIORITY, lock_memory, real_time};
use crate::run_loop::signals;

/// How many times the frame that switches the motors off is written, in case one is damaged on the
/// line.
const TIMES: u32 = 3;
/// Pause between two repetitions of the frame that switches the motors off.
const PAUSE: Duration = Duration::from_millis(3);
/// How long the helper tries to write one frame to a line that accepts no bytes.
const ROOM: Duration = Duration::from_millis(100);
/// Longest time that a helper process can take to start.
const START: Duration = Duration::from_secs(5);
/// Longest time that a helper process can take to end before it is killed.
const END: Duration = Duration::from_secs(1);
/// Byte that the server sends to a helper process when the motors are off.
const ALL_SAID: u8 = 1;
/// Byte that a helper process sends to the server when it is ready.
const READY: u8 = 2;

/// The command that starts this program as a helper process, which switches the motors off if the
/// server dies.
#[derive(Debug, Clone)]
pub struct Program {
    path: PathBuf,
    arguments: Vec<String>,
}

impl Program {
    /// Returns the command that starts the running program again with `argument`. With this
    /// argument the program must call [`run`]. The command works even if the program's file has
    /// been replaced or removed.
    #[must_use]
    pub fn this(argument: &str) -> Self {
        Self { path: "/proc/self/exe".into(), arguments: vec![argument.to_owned()] }
    }

    #[cfg(test)]
    pub(crate) fn shell(script: &str) -> Self {
        Self { path: "/bin/sh".into(), arguments: vec!["-c".to_owned(), script.to_owned()] }
    }
}

/// The helper process of one serial line. It switches the motors off if this process dies.
#[derive(Debug)]
pub struct LastWord {
    /// The pipe to the helper. It is `None` after the helper was ordered to end.
    pipe: Option<ChildStdin>,
    helper: Arc<Mutex<Helper>>,
}

#[derive(Debug)]
struct Helper {
    child: Child,
    /// True after the helper was ordered to end.
    dismissed: bool,
}

impl LastWord {
    /// Starts a helper and waits until it is ready. The helper writes `frame` to `line` if this
    /// process ends without calling [`all_said`](Self::all_said).
    ///
    /// # Errors
    /// Fails if the program does not start, or does not behave as a helper.
    pub fn start(program: &Program, line: impl AsFd, frame: &[u8]) -> io::Result<Self> {
        let mut child = Command::new(&program.path)
            .arg0("hbot")
            .args(&program.arguments)
            .process_group(0)
            .stdin(Stdio::piped())
            .stdout(line.as_fd().try_clone_to_owned()?)
            .stderr(Stdio::piped())
            .spawn()?;
        let (pipe, answer) = (child.stdin.take(), child.stderr.take());
        // From here on, every error must end the helper.
        let mut this = Self { pipe, helper: Arc::new(Mutex::new(Helper { child, dismissed: false })) };
        let told = this.tell(frame).and_then(|()| match answer {
            Some(answer) => ready(answer),
            None => Err(io::ErrorKind::BrokenPipe.into()),
        });
        if let Err(error) = told {
            this.kill();
            return Err(error);
        }
        Ok(this)
    }

    fn tell(&mut self, frame: &[u8]) -> io::Result<()> {
        let length = u8::try_from(frame.len()).map_err(io::Error::other)?;
        let Some(pipe) = &mut self.pipe else { return Err(io::ErrorKind::BrokenPipe.into()) };
        pipe.write_all(&[length])?;
        pipe.write_all(frame)
    }

    /// Orders the helper to end without writing to the line, because the motors are off or the line
    /// is lost. Waits until the helper has ended.
    pub fn all_said(&mut self) {
        let Some(mut pipe) = self.pipe.take() else { return };
        held(&self.helper).dismissed = true;
        // The write fails if the helper has already ended, which does no harm.
        let _ = pipe.write_all(&[ALL_SAID]);
        drop(pipe);
        self.wait();
    }

    /// Returns a handle that can check whether the helper is still running.
    #[must_use]
    pub(crate) fn watched(&self) -> Watched {
        Watched(Arc::clone(&self.helper))
    }

    /// Waits until the helper has ended, so that it neither keeps the line open nor remains as a
    /// zombie process. Kills it if it does not end in time.
    fn wait(&self) {
        let until = Instant::now() + END;
        while matches!(held(&self.helper).child.try_wait(), Ok(None)) {
            if Instant::now() > until {
                return self.kill();
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn kill(&self) {
        let mut helper = held(&self.helper);
        helper.dismissed = true;
        // Both calls fail only if the helper has already ended.
        let _ = helper.child.kill();
        let _ = helper.child.wait();
    }
}

/// Closes the pipe to the helper, so that it switches the motors off unless it was ordered to end.
impl Drop for LastWord {
    fn drop(&mut self) {
        held(&self.helper).dismissed = true;
        drop(self.pipe.take());
        self.wait();
    }
}

/// A handle to check whether a helper is still running.
#[derive(Debug)]
pub(crate) struct Watched(Arc<Mutex<Helper>>);

impl Watched {
    /// Returns whether the helper has ended although it was not ordered to.
    pub(crate) fn is_lost(&self) -> bool {
        let mut helper = held(&self.0);
        !helper.dismissed && matches!(helper.child.try_wait(), Ok(Some(_)))
    }
}

fn held(helper: &Mutex<Helper>) -> MutexGuard<'_, Helper> {
    helper.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits until a helper reports that it is ready.
fn ready(mut answer: impl AsFd + Read) -> io::Result<()> {
    let mut byte = [0];
    if !wait_for(&answer, PollFlags::IN, START)? || answer.read(&mut byte)? == 0 || byte != [READY] {
        return Err(io::Error::other("the program does not answer as it should"));
    }
    Ok(())
}

/// Waits until a file descriptor is ready for `what`. Returns `false` if it is not ready within
/// `most`.
fn wait_for(descriptor: &impl AsFd, what: PollFlags, most: Duration) -> io::Result<bool> {
    let until = Instant::now() + most;
    loop {
        let left = until.saturating_duration_since(Instant::now());
        let left = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: left.subsec_nanos().into() };
        match poll(&mut [PollFd::new(descriptor, what)], Some(&left)) {
            Err(Errno::INTR) => {}
            result => return Ok(result? > 0),
        }
    }
}

/// Prevents a core file if this process crashes. The system writes a core file before it closes the
/// pipe to the helper, and this takes longer than a motor controller's watchdog. The limit is one
/// byte, not zero: the kernel then also skips core dumps that it would pipe to a program (core(5)).
pub(crate) fn without_core_file() {
    let maximum = getrlimit(Resource::Core).maximum;
    // If the system refuses, the last word is only written later.
    let _ =
        setrlimit(Resource::Core, Rlimit { current: Some(maximum.map_or(1, |most| most.min(1))), maximum });
}

/// Runs this program as a helper: it waits until the server ends, and then switches the motors off
/// if the server has not done so. `frames` is the pipe from the server, `line` is the serial line,
/// and `answer` is where the helper reports that it is ready.
///
/// # Errors
/// Fails if the pipe delivers no complete frame, or if the line is lost.
pub fn run(frames: impl Read, line: impl AsFd, answer: impl io::Write) -> io::Result<()> {
    signals::ignore()?;
    // If the system refuses these, it also refused the server, which has reported it.
    let _ = real_time(LOOP_PRIORITY);
    let _ = lock_memory();
    // A failure only leaves the process without a clear name.
    let _ = rustix::thread::set_name(c"hbot-last-word");
    serve(frames, &line, answer)
}

/// Waits until the server ends. Then writes the frame that switches the motors off, unless the
/// server has reported that they are off.
fn serve(mut frames: impl Read, line: &impl AsFd, mut answer: impl io::Write) -> io::Result<()> {
    let mut length = [0];
    frames.read_exact(&mut length)?;
    let mut frame = vec![0; length[0].into()];
    frames.read_exact(&mut frame)?;
    answer.write_all(&[READY])?;
    answer.flush()?;
    match frames.read_exact(&mut [0]) {
        Ok(()) => Ok(()),
        Err(_) => say(line, &frame),
    }
}

/// Writes `frame` to the line [`TIMES`] times.
fn say(line: &impl AsFd, frame: &[u8]) -> io::Result<()> {
    for k in 0..TIMES {
        if k > 0 {
            std::thread::sleep(PAUSE);
        }
        // The server that held the port is dead. Until this process ends, no other one gets it, not
        // even one of root. The attempt fails as long as the dead server's files are being closed.
        let _ = flock(line, FlockOperation::NonBlockingLockExclusive);
        let mut rest = frame;
        while !rest.is_empty() {
            match rustix::io::write(line, rest) {
                Ok(n) => rest = &rest[n..],
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    if !wait_for(line, PollFlags::OUT, ROOM)? {
                        break;
                    }
                }
                Err(errno) => return Err(errno.into()),
            }
        }
    }
    Ok(())
}
