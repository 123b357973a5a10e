//! The samples of the last seconds, in bounded memory at any rate.

use std::collections::VecDeque;
use std::sync::Arc;

use glam::DVec3;
use hbot_api::StateEvent;

/// Largest number of samples kept for the plots: 30 s at 1 kHz, 20 MB.
const MAX_SAMPLES: usize = 32_768;

/// Longest time that the plots can show, in seconds of the control loop's time.
pub(crate) const SPAN_S: f64 = 30.0;

/// The states of the last [`SPAN_S`] seconds, in order of time. If samples arrive so fast that
/// they would need too much memory, some are skipped.
#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    samples: VecDeque<Arc<StateEvent>>,
}

impl History {
    pub(crate) fn push(&mut self, sample: Arc<StateEvent>) {
        if let Some(last) = self.samples.back() {
            if sample.tick <= last.tick {
                // A tick number that does not increase means another server or a restart, with
                // another clock.
                self.samples.clear();
            } else if sample.t - last.t < SPAN_S / MAX_SAMPLES as f64 {
                return;
            }
        }
        if self.samples.len() == MAX_SAMPLES {
            self.samples.pop_front();
        }
        while self.samples.front().is_some_and(|first| sample.t - first.t > SPAN_S) {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// Returns the samples of the last `seconds` seconds, oldest first.
    pub(crate) fn last(&self, seconds: f64) -> impl ExactSizeIterator<Item = &Arc<StateEvent>> + Clone {
        let from = self.newest().map_or(0.0, |newest| newest.t - seconds);
        let start = self.samples.partition_point(|sample| sample.t < from);
        self.samples.range(start..)
    }

    /// Returns the largest speed of the sphere in the last `seconds` seconds, rad/s.
    pub(crate) fn fastest(&self, seconds: f64) -> f64 {
        self.last(seconds).map(|sample| DVec3::from(sample.omega).length()).fold(0.0, f64::max)
    }

    /// Returns the largest torque on the sphere in the last `seconds` seconds, N m.
    pub(crate) fn strongest(&self, seconds: f64) -> f64 {
        self.last(seconds).map(|sample| DVec3::from(sample.torque).length()).fold(0.0, f64::max)
    }

    /// Returns whether the torque was at least `torque`, N m, in all of the last `seconds` seconds.
    pub(crate) fn pushes_with(&self, torque: f64, seconds: f64) -> bool {
        let known = self.samples.front().zip(self.newest());
        known.is_some_and(|(first, newest)| newest.t - first.t >= seconds)
            && self.last(seconds).all(|sample| DVec3::from(sample.torque).length() >= torque)
    }

    pub(crate) fn newest(&self) -> Option<&StateEvent> {
        self.samples.back().map(Arc::as_ref)
    }

    pub(crate) fn clear(&mut self) {
        self.samples.clear();
    }
}

/// Reduces the points of a curve so that they can be drawn quickly in a plot of `columns` columns:
/// keeps the lowest and the highest point of each column, in order of time. Every spike stays
/// visible.
pub(crate) fn thinned(samples: impl Iterator<Item = [f64; 2]>, columns: usize) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = samples.collect();
    let width = points.len().div_ceil(columns.max(1));
    if width <= 2 {
        return points;
    }
    let ends = |column: &[[f64; 2]]| {
        let height = |a: &&[f64; 2], b: &&[f64; 2]| a[1].total_cmp(&b[1]);
        let low = column.iter().min_by(height).copied();
        let high = column.iter().min_by(|a, b| height(b, a)).copied();
        let mut ends = Vec::from_iter(low.into_iter().chain(high));
        ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
        ends.dedup();
        ends
    };
    points.chunks(width).flat_map(ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(tick: u64, rate_hz: f64) -> Arc<StateEvent> {
        Arc::new(StateEvent { tick, t: tick as f64 / rate_hz, ..StateEvent::default() })
    }

    #[test]
    fn memory_is_bounded_and_spans_30_s_at_any_rate() {
        for rate_hz in [100.0, 1000.0, 10_000.0] {
            let mut history = History::default();
            let ticks = (40.0 * rate_hz) as u64;
            (0..ticks).for_each(|tick| history.push(sample(tick, rate_hz)));
            assert!(history.samples.len() <= MAX_SAMPLES);
            let oldest = history.last(f64::INFINITY).next().expect("samples").t;
            let span = history.newest().expect("samples").t - oldest;
            // The tolerance is one sample, or one of 32,768 samples if samples are skipped.
            assert!((span - SPAN_S).abs() < 0.02, "{span} s at {rate_hz} Hz");
        }
    }

    #[test]
    fn at_1_khz_no_sample_is_passed_over() {
        let mut history = History::default();
        (0..30_000).for_each(|tick| history.push(sample(tick, 1000.0)));
        assert_eq!(history.samples.len(), 30_000);
        assert_eq!(history.last(1.0).len(), 1001);
    }

    #[test]
    fn a_clock_that_begins_again_begins_a_new_history() {
        let mut history = History::default();
        (0..100).for_each(|tick| history.push(sample(tick, 100.0)));
        history.push(sample(3, 100.0));
        assert_eq!(history.samples.len(), 1);
    }

    #[test]
    fn a_torque_counts_that_lasts() {
        let mut history = History::default();
        for tick in 0..800 {
            let torque = [0.0, if tick < 100 { 0.1 } else { 0.9 }, 0.0];
            let state = StateEvent { tick, t: tick as f64 / 1000.0, torque, ..StateEvent::default() };
            history.push(Arc::new(state));
            let lasts = tick >= 300;
            assert_eq!(history.pushes_with(0.85, 0.2), lasts, "tick {tick}");
        }
        let mut new = History::default();
        (0..100).for_each(|tick| new.push(sample(tick, 1000.0)));
        assert!(!new.pushes_with(0.0, 0.2), "0.1 s is all that is known");
    }

    #[test]
    fn a_thinned_curve_keeps_its_spikes() {
        let curve = (0..10_000).map(|k| [f64::from(k), if k == 4321 { 9.0 } else { 0.0 }]);
        let thin = thinned(curve, 300);
        assert!(thin.len() <= 602, "{}", thin.len());
        assert!(thin.contains(&[4321.0, 9.0]));
        assert!(thin.windows(2).all(|w| w[0][0] < w[1][0]), "in order");
    }
}
