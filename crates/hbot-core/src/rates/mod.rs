//! Joint rates from counts: what the rig file names as `rate_estimate` (physics notes, section 9).
//!
//! All work on integer counts and on the ticks between the readings that feedback answers, so missed readings make a step
//! longer and no estimate wrong. Memory and time are bounded whatever comes in.

mod kalman;
mod window;

use crate::device::MAX_JOINTS;
use crate::encoder::Encoder;
use crate::real::{Real, TURN, exp};
use crate::rig::{RateEstimate, Rig};
use kalman::Kalman;
use window::Window;

/// What the joints did between two readings.
#[derive(Clone, Copy)]
pub(crate) struct Moved<'a> {
    /// The turn of each joint, rad.
    pub(crate) delta: &'a [Real; MAX_JOINTS],
    /// The same in counts, in the controllers' sense.
    pub(crate) counts: &'a [i32; MAX_JOINTS],
    /// Ticks between the two; at least 1.
    pub(crate) ticks: u32,
}

/// One estimator for all joints, with its memory.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant, reason = "there is one, and no heap to put the larger ones on")]
pub(crate) enum Rates {
    /// Needs none: the controllers say.
    Reported,
    Difference,
    LowPass {
        /// Corner, rad/s.
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

    /// Forgets what was read: the next reading is the second one.
    pub(crate) fn restart(&mut self) {
        match self {
            Self::Reported | Self::Difference => {}
            Self::LowPass { rate, .. } => *rate = [0.0; MAX_JOINTS],
            Self::Window(window) => window.restart(),
            Self::Kalman(kalman) => kalman.restart(),
        }
    }

    /// Puts the estimates for the newest reading, rad/s, in place of the rates that the controllers report.
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
        let time = moved.ticks as Real * period;
        match self {
            Self::Reported => {}
            Self::Difference => {
                for i in 0..n {
                    rates[i] = moved.delta[i] / time;
                }
            }
            Self::LowPass { corner, rate } => {
                // The filter's exact answer to a rate held over the step, however long that was.
                let part = 1.0 - exp(-*corner * time);
                for i in 0..n {
                    rate[i] += part * (moved.delta[i] / time - rate[i]);
                }
                rates[..n].copy_from_slice(&rate[..n]);
            }
            Self::Window(window) => {
                window.push(moved.counts, moved.ticks);
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

/// A real in 64 bits. One width of the two makes the conversion a no-op.
#[cfg(test)]
#[allow(clippy::useless_conversion, reason = "the same line converts f32 in hbot-core-f32")]
fn wide(x: Real) -> f64 {
    f64::from(x)
}
