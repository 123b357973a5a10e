//! A server with what it talks to.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use hbot_api::{Client, Event, Mode, StateEvent, StatsOk};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use crate::Outcome;

/// A process that ends with this one.
pub(crate) struct Other(pub(crate) Child);

impl Other {
    pub(crate) fn signal(&self, signal: Signal) -> Outcome<()> {
        Ok(kill_process(Pid::from_child(&self.0), signal)?)
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// This program again, in another part, with lines to and from it.
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

    /// The next line that it says.
    pub(crate) fn line(&mut self) -> Outcome<String> {
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        Ok(line.trim().to_owned())
    }
}

/// The program that is put to the test.
pub(crate) fn hbot() -> Outcome<Command> {
    let path = std::env::current_exe()?.with_file_name("hbot");
    if !path.exists() {
        return Err(format!("{} is not there: run `cargo build --release` first", path.display()).into());
    }
    Ok(Command::new(path))
}

/// A server, its states watched.
pub(crate) struct WatchedServer {
    pub(crate) server: Other,
    pub(crate) address: String,
    pub(crate) watcher: Client,
    /// Where flight logs go, unless somewhere else.
    _state: tempfile::TempDir,
    /// The end of the server's output, which must stay open.
    _out: BufReader<ChildStdout>,
}

impl WatchedServer {
    /// A server on `port`, with nothing to render but a client's torque, active.
    pub(crate) fn start(port: &str, simulate: Value) -> Outcome<Self> {
        let state = tempfile::tempdir()?;
        let mut command = hbot()?;
        command.env("XDG_STATE_HOME", state.path()).env("HBOT_LOG", "error");
        let mut bench = Self::run(command, state, port, simulate)?;
        bench.activate()?;
        bench.watcher.release()?;
        Ok(bench)
    }

    /// One whose states nobody takes, and of which nothing is asked but that its loop ticks.
    pub(crate) fn ticking() -> Outcome<Self> {
        let state = tempfile::tempdir()?;
        let mut command = hbot()?;
        command.env("XDG_STATE_HOME", state.path()).env("HBOT_LOG", "error");
        let mut bench = Self::run(command, state, "sim", Value::Null)?;
        bench.watcher.unsubscribe()?;
        Ok(bench)
    }

    /// The same with its flight logs in `logs`, what it says of them in the file `said`, and files of at most `blocks` (512 bytes).
    pub(crate) fn logging(logs: &Path, said: &Path, blocks: Option<u32>) -> Outcome<Self> {
        let hbot = hbot()?;
        let mut command = Command::new("sh");
        // Writing beyond the limit is then an error, as on a disk that is full.
        let limit = blocks.map_or_else(String::new, |n| format!("trap '' XFSZ; ulimit -f {n};"));
        command.arg("-c").arg(format!("{limit} exec \"$0\" \"$@\"")).arg(hbot.get_program());
        command.env("XDG_STATE_HOME", logs).env("HBOT_LOG", "warn").stderr(std::fs::File::create(said)?);
        let mut bench = Self::run(command, tempfile::tempdir()?, "sim", Value::Null)?;
        bench.activate()?;
        Ok(bench)
    }

    fn run(mut command: Command, state: tempfile::TempDir, port: &str, simulate: Value) -> Outcome<Self> {
        let mut child = command
            .args(["server", "--listen", "127.0.0.1:0", "--port", port])
            .stdout(Stdio::piped())
            .spawn()?;
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
        let mut watcher = Client::connect(&address, "watcher")?;
        watcher.acquire(false)?;
        let scene = if simulate.is_null() {
            json!({"name": "nothing", "effect": []})
        } else {
            json!({"name": "nothing", "effect": [], "simulate": simulate})
        };
        watcher.load_scene(scene)?;
        watcher.subscribe(1)?;
        Ok(Self { server, address, watcher, _state: state, _out: out })
    }

    /// Brings it to active, with the lease in hand.
    pub(crate) fn activate(&mut self) -> Outcome<()> {
        // A machine that stood still for 20 ms has made a fault already, which is not what is looked at here.
        for _ in 0..10 {
            self.until(|state| state.mode != Mode::Unreferenced)?;
            // Refused while its cause is there: then once more.
            let enabled = self.watcher.reset().and_then(|_| self.watcher.enable());
            // States of before may still be on their way.
            let now = self.watcher.ping(Value::Null)?.tick;
            let settled =
                self.until(|state| state.tick > now && !matches!(state.mode, Mode::Enabling | Mode::Idle))?;
            if enabled.is_ok() && settled.mode == Mode::Active {
                return Ok(());
            }
        }
        Err("this machine cannot keep the rig active: `hbot doctor`".into())
    }

    /// The next state for which `found` holds.
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

    /// A client that pushes, its torque felt.
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
