//! Rows in which something is measured in alternation with what it is compared with.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hbot_api::{Client, StatsOk};
use hbot_config::rig::Protocol;
use hbot_host::commission::doctor::punctuality;
use serde_json::{Value, json};

use crate::bench::{Helper, Other, WatchedServer};
use crate::{Outcome, Row};

/// Number of pairs of measurements, one with and one without the disturbance.
const PAIRS: u32 = 5;

/// Sorts the values and returns the quantile at `share` (0 to 1), or NaN if there are none.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    quantile(&mut values, 0.5)
}

/// Timing of a server's loop in one measurement: median lateness, median computing time, number of
/// late ticks, and number of all ticks.
#[derive(Clone, Copy)]
struct Run {
    lateness_us: f64,
    compute_us: f64,
    late: u64,
    ticks: u64,
}

impl Run {
    fn of(stats: &StatsOk) -> Self {
        Self {
            lateness_us: stats.lateness_us.p50,
            compute_us: stats.compute_us.p50,
            late: stats.late_ticks,
            ticks: stats.ticks,
        }
    }

    fn alone(seconds: u64) -> Outcome<Self> {
        let mut bench = quiet()?;
        std::thread::sleep(Duration::from_secs(seconds));
        Ok(Self::of(&bench.stats()?))
    }
}

fn quiet() -> Outcome<WatchedServer> {
    let mut bench = WatchedServer::start(Protocol::Hbot, "sim", Value::Null)?;
    bench.watcher.unsubscribe()?;
    Ok(bench)
}

/// A TCP connection that sends and receives lines of text.
struct Line(TcpStream);

impl Line {
    fn connect(address: &str) -> Outcome<Self> {
        let stream = TcpStream::connect(address)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(Duration::from_secs(5)))?;
        Ok(Self(stream))
    }

    /// Sends a line and returns the time until the answer line has arrived.
    fn ask(&mut self, line: &[u8]) -> Outcome<Duration> {
        let start = Instant::now();
        self.0.write_all(line)?;
        let mut piece = [0; 4096];
        loop {
            let n = self.0.read(&mut piece)?;
            if n == 0 {
                return Err("the connection has ended".into());
            }
            if piece[n - 1] == b'\n' {
                return Ok(start.elapsed());
            }
        }
    }

    /// Measures `count` round trips of a ping, in microseconds, with a pause after each. Appends
    /// them to `into`.
    fn round_trips(&mut self, count: u32, pause: Duration, into: &mut Vec<f64>) -> Outcome<()> {
        for _ in 0..count {
            into.push(self.ask(b"{\"id\":1,\"op\":\"ping\"}\n")?.as_secs_f64() * 1e6);
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
        }
        Ok(())
    }
}

/// Measures `count` round trips to an echo process, in microseconds. They show how fast two
/// processes on this machine can exchange messages.
fn echoes(count: u32) -> Outcome<Vec<f64>> {
    let mut echo = Helper::start(&["echo"])?;
    let mut times = Vec::new();
    Line::connect(&echo.line()?)?.round_trips(count, Duration::from_millis(1), &mut times)?;
    Ok(times)
}

/// Compares the round-trip time of pings, sent without pauses, with that of an echo process.
pub(crate) fn ping(seconds: u64) -> Outcome<Row> {
    pings("one after the other", 200, Duration::ZERO, seconds)
}

/// Compares the round-trip time of pings sent once a millisecond with that of an echo process. A
/// client in step with the loop sends requests like this, and between them its data can leave the
/// caches.
pub(crate) fn ping_paced(seconds: u64) -> Outcome<Row> {
    pings("one per millisecond", 20, Duration::from_millis(1), seconds)
}

