//! The last word of a process that cannot say it: one that aborts, runs out of memory, or is killed by SIGKILL while motors push.
//!
//! For each serial line the server starts this program once more as a *helper*. The helper gets a duplicate of the line's descriptor
//! and, through a pipe, the frame that switches the motors off. Then it sleeps until the pipe brings something:
//!
//! - one byte: the server has switched the motors off itself; the helper ends.
//! - the end of the pipe: the system has closed it because the server is gone. The helper writes the frame `TIMES` times and ends.
//!
//! The helper has a process group of its own and takes no notice of the signals of a terminal or a service manager. The loop does
//! nothing for it.

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
use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::realtime::{LOOP_PRIORITY, lock_memory, real_time};
use crate::signals;

/// How many times the frame is written, in case one is damaged on the line.
const TIMES: u32 = 3;
/// Pause between two of them.
const PAUSE: Duration = Duration::from_millis(3);
/// How long the helper tries to write one frame to a line that takes no bytes.
const ROOM: Duration = Duration::from_millis(100);
/// How long a helper may take to start.
const START: Duration = Duration::from_secs(5);
/// How long a helper may take to end.
const END: Duration = Duration::from_secs(1);
/// The byte that says that the motors are off.
const ALL_SAID: u8 = 1;
/// The byte by which a helper says that it is ready.
const READY: u8 = 2;

/// How this program is started as a helper.
#[derive(Debug, Clone)]
pub struct Program {
    path: PathBuf,
    arguments: Vec<String>,
}

impl Program {
    /// The running program with one argument, at which it calls [`run`]. Its file may be replaced or removed meanwhile.
    #[must_use]
    pub fn this(argument: &str) -> Self {
        Self { path: "/proc/self/exe".into(), arguments: vec![argument.to_owned()] }
    }

    #[cfg(test)]
    pub(crate) fn shell(script: &str) -> Self {
        Self { path: "/bin/sh".into(), arguments: vec!["-c".to_owned(), script.to_owned()] }
    }
}

/// The helper of one line.
#[derive(Debug)]
pub struct LastWord {
    /// `None` once the helper has been told to end.
    pipe: Option<ChildStdin>,
    helper: Arc<Mutex<Helper>>,
}

#[derive(Debug)]
struct Helper {
    child: Child,
    /// It has been told to end.
    dismissed: bool,
}

impl LastWord {
    /// Starts a helper that writes `frame` to `line` when this process ends without [`all_said`](Self::all_said), and waits until it is
    /// ready.
    ///
    /// # Errors
    /// The program does not start, or is no helper.
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
        // From here on whatever fails ends the helper.
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

    /// Ends the helper without a word: the motors are off, or the line is gone. Waits for it.
    pub fn all_said(&mut self) {
        let Some(mut pipe) = self.pipe.take() else { return };
        held(&self.helper).dismissed = true;
        // One that has ended already hears nothing.
        let _ = pipe.write_all(&[ALL_SAID]);
        drop(pipe);
        self.wait();
    }

    /// Something that can tell whether the helper is still there.
    #[must_use]
    pub(crate) fn watched(&self) -> Watched {
        Watched(Arc::clone(&self.helper))
    }

    /// Waits until the helper has ended, so that it neither holds the line nor stays a zombie; one that does not end is killed.
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
        // Neither fails but where it has ended already.
        let _ = helper.child.kill();
        let _ = helper.child.wait();
    }
}

/// The helper speaks, unless it has been told to end.
impl Drop for LastWord {
    fn drop(&mut self) {
        held(&self.helper).dismissed = true;
        drop(self.pipe.take());
        self.wait();
    }
}

/// The eye on a helper.
#[derive(Debug)]
pub(crate) struct Watched(Arc<Mutex<Helper>>);

impl Watched {
    /// Whether the helper has ended although nobody told it to.
    pub(crate) fn is_lost(&self) -> bool {
        let mut helper = held(&self.0);
        !helper.dismissed && matches!(helper.child.try_wait(), Ok(Some(_)))
    }
}

fn held(helper: &Mutex<Helper>) -> MutexGuard<'_, Helper> {
    helper.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits for the answer of a helper.
fn ready(mut answer: impl AsFd + Read) -> io::Result<()> {
    let mut byte = [0];
    if !wait_for(&answer, PollFlags::IN, START)? || answer.read(&mut byte)? == 0 || byte != [READY] {
        return Err(io::Error::other("the program does not answer as it should"));
    }
    Ok(())
}

/// Waits until a descriptor is ready for `what`; `false` once `most` has passed.
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

/// Has a crash of this process leave no core file. The system writes one before it closes anything, which takes longer than a
/// controller's watchdog. One byte rather than none: the kernel then leaves out those too that it hands to a program (core(5)).
pub(crate) fn without_core_file() {
    let maximum = getrlimit(Resource::Core).maximum;
    // Where it is refused, the last word comes later.
    let _ =
        setrlimit(Resource::Core, Rlimit { current: Some(maximum.map_or(1, |most| most.min(1))), maximum });
}

/// What the helper does. `frames` is the pipe from the server, `line` the serial line, `answer` where it says that it is ready.
///
/// # Errors
/// The pipe brings no frame, or the line is gone.
pub fn run(frames: impl Read, line: impl AsFd, answer: impl io::Write) -> io::Result<()> {
    signals::ignore()?;
    // Without the right to these the server has none either, and says so.
    let _ = real_time(LOOP_PRIORITY);
    let _ = lock_memory();
    // Only a name.
    let _ = rustix::thread::set_name(c"hbot-last-word");
    serve(frames, &line, answer)
}

/// Waits for the end of the server.
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

/// Writes the frame several times, whole.
fn say(line: &impl AsFd, frame: &[u8]) -> io::Result<()> {
    for k in 0..TIMES {
        if k > 0 {
            std::thread::sleep(PAUSE);
        }
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
