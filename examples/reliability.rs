//! Injects faults into a running server in wall-clock time and prints what came of each, as the rows of docs/reliability.md.
//!
//! ```text
//! cargo build --release && cargo run --release --example reliability [-- --quick]
//! ```
//!
//! The server, the motor controllers (a simulated rig behind a pseudo-terminal) and the client that pushes are processes of their own, so
//! that each can be stopped and killed. Only the server's own tick stamps are read, so nothing depends on when this program runs.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::{Duration, Instant};

use hbot_api::{Client, Event, Fault, Mode, StateEvent, TorqueCommand};
use hbot_config::RigConfig;
use hbot_server::doctor::punctuality;
use hbot_server::realtime::{SIMULATOR_PRIORITY, real_time};
use hbot_sim::controller::Fault as Trouble;
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_sim::rig::{RigConfig as Simulated, SimulatedRig};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// How long the client's torque holds, ms.
const VALID_MS: u64 = 100;
/// The ramp that follows it, ms, and the ticks for taking note.
const RAMP_MS: u64 = 20;
const NOTE: u64 = 2;

fn main() -> Outcome<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["peer"] => peer(),
        ["push", address] => push(address),
        [] => rows(20),
        ["--quick"] => rows(4),
        _ => Err("options: --quick".into()),
    }
}

/// A process that ends with this one.
struct Other(Child);

