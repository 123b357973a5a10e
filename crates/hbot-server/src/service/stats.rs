//! The statistics that `stats` returns, as the service measures and counts them.

use std::sync::Arc;

use hbot_api::{Distribution, StatsOk};
use hdrhistogram::Histogram;

use super::convert;
use super::flights::Flights;
use crate::recording::{Counts, Recorded};
use hbot_host::run_loop::sample::{Counters, Sample};

/// Longest time that the histograms can record, ns. Longer times are recorded as this one.
const LONGEST_NS: u64 = 10_000_000_000;
/// Significant decimal digits of the histograms. Three digits keep the error of a recorded time
/// below one thousandth.
const DIGITS: u8 = 3;

/// All counters and histograms of a run, from which the answer to `stats` is made.
pub(super) struct Stats {
    awake: Histogram<u64>,
    lateness: Histogram<u64>,
    compute: Histogram<u64>,
    link: Histogram<u64>,
    age: Histogram<u64>,
    /// Counters of the loop, as of the last sample.
    counters: Counters,
    recorded: Arc<Counts>,
    /// Counters that other parts of the service increment, as fields of the answer to `stats`. Its
    /// other fields stay at zero.
    pub(super) counts: StatsOk,
}

impl Stats {
    /// Creates empty statistics. `recorded` are the counters of the recorder.
    pub(super) fn new(recorded: Arc<Counts>) -> Self {
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
            recorded,
            counts: StatsOk::default(),
        }
    }

    /// Adds the timing and the counters of a sample to the statistics.
    #[inline]
    pub(super) fn record(&mut self, sample: &Sample) {
        let timing = &sample.timing;
        self.counts.ticks += 1;
        self.counters = sample.counters;
        self.awake.saturating_record(timing.awake_ns);
        self.lateness.saturating_record(timing.lateness_ns);
        self.compute.saturating_record(timing.compute_ns);
        self.link.saturating_record(timing.line_ns);
        if let Some(age) = timing.age_ns {
            self.age.saturating_record(age);
        }
    }

    /// Returns the statistics of the run so far.
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
        let Recorded { written, lost, failed_files } = self.recorded.now();
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
            recorded_ticks: written,
            unrecorded_ticks: lost,
            recordings_failed: failed_files,
            dropped_live: self.recorded.dropped_for_viewers(),
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
