//! What flight logs and a recording cost the loop: servers with and without one, in alternation.

use std::time::Duration;

use crate::bench::WatchedServer;
use crate::timing::{median, quantile};
use crate::{Outcome, Row, Setup};

/// Number of blocks if no total time is wanted. A block is one measurement of each server.
const BLOCKS: u64 = 5;
/// Largest ratio of the medians of lateness and computing time, with a recording to without.
const RATIO: f64 = 1.02;
/// Time after the start of a server until its memory is read for the first time. It has then
/// written the first chunks.
const WARM: Duration = Duration::from_secs(2);

/// What a server keeps of its ticks.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Server {
    /// Nothing receives the ticks of the loop.
    Bare,
    /// The last seconds are kept in memory for flight logs, as by default.
    Flights,
    /// As `Flights`, and all ticks are recorded to a file.
    Records,
}

impl Server {
    /// Returns the option that makes a server of this kind, and its name in a sentence.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Bare => ("hbot server", "Without"),
            Self::Flights => ("Flight logs", "With flight logs"),
            Self::Records => ("`hbot server --record`", "With a recording"),
        }
    }
}

/// What one server did in one measurement.
#[derive(Clone, Copy, Default)]
struct Run {
    lateness_us: f64,
    lateness_99_us: f64,
    compute_us: f64,
    late: u64,
    skipped: u64,
    ticks: u64,
    recorded: u64,
    lost: u64,
    /// Size of the recording when the server has ended, bytes.
    bytes: u64,
    /// Resident memory at the begin and at the end, bytes.
    resident: [u64; 2],
}

impl Run {
    fn of(server: Server, rate_hz: u32, seconds: u64) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("run.mcap");
        let record = (server == Server::Records).then_some(file.as_path());
        let mut bench = WatchedServer::recording(rate_hz, server != Server::Bare, record)?;
        std::thread::sleep(WARM);
        let begun = bench.resident()?;
        std::thread::sleep(Duration::from_secs(seconds));
        let (stats, ended) = (bench.stats()?, bench.resident()?);
        bench.stop()?;
        Ok(Self {
            lateness_us: stats.lateness_us.p50,
            lateness_99_us: stats.lateness_us.p99,
            compute_us: stats.compute_us.p50,
            late: stats.late_ticks,
            skipped: stats.skipped_ticks,
            ticks: stats.ticks,
            recorded: stats.recorded_ticks,
            lost: stats.unrecorded_ticks,
            bytes: if record.is_some() { std::fs::metadata(&file)?.len() } else { 0 },
            resident: [begun, ended],
        })
    }
}

struct Runs(Vec<Run>);

impl Runs {
    fn median(&self, value: fn(&Run) -> f64) -> f64 {
        median(self.0.iter().map(value).collect())
    }

    fn sum(&self, value: fn(&Run) -> u64) -> u64 {
        self.0.iter().map(value).sum()
    }

    /// Returns the quartiles over the blocks of the ratio of a value to that of `other` in the same
    /// block.
    fn ratios(&self, other: &Self, value: fn(&Run) -> f64) -> [f64; 3] {
        let mut all: Vec<f64> =
            self.0.iter().zip(&other.0).map(|(run, other)| value(run) / value(other)).collect();
        [0.25, 0.5, 0.75].map(|part| quantile(&mut all, part))
    }

    fn said(&self, name: &str) -> String {
        let [begun, ended] = [0, 1].map(|k| {
            let mut all: Vec<f64> = self.0.iter().map(|run| run.resident[k] as f64 * 1e-6).collect();
            quantile(&mut all, 0.5)
        });
        format!(
            "{name}: lateness {:.3} us (99 %: {:.1} us), computing time {:.3} us, {} late and {} skipped of {} ticks, \
             resident memory {begun:.1} MB at the begin and {ended:.1} MB at the end",
            self.median(|run| run.lateness_us),
            self.median(|run| run.lateness_99_us),
            self.median(|run| run.compute_us),
            self.sum(|run| run.late),
            self.sum(|run| run.skipped),
            self.sum(|run| run.ticks),
        )
    }
}

/// Measures lateness, computing time and memory of servers that keep nothing and of others of the
/// kind `server`, block after block. In every second block the order is reversed, so that a steady
/// drift of the machine affects both equally.
pub(crate) fn measured(rate_hz: u32, server: Server, on: Setup) -> Outcome<Row> {
    let blocks = on.total.map_or(BLOCKS, |total| total.div_ceil(on.seconds).max(1));
    let servers = [Server::Bare, server];
    let mut all = servers.map(|_| Runs(Vec::new()));
    for block in 0..blocks {
        let order = if block % 2 == 0 { [0, 1] } else { [1, 0] };
        for k in order {
            all[k].0.push(Run::of(servers[k], rate_hz, on.seconds)?);
        }
    }
    let [bare, kept] = &all;
    let ratios = [kept.ratios(bare, |run| run.lateness_us), kept.ratios(bare, |run| run.compute_us)];
    let (fault, name) = server.names();
    let [late, compute] = ratios
        .map(|[low, median, high]| format!("{median:.3} times (half of the blocks {low:.3} to {high:.3})"));
    let mut found = format!("lateness {late}, computing time {compute}");
    let lost = kept.sum(|run| run.lost);
    if server == Server::Records {
        // The recording also has the ticks after the statistics were read: less than a thousandth.
        let hourly = kept.sum(|run| run.bytes) as f64 / kept.sum(|run| run.recorded).max(1) as f64
            * f64::from(rate_hz)
            * 3600e-6;
        found += &format!("; {lost} ticks lost, {hourly:.0} MB an hour");
    }
    Ok(Row::new(
        &format!("{fault} at {rate_hz} Hz; {blocks} blocks of {} s without and with", on.seconds),
        format!(
            "medians of lateness and computing time at most {RATIO} times those without; no tick is lost"
        ),
        format!("{found}. {}; {}", bare.said(Server::Bare.names().1), kept.said(name)),
        ratios.iter().all(|[_, median, _]| *median <= RATIO) && lost == 0,
    ))
}