/// Compares the round-trip time of pings to the server with that of an echo process on the same
/// kind of runtime.
///
/// Short series of `turn` pings and `turn` echoes alternate, because other work on the machine
/// changes from moment to moment and should affect both equally.
fn pings(how: &str, turn: u32, pause: Duration, seconds: u64) -> Outcome<Row> {
    let bench = quiet()?;
    let mut server = Line::connect(&bench.address)?;
    server.ask(b"{\"id\":0,\"op\":\"hello\",\"version\":1,\"name\":\"ping\"}\n")?;
    let mut echo = Helper::start(&["echo"])?;
    let mut beside = Line::connect(&echo.line()?)?;
    let (mut pings, mut echoes, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2 * seconds) {
        let (mut one, mut other) = (Vec::new(), Vec::new());
        server.round_trips(turn, pause, &mut one)?;
        beside.round_trips(turn, pause, &mut other)?;
        ratios.push(quantile(&mut one, 0.5) / quantile(&mut other, 0.5));
        pings.append(&mut one);
        echoes.append(&mut other);
    }
    let (a, b) = (quantile(&mut pings, 0.5), quantile(&mut echoes, 0.5));
    let (far, far_echo) = (quantile(&mut pings, 0.99), quantile(&mut echoes, 0.99));
    let (ratio, pairs) = (a / b, median(ratios));
    Ok(Row::new(
        &format!(
            "`ping` between two processes, {how}: {} round trips, in turns of {turn} with those of an echo on the same kind of runtime",
            pings.len()
        ),
        "median at most 1.3 times that of the echo",
        format!(
            "{ratio:.2} times: {a:.1} us against {b:.1} us; median over pairs of turns {pairs:.2} times; 99 % of round trips within {far:.0} us against {far_echo:.0} us"
        ),
        ratio <= 1.3,
    ))
}

/// Measures the age of the torques of a client that renders a spring in step with the loop.
pub(crate) fn render(seconds: u64) -> Outcome<Row> {
    let hand = json!({"hand": {"amplitude": 0.2}});
    let mut bench = WatchedServer::start(Protocol::Hbot, "sim", hand)?;
    bench.watcher.unsubscribe()?;
    let mut renderer = Helper::start(&["render", &bench.address, &seconds.to_string()])?;
    let ages: Value = serde_json::from_str(&renderer.line()?)?;
    let mut echoed = echoes(500 * seconds as u32)?;
    let far = quantile(&mut echoed, 0.99);
    let at = |key: &str| ages[key].as_f64().unwrap_or(f64::INFINITY);
    Ok(Row::new(
        "a client computes its own torque at 1 kHz: a state in, a torque out",
        "median age of the torque in force at most 2 ticks, counted from the tick of the state from which it was computed",
        format!(
            "median {} ticks, 99 % within {} ticks, of {} ages; 99 % of an echo's round trips take at most {far:.0} us",
            at("p50"),
            at("p99"),
            ages["count"]
        ),
        at("p50") <= 2.0,
    ))
}

/// Measures the timing of the loop of a server with eight clients that receive every state.
fn subscribed(seconds: u64) -> Outcome<Run> {
    let mut bench = quiet()?;
    let over = Arc::new(AtomicBool::new(false));
    let readers: Vec<_> = (0..8)
        .map(|k| {
            let mut client = Client::connect(&bench.address, &format!("reader {k}"))?;
            client.subscribe(1)?;
            let over = Arc::clone(&over);
            Ok(std::thread::spawn(move || {
                let mut taken = 0_u64;
                while !over.load(Ordering::Relaxed) {
                    // A client that the server disconnects ends here. The statistics show it.
                    let Ok(event) = client.next_event(Duration::from_millis(100)) else { break };
                    taken += u64::from(event.is_some());
                }
                taken
            }))
        })
        .collect::<Outcome<_>>()?;
    std::thread::sleep(Duration::from_secs(seconds));
    let stats = bench.stats()?;
    over.store(true, Ordering::Relaxed);
    let taken: u64 = readers.into_iter().filter_map(|reader| reader.join().ok()).sum();
    // Nearly all states must have been read. Some are still in flight.
    if taken < 8 * 900 * seconds {
        return Err(format!("only {taken} states were read").into());
    }
    Ok(Run::of(&stats))
}

