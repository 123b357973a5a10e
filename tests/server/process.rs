//! A running `hbot server`, and a client that sends and receives raw lines of JSON.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::Signal;
use serde_json::Value;

/// Longest time that a test waits for anything, even on a slow machine.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

/// The signals that end the program.
pub(crate) const STOPPING: [Signal; 5] = [Signal::HUP, Signal::INT, Signal::QUIT, Signal::TERM, Signal::TSTP];

/// Returns the program under test.
pub(crate) fn hbot() -> Command {
    Command::new(env!("CARGO_BIN_EXE_hbot"))
}

/// Writes a rig file with long timeouts, which a busy machine does not exceed, and returns its
/// path. The kernel moves the bytes of a pseudo-terminal in a worker of ordinary priority, so other
/// work can delay them for any time.
pub(crate) fn patient_rig(state: &std::path::Path) -> String {
    let prototype = include_str!("../../rigs/prototype.toml");
    let patient = prototype.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
    assert_ne!(patient, prototype, "the prototype's time-out is written otherwise");
    let path = state.join("patient.toml");
    std::fs::write(&path, patient).expect("written");
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
        let start = Instant::now();
        while TcpStream::connect(at).is_err() {
            if let Some(status) = self.child.try_wait().expect("a child") {
                assert_eq!(status.code(), Some(1), "the server ended at start");
                return false;
            }
            assert!(start.elapsed() < PATIENCE, "it does not listen");
            std::thread::sleep(Duration::from_millis(10));
        }
        true
    }
}

impl Drop for Mute {
    fn drop(&mut self) {
        // After a successful test the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A connection that sends lines without changing them.
pub(crate) struct Lines {
    stream: TcpStream,
    reader: BufReader<TcpStream>,
}

impl Lines {
    pub(crate) fn connect(address: &str) -> Self {
        let stream = TcpStream::connect(address).expect("the server listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        let reader = BufReader::new(stream.try_clone().expect("a socket"));
        Self { stream, reader }
    }

    /// Connects and sends `hello`.
    pub(crate) fn greeted(address: &str) -> Self {
        let mut lines = Self::connect(address);
        let hello = lines.ask(r#"{"id": 0, "op": "hello", "version": 1, "name": "a test"}"#);
        assert!(hello["ok"]["server"].as_str().is_some_and(|s| s.starts_with("hbot")), "{hello}");
        lines
    }

    pub(crate) fn send(&mut self, line: &str) {
        self.stream.write_all(line.as_bytes()).expect("sent");
    }

    /// Returns the next line, or `None` if the server has closed the connection.
    pub(crate) fn next(&mut self) -> Option<Value> {
        let mut line = String::new();
        match self.reader.read_line(&mut line) {
            Ok(0) => None,
            Ok(_) => Some(serde_json::from_str(&line).expect("the server sends JSON")),
            Err(e) if e.kind() == std::io::ErrorKind::ConnectionReset => None,
            Err(e) => panic!("no line within {PATIENCE:?}: {e}"),
        }
    }

    /// Sends a request and returns its answer. Events that arrive in between are dropped.
    pub(crate) fn ask(&mut self, line: &str) -> Value {
        self.send(line);
        self.send("\n");
        self.until(|value| value.get("id").is_some())
    }

    /// Returns the next state event for which `ready` holds.
    pub(crate) fn state(&mut self, mut ready: impl FnMut(&Value) -> bool) -> Value {
        self.until(|value| value["event"] == "state" && ready(value))
    }

    pub(crate) fn until(&mut self, mut found: impl FnMut(&Value) -> bool) -> Value {
        let start = std::time::Instant::now();
        let mut last = Value::Null;
        while start.elapsed() < PATIENCE {
            last = self.next().expect("the connection stays");
            if found(&last) {
                return last;
            }
        }
        panic!("it did not come within {PATIENCE:?}; the last that came: {last}");
    }
}

/// Returns a field of three numbers as a vector.
pub(crate) fn vector(value: &Value) -> [f64; 3] {
    std::array::from_fn(|i| value[i].as_f64().expect("a number"))
}

/// Returns the length of a vector of three numbers.
pub(crate) fn norm(value: &Value) -> f64 {
    vector(value).iter().map(|x| x * x).sum::<f64>().sqrt()
}
