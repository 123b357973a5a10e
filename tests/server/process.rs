//! A running `hbot server`.

use std::io::{BufRead as _, BufReader, Read as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::process::CommandExt as _;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};

use hbot_testing::patience::until;
use hbot_testing::prototype::patient_file;
use rustix::process::Signal;

/// The signals that end the program.
pub(crate) const STOPPING: [Signal; 5] = [Signal::HUP, Signal::INT, Signal::QUIT, Signal::TERM, Signal::TSTP];

/// Returns the program under test, called by its name as if it was installed.
pub(crate) fn hbot() -> Command {
    let mut hbot = Command::new(env!("CARGO_BIN_EXE_hbot"));
    hbot.arg0("hbot");
    hbot
}

/// Writes the rig file of [`patient_file`] into `folder` and returns its path.
pub(crate) fn patient_rig(folder: &std::path::Path) -> String {
    let path = folder.join("patient.toml");
    std::fs::write(&path, patient_file()).expect("written");
    path.to_str().expect("UTF-8").to_owned()
}

/// A server process. It is killed at the end of a test that has not stopped it.
pub(crate) struct Process {
    child: Child,
    out: BufReader<ChildStdout>,
    pub(crate) banner: String,
    pub(crate) address: String,
}

impl Process {
    /// Starts a server on a free port, with its flight logs in `state`, and reads its messages at
    /// start.
    pub(crate) fn start(args: &[&str], state: &std::path::Path) -> Self {
        let mut child = hbot()
            .args(["server", "--listen", "127.0.0.1:0"])
            .args(args)
            .env("XDG_STATE_HOME", state)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the binary runs");
        let mut out = BufReader::new(child.stdout.take().expect("piped"));
        let mut banner = String::new();
        while !banner.contains("listen") {
            let n = out.read_line(&mut banner).expect("readable");
            assert!(n > 0, "the server ended at start:\n{banner}");
        }
        let address = banner.split_whitespace().last().expect("an address").to_owned();
        Self { child, out, banner, address }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).expect("the server is there");
    }

    /// Waits until the server ends. Returns the rest of its output, and its exit status.
    pub(crate) fn end(mut self) -> (String, ExitStatus) {
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).expect("readable");
        (rest, self.child.wait().expect("it ends"))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // After a successful test the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Kills a program at the end of a test.
pub(crate) struct Killed(pub(crate) Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server whose output is not read. The test chooses its port. It is killed at the end of a test
/// that has not stopped it.
pub(crate) struct Mute {
    pub(crate) child: Child,
    pub(crate) address: String,
}

impl Mute {
    pub(crate) fn start(state: &std::path::Path, with: impl Fn(&mut Command)) -> Self {
        loop {
            let free = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
            let address = free.expect("a free port").to_string();
            let mut command = hbot();
            command.args(["server", "--time", "virtual", "--listen", &address]).env("XDG_STATE_HOME", state);
            with(&mut command);
            let mut mute = Self { child: command.spawn().expect("the binary runs"), address };
            if mute.listens() {
                return mute;
            }
            // Another test has taken the port in the meantime.
        }
    }

    /// Waits until the server listens. Returns `false` if it has ended with exit code 1, for
    /// example because the port is taken.
    fn listens(&mut self) -> bool {
        let at: SocketAddr = self.address.parse().expect("an address");
        until("it listens, or has ended", || {
            if TcpStream::connect(at).is_ok() {
                return Some(true);
            }
            let status = self.child.try_wait().expect("a child")?;
            assert_eq!(status.code(), Some(1), "the server ended at start");
            Some(false)
        })
    }
}

impl Drop for Mute {
    fn drop(&mut self) {
        // After a successful test the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