pub(crate) fn subscribers(seconds: u64) -> Outcome<Row> {
    let (mut lateness, mut compute) = (Vec::new(), Vec::new());
    let mut each: [Vec<f64>; 4] = Default::default();
    for _ in 0..PAIRS {
        let (without, with) = (Run::alone(seconds)?, subscribed(seconds)?);
        lateness.push(with.lateness_us / without.lateness_us);
        compute.push(with.compute_us / without.compute_us);
        let both = [without.compute_us, with.compute_us, without.lateness_us, with.lateness_us];
        each.iter_mut().zip(both).for_each(|(all, one)| all.push(one));
    }
    let (lateness, compute) = (median(lateness), median(compute));
    let [compute_without, compute_with, lateness_without, lateness_with] = each.map(median);
    Ok(Row::new(
        &format!(
            "8 clients subscribe to every state at 1 kHz; {PAIRS} pairs of {seconds} s with and without them"
        ),
        "medians of computing time and lateness at most 5 % above those without",
        format!(
            "computing time {compute:.3} times ({compute_with:.2} us with, {compute_without:.2} us without), lateness {lateness:.3} times \
             ({lateness_with:.3} us with, {lateness_without:.3} us without)"
        ),
        compute <= 1.05 && lateness <= 1.05,
    ))
}

/// Measures the timing of the loop of a server with 1,000 connections, of which 200 send garbage
/// and 50 do not read.
fn attacked(seconds: u64) -> Outcome<Run> {
    let mut bench = quiet()?;
    let mut held = Vec::new();
    for k in 0..1000 {
        let Ok(mut stream) = TcpStream::connect(&bench.address) else { continue };
        stream.set_nonblocking(true)?;
        // Bytes that are not accepted are dropped.
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
    Ok(Run::of(&bench.stats()?))
}

pub(crate) fn attack(seconds: u64) -> Outcome<Row> {
    let mut ratios = Vec::new();
    let (mut quiet, mut loud) = ((0, 0), (0, 0));
    for _ in 0..PAIRS {
        let (a, b) = (Run::alone(seconds)?, attacked(seconds)?);
        ratios.push(b.lateness_us / a.lateness_us);
        quiet = (quiet.0 + a.late, quiet.1 + a.ticks);
        loud = (loud.0 + b.late, loud.1 + b.ticks);
    }
    // The expected number of late ticks without a disturbance, and the standard deviation of the
    // difference of two such counts.
    let expected = quiet.0 as f64 * loud.1 as f64 / quiet.1.max(1) as f64;
    let sigma = (expected + loud.0 as f64).sqrt().max(1.0);
    let ratio = median(ratios);
    Ok(Row::new(
        &format!(
            "1,000 connections, of which 200 send garbage and 50 do not read; {PAIRS} pairs of {seconds} s with and without them"
        ),
        "median lateness at most 1.2 times that without; late ticks at most 3 sigma more than without",
        format!(
            "{ratio:.2} times; {} late of {} ticks with, {} of {} without",
            loud.0, loud.1, quiet.0, quiet.1
        ),
        ratio <= 1.2 && loud.0 as f64 - expected <= 3.0 * sigma,
    ))
}

pub(crate) fn load(seconds: u64) -> Outcome<Row> {
    let (mut ratios, mut far) = (Vec::new(), Vec::new());
    let mut each: [Vec<f64>; 4] = Default::default();
    for _ in 0..PAIRS {
        let _load: Vec<Other> = (0..std::thread::available_parallelism()?.get())
            .map(|_| Ok(Other(Command::new("sh").args(["-c", "while :; do :; done"]).spawn()?)))
            .collect::<Outcome<_>>()?;
        let bare = punctuality(1000, None, Duration::from_secs(seconds));
        // With every core loaded, a pseudo-terminal can stall until the link counts as lost. The
        // loop still ticks.
        let mut bench = WatchedServer::ticking()?;
        std::thread::sleep(Duration::from_secs(seconds));
        let late = bench.stats()?.lateness_us;
        ratios.push(late.p50 / bare.p50_us);
        far.push(late.p99 / bare.p99_us);
        let both = [late.p50, bare.p50_us, late.p99, bare.p99_us];
        each.iter_mut().zip(both).for_each(|(all, one)| all.push(one));
    }
    let (ratio, far) = (median(ratios), median(far));
    let [p50, bare_p50, p99, bare_p99] = each.map(median);
    Ok(Row::new(
        &format!(
            "all cores loaded by other work: lateness of the loop against that of a bare loop of absolute sleeps, {PAIRS} pairs of {seconds} s"
        ),
        "median at most 1.2 times, 99 % quantile at most 1.5 times",
        format!(
            "median {ratio:.3} times ({p50:.1} us against {bare_p50:.1} us), 99 % quantile {far:.3} times ({p99:.1} us against {bare_p99:.1} us)"
        ),
        ratio <= 1.2 && far <= 1.5,
    ))
}
