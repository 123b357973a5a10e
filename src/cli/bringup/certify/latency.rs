//! What a recording says about times: how old readings are, and how late ticks are.

use std::path::Path;

use anyhow::Context as _;
use hbot_record::exact::{FORMAT, OLDEST};
use hbot_record::reader::Item;
use hbot_record::{Exact, Reader, Topic};

use crate::cli::record::open_recording;

/// Times of all ticks of recordings with a reading, s.
#[derive(Debug, Clone, Default)]
pub(super) struct Latency {
    ages: Vec<f64>,
    lateness: Vec<f64>,
}

impl Latency {
    /// Adds the times of the recording `run`.
    pub(super) fn read(&mut self, run: &Path) -> anyhow::Result<()> {
        let name = || run.display().to_string();
        let mut reader = Reader::new(open_recording(run)?).with_context(name)?;
        let (mut format, mut period_s) = (FORMAT, 1.0e-3);
        while let Some(item) = reader.next().with_context(name)? {
            match item {
                Item::About(about) => {
                    let number = |key: &str| about.get(key).and_then(|text| text.parse::<u64>().ok());
                    let known = number("format").and_then(|it| u32::try_from(it).ok());
                    format = known.filter(|it| (OLDEST..=FORMAT).contains(it)).unwrap_or(FORMAT);
                    period_s = number("period_ns").map_or(period_s, |ns| ns as f64 * 1.0e-9);
                }
                Item::Message { topic, data, .. } if topic == Topic::Exact.name() => {
                    let Ok(Exact::Tick(tick)) = Exact::read_from(format, &data) else { continue };
                    let inputs = &tick.0;
                    if let Some(reading) = &inputs.feedback {
                        let ticks = (inputs.tick as u32).wrapping_sub(reading.sequence);
                        self.ages.push(f64::from(ticks) * period_s);
                        self.lateness.push(inputs.lateness_ns as f64 * 1.0e-9);
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Returns the number of ticks with a reading.
    pub(super) fn ticks(&self) -> usize {
        self.ages.len()
    }

    /// Returns whether no tick was late at all, as in virtual time.
    pub(super) fn is_virtual(&self) -> bool {
        self.lateness.iter().all(|late| *late == 0.0)
    }

    /// Returns the median, two quantiles and the largest age of a reading, s.
    pub(super) fn age(&self) -> [f64; 4] {
        spread(self.ages.clone())
    }

    /// Returns the same of the lateness of a tick, s.
    pub(super) fn lateness(&self) -> [f64; 4] {
        spread(self.lateness.clone())
    }

    /// Returns the same of the time from a reading to its torque. The motors lag by `lag_s`.
    pub(super) fn whole(&self, lag_s: f64) -> [f64; 4] {
        spread(self.ages.iter().zip(&self.lateness).map(|(age, late)| age + late + lag_s).collect())
    }
}

/// Returns the median, the quantiles 95 % and 99.9 %, and the largest of `values`.
fn spread(mut values: Vec<f64>) -> [f64; 4] {
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    [0.5, 0.95, 0.999, 1.0]
        .map(|part| values.get((part * last as f64).round() as usize).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_a_hundred_values() {
        assert_eq!(spread((0..=100).map(f64::from).collect()), [50.0, 95.0, 100.0, 100.0]);
        assert_eq!(spread(Vec::new()), [0.0; 4]);
    }
}
