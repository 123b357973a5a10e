//! What `stats` answers, as the service measures and counts it.

use hbot_api::{Distribution, StatsOk};
use hdrhistogram::Histogram;

use super::convert;
use super::flights::Flights;
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
    /// Of the last sample.
    counters: Counters,
    /// What is counted elsewhere in the service, in its place in the answer; the rest of it is left at zero.
    pub(super) counts: StatsOk,
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
            counters: Counters::default(),
            counts: StatsOk::default(),
        }
    }

    /// Takes a sample in.
    #[inline]
    pub(super) fn record(&mut self, sample: &Sample) {
        let timing = &sample.timing;
        self.counts.ticks += 1;
        self.counters = sample.counters;
        self.awake.saturating_record(timing.awake_ns);
        self.lateness.saturating_record(timing.lateness_ns);
        self.compute.saturating_record(timing.compute_ns);
        self.link.saturating_record(timing.link_ns);
        if let Some(age) = timing.age_ns {
            self.age.saturating_record(age);
        }
    }

    /// How the run goes until now.
    pub(super) fn summary(&self, flights: &Flights) -> StatsOk {
        let Counters {
            late,
            skipped,
            missed,
            corrupt_frames,
            foreign_frames,
            send_failures,
            reopened,
            dropped_samples,
        } = self.counters;
        StatsOk {
            awake_us: distribution(&self.awake),
            lateness_us: distribution(&self.lateness),
            compute_us: distribution(&self.compute),
            link_us: distribution(&self.link),
            age_us: distribution(&self.age),
            late_ticks: late,
            skipped_ticks: skipped,
            missed_ticks: missed,
            corrupt_frames,
            foreign_frames,
            send_failures,
            reopened_ports: reopened,
            dropped_samples,
            flight_logs: flights.logs(),
            flight_logs_failed: flights.failed(),
            ..self.counts.clone()
        }
    }
}

fn distribution(histogram: &Histogram<u64>) -> Distribution {
    let at = |quantile| convert::microseconds(histogram.value_at_quantile(quantile));
    Distribution {
        p50: at(0.5),
        p90: at(0.9),
        p99: at(0.99),
        p99_9: at(0.999),
        p99_99: at(0.9999),
        max: convert::microseconds(histogram.max()),
        count: histogram.len(),
    }
}
