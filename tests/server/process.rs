//! A running `hbot server`, and what most tests of the program use.

use std::io::{BufRead as _, BufReader, Read as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::process::CommandExt as _;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};

use assert_cmd::assert::Assert;
pub(crate) use hbot_testing::lines::JsonLines;
pub(crate) use hbot_testing::patience::eventually;
use hbot_testing::patience::{PATIENCE, until};
use hbot_testing::prototype::patient_file;
pub(crate) use predicates::prelude::PredicateBooleanExt as _;
pub(crate) use predicates::str::contains;
pub(crate) use rustix::process::{Pid, Signal, kill_process};

/// Runs a command of the program to its end.
pub(crate) fn run(args: &[&str]) -> Assert {
    assert_cmd::Command::from_std(hbot()).args(args).timeout(2 * PATIENCE).assert()
}

/// The signals that end the program.
pub(crate) const STOPPING: [Signal; 5] = [Signal::HUP, Signal::INT, Signal::QUIT, Signal::TERM, Signal::TSTP];

/// Returns the program under test, called by its name as if it was installed.
pub(crate) fn hbot() -> Command {
    let mut hbot = Command::new(env!("CARGO_BIN_EXE_hbot"));
    hbot.arg0("hbot");
    hbot
}

pub(crate) fn patient_rig(folder: &std::path::Path) -> String {
    let path = folder.join("patient.toml");
    std::fs::write(&path, patient_file()).expect("written");
    path.to_str().expect("UTF-8").to_owned()
}

/// Writes a scene with a constant torque, in which every motor has a part, into `folder`. Returns
/// its path.
pub(crate) fn push_scene(folder: &std::path::Path) -> String {
    let path = folder.join("push.toml");
    let effect = "[[effect]]\nid = \"push\"\nkind = \"constant\"\ntorque = [0.05, 0.1, 0.1]\n";
    std::fs::write(&path, format!("name = \"Push\"\n{effect}")).expect("written");
    path.to_str().expect("UTF-8").to_owned()
}

/// Enables the motors through the server, and waits until `pushed` says that they give torque.
pub(crate) fn push(client: &mut JsonLines, mut pushed: impl FnMut() -> bool) {
    eventually("torque", || {
        // A machine that stood still for 20 ms has caused a deadline fault.
        client.ask(r#"{"id": 2, "op": "reset"}"#);
        client.ask(r#"{"id": 3, "op": "enable"}"#);
        pushed()
    });
}

/// A server process. It is killed at the end of a test that has not stopped it.
pub(crate) struct Process {
    /// It ends before its folder, which stands below.
    child: Killed,
    folder: Option<tempfile::TempDir>,
    out: BufReader<ChildStdout>,
    pub(crate) banner: String,
    pub(crate) address: String,
}

impl Process {
    /// Starts a server on a free port, with its flight logs in `state`, and reads its messages at
    /// start.
    pub(crate) fn start(args: &[&str], state: &std::path::Path) -> Self {
        let log = state.join("stderr.txt");
        let mut child = hbot()
            .args(["server", "--listen", "127.0.0.1:0"])
            .args(args)
            .env("XDG_STATE_HOME", state)
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(&log).expect("a file"))
            .spawn()
            .expect("the binary runs");
        let mut out = BufReader::new(child.stdout.take().expect("piped"));
        let mut banner = String::new();
        while !banner.contains("listen") {
            if out.read_line(&mut banner).expect("readable") == 0 {
                let why = std::fs::read_to_string(&log).unwrap_or_default();
                panic!("the server ended at start:\n{banner}{why}");
            }
        }
        let address = banner.split_whitespace().last().expect("an address").to_owned();
        Self { child: Killed(child), folder: None, out, banner, address }
    }

    /// Starts a server on a free port. Its flight logs go into a folder that ends with it.
    pub(crate) fn with(args: &[&str]) -> Self {
        Self::within(tempfile::tempdir().expect("a folder"), args)
    }

    /// Starts a server on a free port, with the rig file of [`patient_file`].
    pub(crate) fn patient(args: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let rig = patient_rig(folder.path());
        Self::within(folder, &[&["--rig", &rig], args].concat())
    }

    /// Starts a server on a free port. In the rig file of [`patient_file`], `to` replaces `from`.
    pub(crate) fn altered(from: &str, to: &str) -> Self {
        let (text, folder) = (patient_file(), tempfile::tempdir().expect("a folder"));
        let (altered, path) = (text.replace(from, to), folder.path().join("altered.toml"));
        assert_ne!(text, altered, "the rig file has no {from:?}");
        std::fs::write(&path, altered).expect("written");
        Self::within(folder, &["--rig", path.to_str().expect("UTF-8")])
    }

    fn within(folder: tempfile::TempDir, args: &[&str]) -> Self {
        let mut server = Self::start(args, folder.path());
        server.folder = Some(folder);
        server
    }

    /// Returns the server's own folder.
    pub(crate) fn folder(&self) -> &std::path::Path {
        self.folder.as_ref().expect("it has its own").path()
    }

    /// Returns a client that holds the lease.
    pub(crate) fn holder(&self) -> JsonLines {
        let mut client = JsonLines::greeted(&self.address);
        client.ask(r#"{"id": 1, "op": "acquire"}"#);
        client
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.0.id()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        let pid = Pid::from_child(&self.child.0);
        kill_process(pid, signal).expect("the server is there");
    }

    /// Waits until the server ends. Returns the rest of its output, and its exit status.
    pub(crate) fn end(mut self) -> (String, ExitStatus) {
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).expect("readable");
        (rest, self.child.0.wait().expect("it ends"))
    }

    /// Sends `signal` and waits until the server has ended.
    pub(crate) fn end_by(&mut self, signal: Signal) {
        self.signal(signal);
        self.child.0.wait().expect("it ends");
    }
}

/// Kills a program at the end of a test.
pub(crate) struct Killed(pub(crate) Child);

impl Drop for Killed {
    fn drop(&mut self) {
        // After a successful test the program has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server whose output is not read. The test chooses its port. It is killed at the end of a test
/// that has not stopped it.
pub(crate) struct Mute {
    pub(crate) child: Killed,
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
            let mut mute = Self { child: Killed(command.spawn().expect("the binary runs")), address };
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
            let status = self.child.0.try_wait().expect("a child")?;
            assert_eq!(status.code(), Some(1), "the server ended at start");
            Some(false)
        })
    }
}