impl Other {
    fn signal(&self, signal: Signal) -> Outcome<()> {
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

/// The motor controllers: a rig behind a pseudo-terminal, in trouble as lines on standard input say.
fn peer() -> Outcome<()> {
    let rig = SimulatedRig::new(&Simulated::new(&RigConfig::prototype().rig))?;
    let on_start = || {
        // Without the right to it other work on the machine can be felt, as it can in the server.
        let _ = real_time(SIMULATOR_PRIORITY);
    };
    let pty = spawn_pty(rig, PtyOptions { on_start: Box::new(on_start), ..PtyOptions::default() })?;
    println!("{}", pty.path().display());
    for line in std::io::stdin().lines() {
        let trouble = match line?.as_str() {
            "mute" => Trouble::Mute(true),
            "deaf" => Trouble::Deaf(true),
            "reboot" => Trouble::Reboot,
            other => return Err(format!("{other}?").into()),
        };
        pty.call(move |rig| rig.inject(trouble))?;
    }
    Ok(())
}

/// A client that commands 0.3 N m a hundred times a second, for ever.
fn push(address: &str) -> Outcome<()> {
    let mut client = Client::connect(address, "pusher")?;
    client.acquire(true)?;
    println!("pushing");
    for seq in 0.. {
        let torque = [0.0, 0.3, 0.0];
        client.torque(TorqueCommand { torque, valid_ms: VALID_MS, tick: None, seq: Some(seq) })?;
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

/// This program again, in another part; with the first line that it says.
fn other(args: &[&str]) -> Outcome<(Other, String, ChildStdin)> {
    let mut child = Command::new(std::env::current_exe()?)
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let out = child.stdout.take().ok_or("no output")?;
    let stdin = child.stdin.take().ok_or("no input")?;
    let child = Other(child);
    let mut line = String::new();
    BufReader::new(out).read_line(&mut line)?;
    Ok((child, line.trim().to_owned(), stdin))
}

/// A server with what it talks to.
struct Bench {
    server: Other,
    address: String,
    watcher: Client,
    /// Where flight logs go, and the end of the server's output, which must stay open.
    _state: tempfile::TempDir,
    _out: BufReader<std::process::ChildStdout>,
}

impl Bench {
    /// A server on `port`, with nothing to render but a client's torque, active, its states watched.
    fn start(port: &str, simulate: Value) -> Outcome<Self> {
        let hbot = std::env::current_exe()?.with_file_name("../hbot");
        let state = tempfile::tempdir()?;
        let mut child = Command::new(&hbot)
            .args(["server", "--listen", "127.0.0.1:0", "--port", port])
            .env("XDG_STATE_HOME", state.path())
            .env("HBOT_LOG", "error")
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{}: {error}: run `cargo build --release` first", hbot.display()))?;
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
        let mut bench = Self { server, address, watcher, _state: state, _out: out };
        // A machine that stood still for 20 ms has made a fault already, which is not what is looked at here.
        for _ in 0..10 {
            bench.until(|state| state.mode != Mode::Unreferenced)?;
            // Refused while its cause is there: then once more.
            let enabled = bench.watcher.reset().and_then(|_| bench.watcher.enable());
            // States of before may still be on their way.
            let now = bench.watcher.ping(Value::Null)?.tick;
            let settled = bench
                .until(|state| state.tick > now && !matches!(state.mode, Mode::Enabling | Mode::Idle))?;
            if enabled.is_ok() && settled.mode == Mode::Active {
                bench.watcher.release()?;
                return Ok(bench);
            }
        }
        Err("this machine cannot keep the rig active: `hbot doctor`".into())
    }

    fn until(&mut self, found: impl Fn(&StateEvent) -> bool) -> Outcome<StateEvent> {
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

    fn stats(&mut self) -> Outcome<Value> {
        Ok(self.watcher.stats()?)
    }

    /// A client that pushes, its torque felt.
    fn pushed(&mut self) -> Outcome<(Other, ChildStdin)> {
        let (client, _, input) = other(&["push", &self.address])?;
        self.until(|state| pushes(state) && state.client.is_some())?;
        Ok((client, input))
    }
}

fn pushes(state: &StateEvent) -> bool {
    state.torque.iter().map(|t| t * t).sum::<f64>().sqrt() > 0.25
}

fn still(state: &StateEvent) -> bool {
    state.torque == [0.0; 3]
}

fn row(fault: &str, promise: &str, found: &str, kept: bool) {
    println!("| {fault} | {promise} | {found} | {} |", if kept { "kept" } else { "**not kept**" });
}

/// A client that pushes is lost: how many ticks after the last message that was taken the torque is zero.
fn client_lost(fault: &str, signal: Signal) -> Outcome<()> {
    let hand = json!({"hand": {"stiffness": 50, "damping": 1, "amplitude": 0}});
    let mut bench = Bench::start("sim", hand)?;
    let (client, _input) = bench.pushed()?;
    client.signal(signal)?;
    let mut taken = 0;
    let over = loop {
        let state = bench.until(|_| true)?;
        if still(&state) {
            break state;
        }
        let client = state.client.ok_or("no stream")?;
        taken = state.tick - client.age_ticks;
    };
    let ticks = over.tick - taken;
    let bound = VALID_MS + RAMP_MS + NOTE;
    row(
        &format!("client {fault} while it commands 0.3 N m"),
        &format!("zero within {bound} ticks of the last message"),
        &format!("{ticks} ticks; mode {:?}", over.mode),
        ticks <= bound,
    );
    Ok(())
}

/// Controllers go away in the midst of it: how long until the loop asks for no torque.
fn peer_lost(fault: &str, end: impl FnOnce(&Other, &mut ChildStdin) -> Outcome<()>) -> Outcome<()> {
    let (peer, port, mut input) = other(&["peer"])?;
    let mut bench = Bench::start(&port, Value::Null)?;
    let (_client, _pipe) = bench.pushed()?;
    end(&peer, &mut input)?;
    // The last reading that came, and the tick that gave up.
    let missed = bench.stats()?["missed_ticks"].as_u64().unwrap_or(0);
    let state = bench.until(|state| state.mode == Mode::Fault)?;
    let after = bench.stats()?["missed_ticks"].as_u64().unwrap_or(0);
    let bound = u64::from(RigConfig::prototype().link.timeout_ticks) + NOTE;
    let kept = state.fault.is_some() && still(&state);
    row(
        &format!("serial peer {fault}"),
        &format!(
            "fault, zero torque in its tick, after {bound} ticks without a reading; its own watchdog after 20 ms"
        ),
        &format!(
            "{:?}; {} ticks missed since it was asked",
            state.fault.unwrap_or(Fault::LinkLost),
            after - missed
        ),
        kept,
    );
    Ok(())
}

/// A line that spoils a share of the frames.
fn noise(share: f64, ticks: u64, rides: bool) -> Outcome<()> {
    let link = json!({"latency_s": 0, "command_latency_s": 0, "jitter_s": 0, "loss": 0, "corrupt": share});
    let hand = json!({"stiffness": 50, "damping": 1, "amplitude": 0});
    let mut bench = Bench::start("sim", json!({"hand": hand}))?;
    bench.watcher.acquire(false)?;
    bench
        .watcher
        .load_scene(json!({"name": "noise", "effect": [], "simulate": {"hand": hand, "link": link}}))?;
    let from = bench.until(|_| true)?.tick;
    let state = bench.until(|state| state.mode == Mode::Fault || state.tick > from + ticks)?;
    let frames = bench.stats()?["corrupt_frames"].clone();
    let promise = if rides { "rides through, frames counted" } else { "fault link_corrupt, zero torque" };
    let kept = (state.mode == Mode::Active) == rides;
    row(
        &format!("{} % of frames damaged each way", 100.0 * share),
        promise,
        &format!(
            "{:?}, fault {:?} after {} ticks, {frames} damaged frames counted",
            state.mode,
            state.fault,
            state.tick - from
        ),
        kept,
    );
    Ok(())
}

/// SIGTERM while a client pushes: what the controllers are left with.
fn terminated() -> Outcome<()> {
    let mut bench = Bench::start("sim", Value::Null)?;
    let (_client, _pipe) = bench.pushed()?;
    bench.server.signal(Signal::TERM)?;
    let status = bench.server.0.wait()?;
    row("SIGTERM while a client pushes", "zero torque, exit 0", &status.to_string(), status.success());
    Ok(())
}

/// Median lateness of a server over some seconds, us, and its late ticks.
fn lateness(seconds: u64) -> Outcome<(f64, u64)> {
    let mut bench = Bench::start("sim", Value::Null)?;
    bench.watcher.unsubscribe()?;
    std::thread::sleep(Duration::from_secs(seconds));
    let stats = bench.stats()?;
    Ok((stats["lateness_us"]["p50"].as_f64().unwrap_or(f64::NAN), stats["late_ticks"].as_u64().unwrap_or(0)))
}

/// The same with 1,000 connections, 200 that send garbage and 50 that do not read.
fn attacked(seconds: u64) -> Outcome<(f64, u64)> {
    let mut bench = Bench::start("sim", Value::Null)?;
    bench.watcher.unsubscribe()?;
    let mut held = Vec::new();
    for k in 0..1000 {
        let Ok(mut stream) = TcpStream::connect(&bench.address) else { continue };
        stream.set_nonblocking(true)?;
        // What does not go out is of no interest.
        let _ = match k {
            0..50 => stream.write(
                b"{\"id\":1,\"op\":\"hello\",\"version\":1,\"name\":\"deaf\"}\n{\"id\":2,\"op\":\"subscribe\",\"every\":1}\n",
            ),
            50..250 => stream.write(&[0xa5; 4096]),
            _ => Ok(0),
        };
        held.push(stream);
    }
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(seconds) {
        for stream in held.iter_mut().skip(50).take(200) {
            let _ = stream.write(&[0xa5; 4096]);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let stats = bench.stats()?;
    Ok((stats["lateness_us"]["p50"].as_f64().unwrap_or(f64::NAN), stats["late_ticks"].as_u64().unwrap_or(0)))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn pairs(seconds: u64) -> Outcome<()> {
    let (mut ratios, mut quiet, mut loud) = (Vec::new(), 0, 0);
    for _ in 0..5 {
        let (a, b) = (lateness(seconds)?, attacked(seconds)?);
        ratios.push(b.0 / a.0);
        quiet += a.1;
        loud += b.1;
    }
    let sigma = ((quiet + loud) as f64).sqrt().max(1.0);
    let ratio = median(ratios);
    row(
        "1,000 connections, 200 senders of garbage, 50 that do not read",
        "median lateness at most 1.2 times; late ticks within 3 sigma",
        &format!("{ratio:.2}; {loud} late ticks against {quiet}"),
        ratio <= 1.2 && (loud as f64 - quiet as f64) <= 3.0 * sigma,
    );
    let (mut ratios, mut far) = (Vec::new(), Vec::new());
    for _ in 0..5 {
        let load: Vec<Other> = (0..std::thread::available_parallelism()?.get())
            .map(|_| Ok(Other(Command::new("sh").args(["-c", "while :; do :; done"]).spawn()?)))
            .collect::<Outcome<_>>()?;
        let bare = punctuality(1000, Duration::from_secs(seconds));
        let mut bench = Bench::start("sim", Value::Null)?;
        std::thread::sleep(Duration::from_secs(seconds));
        let stats = bench.stats()?;
        drop(load);
        let at = |key: &str| stats["lateness_us"][key].as_f64().unwrap_or(f64::NAN);
        ratios.push(at("p50") / bare.p50_us);
        far.push(at("p99") / bare.p99_us);
    }
    let (ratio, far) = (median(ratios), median(far));
    row(
        "all cores loaded by other work, against a bare loop of absolute sleeps",
        "median at most 1.2 times, 99 % at most 1.5 times",
        &format!("{ratio:.2}, {far:.2}"),
        ratio <= 1.2 && far <= 1.5,
    );
    Ok(())
}

fn rows(seconds: u64) -> Outcome<()> {
    println!("| fault | promise | found | |\n|---|---|---|---|");
    let mut outcomes =
        vec![client_lost("killed", Signal::KILL), client_lost("stopped (SIGSTOP)", Signal::STOP)];
    outcomes.push(peer_lost("killed", |peer, _| peer.signal(Signal::KILL)));
    outcomes.push(peer_lost("stopped (SIGSTOP)", |peer, _| peer.signal(Signal::STOP)));
    outcomes.push(peer_lost("mute", |_, input| Ok(writeln!(input, "mute")?)));
    outcomes.push(peer_lost("rebooted", |_, input| Ok(writeln!(input, "reboot")?)));
    outcomes.push(noise(0.01, 10_000, true));
    outcomes.push(noise(0.5, 10_000, false));
    outcomes.push(terminated());
    outcomes.push(pairs(seconds));
    // A row that could not be made is no reason to leave out the others.
    let failed: Vec<String> =
        outcomes.into_iter().filter_map(Result::err).map(|error| error.to_string()).collect();
    if failed.is_empty() { Ok(()) } else { Err(failed.join("; ").into()) }
}
