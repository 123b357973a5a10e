//! What `stats` answers: how long things took, and how often what went wrong.

use hbot_api::ErrorCode;
use hbot_core::mode::Cause;
use hdrhistogram::Histogram;
use serde_json::{Map, Value, json};

use super::convert;
use crate::flight::Failures;
use hbot_host::sample::{Counters, Sample};

/// The longest time that a histogram tells from longer ones, ns.
const LONGEST_NS: u64 = 10_000_000_000;
/// Three digits: a figure is right to a thousandth.
const DIGITS: u8 = 3;

/// Everything that is counted and measured.
pub(super) struct Stats {
    awake: Histogram<u64>,
    lateness: Histogram<u64>,
    compute: Histogram<u64>,
    link: Histogram<u64>,
    age: Histogram<u64>,
    ticks: u64,
    counters: Counters,
    pub(super) events: Events,
    pub(super) flight_failures: Failures,
}

/// What the service itself counts.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Events {
    /// Faults by cause, in the order of [`Cause::ALL`].
    pub faults: [u64; Cause::ALL.len()],
    /// Times that somebody stopped the rig.
    pub estops: u64,
    /// Requests read, refused ones included.
    pub requests: u64,
    /// Requests refused by code, in the order of [`ErrorCode::ALL`]; stream messages are among them.
    pub refused: [u64; ErrorCode::ALL.len()],
    /// Stream messages refused.
    pub refused_streams: u64,
    /// States that slow readers did not get.
    pub dropped_states: u64,
    /// Connections taken since the start.
    pub connections: u64,
    /// Connections turned away because there were too many.
    pub turned_away: u64,
    /// Connections that were to be encrypted and never were.
    pub handshakes_failed: u64,
    /// Connections cut because their client did not read.
    pub cut: u64,
    /// Flight logs written.
    pub flight_logs: u64,
    /// Flight logs that could not be written.
    pub flight_logs_failed: u64,
}

/// A distribution of times, us.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distribution {
    /// Half were not longer.
    pub p50: f64,
    /// 90 % were not longer.
    pub p90: f64,
    /// 99 % were not longer.
    pub p99: f64,
    /// 99.9 % were not longer.
    pub p99_9: f64,
    /// 99.99 % were not longer.
    pub p99_99: f64,
    /// None was longer.
    pub max: f64,
    /// How many there were.
    pub count: u64,
}

impl Distribution {
    fn of(histogram: &Histogram<u64>) -> Self {
        let at = |quantile| convert::microseconds(histogram.value_at_quantile(quantile));
        Self {
            p50: at(0.5),
            p90: at(0.9),
            p99: at(0.99),
            p99_9: at(0.999),
            p99_99: at(0.9999),
            max: convert::microseconds(histogram.max()),
            count: histogram.len(),
        }
    }

    fn to_json(self) -> Value {
        let Self { p50, p90, p99, p99_9, p99_99, max, count } = self;
        json!({"p50": p50, "p90": p90, "p99": p99, "p99_9": p99_9, "p99_99": p99_99, "max": max, "count": count})
    }
}

/// How a run went.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// Samples that came from the loop.
    pub ticks: u64,
    /// Awake before a tick's deadline, waiting for it.
    pub awake_us: Distribution,
    /// From a tick's deadline to its start.
    pub lateness_us: Distribution,
    /// In the controller.
    pub compute_us: Distribution,
    /// On the serial line.
    pub link_us: Distribution,
    /// From a reading to the torque on the wire.
    pub age_us: Distribution,
    /// What the loop counted.
    pub counters: Counters,
    /// What the service counted.
    pub events: Events,
}

impl Stats {
    /// Nothing yet.
    pub(super) fn new() -> Self {
        let histogram = || {
            Histogram::new_with_bounds(1, LONGEST_NS, DIGITS)
                .unwrap_or_else(|error| unreachable!("the bounds of the histograms are legal: {error}"))
        };
        Self {
            awake: histogram(),
            lateness: histogram(),
            compute: histogram(),
            link: histogram(),
            age: histogram(),
            ticks: 0,
            counters: Counters::default(),
            events: Events::default(),
            flight_failures: Failures::default(),
        }
    }

    /// Takes a sample in.
    #[inline]
    pub(super) fn record(&mut self, sample: &Sample) {
        let timing = &sample.timing;
        self.ticks += 1;
        self.counters = sample.counters;
        self.awake.saturating_record(timing.awake_ns);
        self.lateness.saturating_record(timing.lateness_ns);
        self.compute.saturating_record(timing.compute_ns);
        self.link.saturating_record(timing.link_ns);
        if let Some(age) = timing.age_ns {
            self.age.saturating_record(age);
        }
    }

    pub(super) fn refused(&mut self, code: ErrorCode) {
        if let Some(i) = ErrorCode::ALL.iter().position(|c| *c == code) {
            self.events.refused[i] += 1;
        }
    }

    pub(super) fn fault(&mut self, cause: Cause) {
        if let Some(i) = Cause::ALL.iter().position(|c| *c == cause) {
            self.events.faults[i] += 1;
        }
    }

    pub(super) fn summary(&self) -> Summary {
        Summary {
            ticks: self.ticks,
            awake_us: Distribution::of(&self.awake),
            lateness_us: Distribution::of(&self.lateness),
            compute_us: Distribution::of(&self.compute),
            link_us: Distribution::of(&self.link),
            age_us: Distribution::of(&self.age),
            counters: self.counters,
            events: self.events.clone(),
        }
    }
}

impl Summary {
    /// The same as JSON: the shape of the answer to `stats`.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let Self { counters, events, .. } = self;
        let by_name = |names: &mut dyn Iterator<Item = &'static str>, counts: &[u64]| {
            names.zip(counts).map(|(name, n)| (name.to_owned(), json!(n))).collect::<Map<_, _>>()
        };
        let faults = by_name(&mut Cause::ALL.iter().map(|c| convert::fault(*c).as_str()), &events.faults);
        let refused = by_name(&mut ErrorCode::ALL.iter().map(|c| c.as_str()), &events.refused);
        json!({
            "ticks": self.ticks,
            "awake_us": self.awake_us.to_json(),
            "lateness_us": self.lateness_us.to_json(),
            "compute_us": self.compute_us.to_json(),
            "link_us": self.link_us.to_json(),
            "age_us": self.age_us.to_json(),
            "late_ticks": counters.late,
            "skipped_ticks": counters.skipped,
            "missed_ticks": counters.missed,
            "corrupt_frames": counters.corrupt_frames,
            "foreign_frames": counters.foreign_frames,
            "send_failures": counters.send_failures,
            "reopened_ports": counters.reopened,
            "dropped_samples": counters.dropped_samples,
            "faults": faults,
            "estops": events.estops,
            "requests": events.requests,
            "refused": refused,
            "refused_streams": events.refused_streams,
            "dropped_states": events.dropped_states,
            "connections": events.connections,
            "connections_turned_away": events.turned_away,
            "handshakes_failed": events.handshakes_failed,
            "connections_cut": events.cut,
            "flight_logs": events.flight_logs,
            "flight_logs_failed": events.flight_logs_failed,
        })
    }
}
