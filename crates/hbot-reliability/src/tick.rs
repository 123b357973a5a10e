//! A tick with the motor controllers of each protocol, measured in alternation: time on the line,
//! torque age, and the time that a driver takes to encode commands and decode answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use hbot_config::rig::Protocol;
use hbot_core::MAX_JOINTS;
use hbot_host::bus::{BusCommand, Expected, driver};
use hbot_host::line::{Line, Memory};
use hbot_host::rig::layout::Layout;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::Value;

use crate::bench::WatchedServer;
use crate::timing::quantile;
use crate::{Outcome, Row, rigs};

/// Number of servers of each protocol.
const ROUNDS: usize = 3;
/// How often a server is started until it becomes active.
const STARTS: usize = 20;
/// Number of ticks in which the driver is measured without a server.
const TICKS: u32 = 5000;
/// Longest median time that encoding and decoding may take in a tick, us.
const CODEC_US: f64 = 20.0;
const PROTOCOLS: [Protocol; 3] = [Protocol::Hbot, Protocol::Moteus, Protocol::Odrive];

/// A line in memory that measures how long its other end takes.
struct Timed {
    line: Memory,
    /// Time that was spent in the line since the last reset, ns.
    spent_ns: Arc<AtomicU64>,
}

impl Timed {
    fn count<T>(&mut self, work: impl FnOnce(&mut Memory) -> T) -> T {
        let start = Instant::now();
        let done = work(&mut self.line);
        self.spent_ns.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        done
    }
}

impl Line for Timed {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.count(|line| line.read(now_ns, buffer))
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        self.count(|line| line.write(now_ns, bytes))
    }

    fn pause(&mut self) {
        self.line.pause();
    }
}

/// Returns the times that the driver of `protocol` takes in a tick with four joints on one line, in
/// us, without the time in the line.
fn codec_us(protocol: Protocol) -> Outcome<Vec<f64>> {
    let config = rigs::on_device(protocol)?;
    let simulated =
        SimulatedRig::new(&SimulatedConfig { line: protocol.into(), ..SimulatedConfig::new(&config.rig) })?;
    let (_calls, inbox) = channel();
    let spent_ns = Arc::new(AtomicU64::new(0));
    let mut line = Timed { line: Memory::new(simulated, inbox), spent_ns: Arc::clone(&spent_ns) };
    let expected = Expected::new("memory", &config.rig, &Layout::of(&config), 0);
    driver(protocol).meet(&mut line, &expected)?;
    let mut bus = driver(protocol).bus(Box::new(line), expected);
    let mut torque = [0.0; MAX_JOINTS];
    torque[..4].copy_from_slice(&[0.01, -0.01, 0.02, 0.005]);
    let (mut times, mut readings) = (Vec::new(), 0);
    for tick in 0..TICKS {
        let now_ns = u64::from(tick) * config.rig.timing.period_ns;
        spent_ns.store(0, Ordering::Relaxed);
        let start = Instant::now();
        let heard = bus.receive(now_ns, tick);
        bus.command(now_ns, &BusCommand { tick, enable: tick > 100, watchdog_ms: 20, torque });
        let all_ns = start.elapsed().as_nanos() as u64;
        times.push(all_ns.saturating_sub(spent_ns.load(Ordering::Relaxed)) as f64 * 1e-3);
        readings += u32::from(heard.reading.is_some());
    }
    // An ODrive takes some ticks until its first heartbeat.
    if readings < TICKS - 50 {
        return Err(format!("{readings} readings in {TICKS} ticks with {}", protocol.name()).into());
    }
    Ok(times)
}

/// What servers with one protocol did.
#[derive(Default)]
struct Served {
    line_us: Vec<f64>,
    line_99_us: Vec<f64>,
    age_us: Vec<f64>,
    age_99_us: Vec<f64>,
    /// Late, skipped, missed and all ticks.
    ticks: [u64; 4],
    codec_us: Vec<f64>,
}

impl Served {
    /// Runs a server with an idle client for `seconds`, and adds its statistics.
    fn add(&mut self, protocol: Protocol, seconds: u64) -> Outcome<()> {
        let start = || {
            let failed = |error| format!("{}: {error}", protocol.name());
            WatchedServer::start(protocol, "sim", Value::Null).map_err(failed)
        };
        // A busy machine can keep a server from becoming active.
        let mut bench = (1..STARTS).find_map(|_| start().ok()).map_or_else(start, Ok)?;
        bench.watcher.unsubscribe()?;
        // The motors have been switched on before, and not all readings came in time then.
        let before = bench.stats()?;
        std::thread::sleep(Duration::from_secs(seconds));
        let stats = bench.stats()?;
        self.line_us.push(stats.link_us.p50);
        self.line_99_us.push(stats.link_us.p99);
        self.age_us.push(stats.age_us.p50);
        self.age_99_us.push(stats.age_us.p99);
        let since = [
            stats.late_ticks - before.late_ticks,
            stats.skipped_ticks - before.skipped_ticks,
            stats.missed_ticks - before.missed_ticks,
            stats.ticks - before.ticks,
        ];
        self.ticks.iter_mut().zip(since).for_each(|(all, one)| *all += one);
        self.codec_us.append(&mut codec_us(protocol)?);
        Ok(())
    }

    fn said(&mut self, name: &str) -> String {
        let [late, skipped, missed, ticks] = self.ticks;
        let [line, line_99, age, age_99] =
            [&mut self.line_us, &mut self.line_99_us, &mut self.age_us, &mut self.age_99_us]
                .map(|values| quantile(values, 0.5));
        format!(
            "{name}: {line:.0} us on the line (99 %: {line_99:.0} us), torque age {age:.0} us ({age_99:.0} us), \
             {late} late, {skipped} skipped and {missed} missed of {ticks} ticks, {:.1} us of encoding and decoding ({:.1} us)",
            quantile(&mut self.codec_us, 0.5),
            quantile(&mut self.codec_us, 0.99),
        )
    }
}

/// Measures ticks at 1 kHz over a pseudo-terminal with four joints of each protocol, in turns.
pub(crate) fn measured(seconds: u64) -> Outcome<Row> {
    let mut all: [Served; 3] = Default::default();
    for _ in 0..ROUNDS {
        for (served, protocol) in all.iter_mut().zip(PROTOCOLS) {
            served.add(protocol, seconds)?;
        }
    }
    let said: Vec<String> =
        all.iter_mut().zip(PROTOCOLS).map(|(served, protocol)| served.said(protocol.name())).collect();
    let kept = all.iter_mut().all(|served| quantile(&mut served.codec_us, 0.5) < CODEC_US);
    Ok(Row::new(
        &format!(
            "1 kHz over a pseudo-terminal with four joints of each protocol; {ROUNDS} turns of {seconds} s"
        ),
        format!("median of encoding and decoding below {CODEC_US} us a tick"),
        said.join("; "),
        kept,
    ))
}
