//! The errors of one joint's encoder.

use core::f64::consts::TAU;

use hbot_core::device::MAX_JOINTS;
use oorandom::Rand64;

use crate::phenomena::Encoder;

/// The errors of one simulated encoder: coarse counts, an off-centre disc, and a wrong zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    step: i64,
    /// Amplitude of the error that repeats every turn, rad of the encoder.
    amplitude: f64,
    phase: f64,
    /// Error of the zero, rad of the joint.
    pub(super) zero_off: f64,
}

impl Disc {
    /// Creates the encoder errors of all joints. The seed determines their phases and zero errors.
    pub(super) fn all(encoder: &Encoder) -> Box<[Self; MAX_JOINTS]> {
        let mut random = Rand64::new(u128::from(encoder.seed));
        Box::new(core::array::from_fn(|_| Self {
            step: i64::from(encoder.step.max(1)),
            amplitude: encoder.turn_error,
            phase: TAU * random.rand_float(),
            zero_off: encoder.index_error * (2.0 * random.rand_float() - 1.0),
        }))
    }

    /// Returns the angle error of the encoder at a joint angle (rad) behind `gear`, rad of the
    /// joint.
    pub(super) fn error(&self, angle: f64, gear: f64) -> f64 {
        self.amplitude / gear * libm::sin(angle * gear + self.phase)
    }

    /// Returns the angle that the encoder reads at a joint angle, rad of the joint.
    pub(super) fn reading(&self, angle: f64, gear: f64) -> f64 {
        angle + self.error(angle, gear)
    }

    /// Returns the rate that the encoder reads divided by the true joint rate.
    pub(super) fn slope(&self, angle: f64, gear: f64) -> f64 {
        1.0 + self.amplitude * libm::cos(angle * gear + self.phase)
    }

    /// Rounds a count down to the step of the encoder.
    pub(super) fn coarse(&self, count: i64) -> i64 {
        count.div_euclid(self.step) * self.step
    }
}
