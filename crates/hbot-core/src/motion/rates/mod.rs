//! Estimates joint rates from counts. The rig file selects the method with `rate_estimate` (physics
//! notes, section 9).
//!
//! All methods use integer counts and the time between the commands that the readings answer. So a
//! missed reading or a late tick makes a step longer, and no estimate becomes wrong. Memory and
//! time are bounded for any input.

mod kalman;
mod window;

use crate::design::device::MAX_JOINTS;
use crate::design::rig::{RateEstimate, Rig};
use crate::motion::encoder::Encoder;
use crate::real::{Real, TURN, exp};
use kalman::Kalman;
use window::Window;

/// How far the joints have moved between two readings.
#[derive(Clone, Copy)]
pub(crate) struct Moved<'a> {
    /// Change of each joint's angle, rad.
    pub(crate) delta: &'a [Real; MAX_JOINTS],
    /// Change of each joint in encoder counts, in the direction of its motor controller.
    pub(crate) counts: &'a [i32; MAX_JOINTS],
    /// Time between the two readings, in ticks. It has a fraction if a tick began late.
    pub(crate) ticks: Real,
}

/// Estimates the rates of all joints from encoder counts, with the memory that the selected method
/// needs.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
#[allow(clippy::large_enum_variant, reason = "there is one, and no heap to put the larger ones on")]
pub(crate) enum Rates {
    /// No estimate: the rates are those that the motor controllers report.
    Reported,
    Difference,
    LowPass {
        /// Corner frequency of the low-pass filter, rad/s.
        corner: Real,
        rate: [Real; MAX_JOINTS],
    },
    Window(Window),
    Kalman(Kalman),
}

impl Rates {
    pub(crate) fn new(rig: &Rig, encoders: &[Encoder; MAX_JOINTS]) -> Self {
        match rig.methods.rate {
            RateEstimate::Controller => Self::Reported,
            RateEstimate::Difference => Self::Difference,
            RateEstimate::LowPass { cutoff_hz } => {
                Self::LowPass { corner: TURN * cutoff_hz, rate: [0.0; MAX_JOINTS] }
            }
            RateEstimate::AdaptiveWindow { tolerance_counts, longest_ticks } => {
                Self::Window(Window::new(tolerance_counts, longest_ticks))
            }
            RateEstimate::Kalman { acceleration } => {
                let per_count = core::array::from_fn(|i| encoders[i].radians_per_count());
                Self::Kalman(Kalman::new(acceleration, &per_count, rig.timing.period_s()))
            }
        }
    }

    /// Discards all readings. The estimate starts anew with the next reading.
    pub(crate) fn restart(&mut self) {
        match self {
            Self::Reported | Self::Difference => {}
            Self::LowPass { rate, .. } => *rate = [0.0; MAX_JOINTS],
            Self::Window(window) => window.restart(),
            Self::Kalman(kalman) => kalman.restart(),
        }
    }

    /// Replaces the rates in `rates`, which the motor controllers have reported, by the estimated
    /// rates at the newest reading, rad/s.
    #[inline]
    pub(crate) fn advance(
        &mut self,
        rig: &Rig,
        encoders: &[Encoder; MAX_JOINTS],
        moved: &Moved<'_>,
        rates: &mut [Real; MAX_JOINTS],
    ) {
        let n = rig.device.joints();
        let period = rig.timing.period_s();
        let time = moved.ticks * period;
        match self {
            Self::Reported => {}
            Self::Difference => {
                for i in 0..n {
                    rates[i] = moved.delta[i] / time;
                }
            }
            Self::LowPass { corner, rate } => {
                // The exact response of the filter to a constant rate over a step of any length.
                let part = 1.0 - exp(-*corner * time);
                for i in 0..n {
                    rate[i] += part * (moved.delta[i] / time - rate[i]);
                }
                rates[..n].copy_from_slice(&rate[..n]);
            }
            Self::Window(window) => {
                window.push(moved.counts, (moved.ticks + 0.5).max(1.0) as u32);
                for i in 0..n {
                    rates[i] = window.slope(i) * (encoders[i].radians_per_count() / period);
                }
            }
            Self::Kalman(kalman) => {
                kalman.push(&moved.counts[..n], moved.ticks);
                for i in 0..n {
                    rates[i] = kalman.slope(i) * (encoders[i].radians_per_count() / period);
                }
            }
        }
    }
}

/// Fills `out` with the rates (rad/s) that the rig's method estimates for `joint` at the readings
/// after a step of its angle, divided by the step (rad). The first is that of the reading with the
/// step itself. Returns false if the rates are those of the motor controllers.
///
/// The differences of these numbers are the weights that the method gives to the newest and to
/// earlier angles. An adaptive window has no such weights of its own; it has those of the chord
/// over the two readings about the step.
#[must_use]
pub fn step_response(rig: &Rig, joint: usize, out: &mut [Real]) -> bool {
    /// Counts of the step: far above their rounding, and legal for any counter.
    const STEP: i32 = 1_000_000;
    /// Readings at rest before the step, after which a Kalman filter has its final gains.
    const SETTLED: u32 = 512;
    let encoders = rig.joints.map(|joint| Encoder::new(&joint));
    let mut rates = Rates::new(rig, &encoders);
    if matches!(rates, Rates::Reported) {
        return false;
    }
    let per_count = encoders[joint].radians_per_count();
    let mut advance = |step: i32| {
        let (mut delta, mut counts, mut found) = ([0.0; MAX_JOINTS], [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        (delta[joint], counts[joint]) = (per_count * step as Real, step);
        rates.advance(rig, &encoders, &Moved { delta: &delta, counts: &counts, ticks: 1.0 }, &mut found);
        found[joint] / (per_count * STEP as Real)
    };
    (0..SETTLED).for_each(|_| _ = advance(0));
    for (k, rate) in out.iter_mut().enumerate() {
        *rate = advance(if k == 0 { STEP } else { 0 });
    }
    true
}

/// Converts a `Real` to `f64`. In the build in which `Real` is `f64`, it does nothing.
#[cfg(test)]
#[allow(clippy::useless_conversion, reason = "the same line converts f32 in hbot-core-f32")]
fn wide(x: Real) -> f64 {
    f64::from(x)
}
