//! The errors of one joint's encoder.

use core::f64::consts::TAU;

use hbot_core::device::MAX_JOINTS;
use oorandom::Rand64;

use crate::phenomena::Encoder;

/// The disc of one encoder: what it reads of a shaft's angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    step: i64,
    /// rad of the encoder.
    amplitude: f64,
    phase: f64,
    /// How far its zero is off, rad of the joint.
    pub(super) zero_off: f64,
}

impl Disc {
    /// One for each joint, their phases and zeros by the seed.
    pub(super) fn all(encoder: &Encoder) -> Box<[Self; MAX_JOINTS]> {
        let mut random = Rand64::new(u128::from(encoder.seed));
        Box::new(core::array::from_fn(|_| Self {
            step: i64::from(encoder.step.max(1)),
            amplitude: encoder.turn_error,
            phase: TAU * random.rand_float(),
            zero_off: encoder.index_error * (2.0 * random.rand_float() - 1.0),
        }))
    }

    /// What it adds to a joint's angle (rad) behind `gear`, rad of the joint.
    pub(super) fn error(&self, angle: f64, gear: f64) -> f64 {
        self.amplitude / gear * libm::sin(angle * gear + self.phase)
    }

    /// What it reads at a joint's angle, rad of the joint.
    pub(super) fn reading(&self, angle: f64, gear: f64) -> f64 {
        angle + self.error(angle, gear)
    }

    /// The rate that it reads over the joint's.
    pub(super) fn slope(&self, angle: f64, gear: f64) -> f64 {
        1.0 + self.amplitude * libm::cos(angle * gear + self.phase)
    }

    /// A count as coarse as the encoder is.
    pub(super) fn coarse(&self, count: i64) -> i64 {
        count.div_euclid(self.step) * self.step
    }
}
