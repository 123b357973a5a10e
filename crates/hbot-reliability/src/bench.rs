//! Starts a server together with the processes that it talks to.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use hbot_api::{Client, Event, Mode, StateEvent, StatsOk};
use hbot_config::rig::Protocol;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use crate::{Outcome, rigs};

pub(crate) struct Other(pub(crate) Child);

impl Other {
    pub(crate) fn signal(&self, signal: Signal) -> Outcome<()> {
        Ok(kill_process(Pid::from_child(&self.0), signal)?)
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        // The process can have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// This program, run as a second process in another role, such as a client. Its standard input and
/// output are lines of text.
pub(crate) struct Helper {
    pub(crate) process: Other,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Helper {
    pub(crate) fn start(args: &[&str]) -> Outcome<Self> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let output = BufReader::new(child.stdout.take().ok_or("no output")?);
        let input = child.stdin.take().ok_or("no input")?;
        Ok(Self { process: Other(child), input, output })
    }

    pub(crate) fn say(&mut self, line: &str) -> Outcome<()> {
        Ok(writeln!(self.input, "{line}")?)
    }

    pub(crate) fn line(&mut self) -> Outcome<String> {
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        Ok(line.trim().to_owned())
    }
}

/// Returns a command for the `hbot` program under test, which must be in the folder of this
/// program.
pub(crate) fn hbot() -> Outcome<Command> {
    let path = std::env::current_exe()?.with_file_name("hbot");
    if !path.exists() {
        return Err(format!("{} is not there: run `cargo build --release` first", path.display()).into());
    }
    Ok(Command::new(path))
}

/// A running server under test, with a client that is subscribed to its states.
pub(crate) struct WatchedServer {
    pub(crate) server: Other,
    pub(crate) address: String,
    pub(crate) watcher: Client,
    /// Folder for the server's rig file and flight logs, unless another is given for these.
    _state: tempfile::TempDir,
    /// The server's standard output, which must stay open.
    _out: BufReader<ChildStdout>,
}

impl WatchedServer {
    /// Starts a server for motor controllers of `protocol` on the serial port `port`, and brings it
    /// to the mode `active`. Its scene has no effects, so that only a client can cause torque.
    pub(crate) fn start(protocol: Protocol, port: &str, simulate: Value) -> Outcome<Self> {
        let state = tempfile::tempdir()?;
        let mut command = hbot()?;
        command.env("XDG_STATE_HOME", state.path()).env("HBOT_LOG", "error");
        command.args(["server", "--port", port]);
        if protocol != Protocol::Hbot {
            let file = state.path().join("rig.toml");
            std::fs::write(&file, rigs::text(protocol))?;
            command.arg("--rig").arg(file);
        }
        let mut bench = Self::run(command, state, simulate)?;
        bench.activate()?;
        bench.watcher.release()?;
        Ok(bench)
    }

    /// Starts a server of which only the loop is tested. No client receives its states, and it need
    /// not become active.
    pub(crate) fn ticking() -> Outcome<Self> {
        let state = tempfile::tempdir()?;
        let mut command = hbot()?;
        command.env("XDG_STATE_HOME", state.path()).env("HBOT_LOG", "error");
        command.args(["server", "--port", "sim"]);
        let mut bench = Self::run(command, state, Value::Null)?;
        bench.watcher.unsubscribe()?;
        Ok(bench)
    }

    /// Starts a server that writes its flight logs to `logs` and its warnings to the file `said`.
    /// Files can have at most `blocks` blocks of 512 bytes.
    pub(crate) fn logging(logs: &Path, said: &Path, blocks: Option<u32>) -> Outcome<Self> {
        let hbot = hbot()?;
        let mut command = Command::new("sh");
        let limit = blocks.map_or_else(String::new, |n| format!("ulimit -f {n};"));
        command.arg("-c").arg(format!("{limit} exec \"$0\" \"$@\"")).arg(hbot.get_program());
        command.env("XDG_STATE_HOME", logs).env("HBOT_LOG", "warn").stderr(std::fs::File::create(said)?);
        command.args(["server", "--port", "sim"]);
        let mut bench = Self::run(command, tempfile::tempdir()?, Value::Null)?;
        bench.activate()?;
        Ok(bench)
    }

    /// Starts a server at `rate_hz` with its own scene, a spring, and a hand that moves. It writes
    /// flight logs if `flights` is true, and a recording to `record`, if given. No client receives
    /// its states.
    pub(crate) fn recording(rate_hz: u32, flights: bool, record: Option<&Path>) -> Outcome<Self> {
        let state = tempfile::tempdir()?;
        let mut command = hbot()?;
        command.env("HBOT_LOG", "error").args(["server", "--port", "sim", "--rate", &rate_hz.to_string()]);
        if flights {
            command.env("XDG_STATE_HOME", state.path());
        } else {
            // Without a home there is no folder for flight logs.
            command.env_remove("XDG_STATE_HOME").env_remove("HOME");
        }
        if let Some(path) = record {
            command.arg("--record").arg(path);
        }
        let mut bench = Self::connect(command, state)?;
        bench.watcher.acquire(false)?;
        bench.watcher.subscribe(1)?;
        bench.activate()?;
        bench.watcher.unsubscribe()?;
        Ok(bench)
    }

    pub(crate) fn resident(&self) -> Outcome<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.server.0.id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kib = line.and_then(|line| line.split_whitespace().next()).ok_or("no VmRSS")?;
        Ok(1024 * kib.parse::<u64>()?)
    }

    /// Stops the server as a user does, and waits until it has ended.
    pub(crate) fn stop(mut self) -> Outcome<()> {
        self.server.signal(Signal::TERM)?;
        let status = self.server.0.wait()?;
        if status.success() { Ok(()) } else { Err(format!("the server ended with {status}").into()) }
    }

    /// Runs the command of a server on a free TCP port, with a scene that has no effects.
    fn run(command: Command, state: tempfile::TempDir, simulate: Value) -> Outcome<Self> {
        let mut bench = Self::connect(command, state)?;
        let watcher = &mut bench.watcher;
        watcher.acquire(false)?;
        let scene = if simulate.is_null() {
            json!({"name": "nothing", "effect": []})
        } else {
            json!({"name": "nothing", "effect": [], "simulate": simulate})
        };
        watcher.load_scene(scene)?;
        watcher.subscribe(1)?;
        Ok(bench)
    }

    /// Runs the command of a server on a free TCP port, and connects to it.
    fn connect(mut command: Command, state: tempfile::TempDir) -> Outcome<Self> {
        let mut child = command.args(["--listen", "127.0.0.1:0"]).stdout(Stdio::piped()).spawn()?;
        let mut out = BufReader::new(child.stdout.take().ok_or("no output")?);
        let server = Other(child);
        let mut line = String::new();
        while !line.contains("listen") {
            line.clear();
            if out.read_line(&mut line)? == 0 {
                return Err("the server did not start".into());
            }
        }
        let address = line.split_whitespace().last().ok_or("no address")?.to_owned();
        let watcher = Client::connect(&address, "watcher")?;
        Ok(Self { server, address, watcher, _state: state, _out: out })
    }

    /// Brings the server to the mode `active`. The watching client then holds the lease.
    pub(crate) fn activate(&mut self) -> Outcome<()> {
        // If the machine stood still for 20 ms, the server is already in a fault, which is not the
        // fault under test.
        for _ in 0..10 {
            self.until(|state| state.mode != Mode::Unreferenced)?;
            // A reset is refused while the cause of the fault persists. It is then tried again.
            let enabled = self.watcher.reset().and_then(|_| self.watcher.enable());
            // States from before the reset can still arrive.
            let now = self.watcher.ping(Value::Null)?.tick;
            let settled =
                self.until(|state| state.tick > now && !matches!(state.mode, Mode::Enabling | Mode::Idle))?;
            if enabled.is_ok() && settled.mode == Mode::Active {
                return Ok(());
            }
        }
        Err("this machine cannot keep the rig active: `hbot doctor`".into())
    }

    /// Waits for a state for which `found` returns true, and returns it. Fails if none arrives
    /// within 20 s.
    pub(crate) fn until(&mut self, found: impl Fn(&StateEvent) -> bool) -> Outcome<StateEvent> {
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(20) {
            if let Some(Event::State(state)) = self.watcher.next_event(Duration::from_secs(5))?
                && found(&state)
            {
                return Ok(state);
            }
        }
        Err("it did not come within 20 s".into())
    }

    pub(crate) fn stats(&mut self) -> Outcome<StatsOk> {
        Ok(self.watcher.stats()?)
    }

    /// Starts a client that commands a torque, and waits until that torque acts.
    pub(crate) fn pushed(&mut self) -> Outcome<Helper> {
        let mut client = Helper::start(&["push", &self.address])?;
        client.line()?;
        self.until(|state| pushes(state) && state.client.is_some())?;
        Ok(client)
    }
}

fn pushes(state: &StateEvent) -> bool {
    state.torque.iter().map(|t| t * t).sum::<f64>().sqrt() > 0.25
}

pub(crate) fn still(state: &StateEvent) -> bool {
    state.torque == [0.0; 3]
}
