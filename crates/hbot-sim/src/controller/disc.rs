//! The errors of one joint's encoder.

use core::f64::consts::TAU;

use hbot_core::design::device::MAX_JOINTS;
use oorandom::Rand64;

use crate::phenomena::Encoder;

/// The errors of one simulated encoder: coarse resolution, a code disc that is mounted off centre,
/// and a zero at a wrong angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    step: i64,
    /// Amplitude of the error that the off-centre disc causes, in rad of the encoder's shaft. The
    /// error repeats with every turn of the shaft.
    amplitude: f64,
    phase: f64,
    /// Angle by which the encoder's zero is wrong, in rad of the joint.
    pub(super) zero_off: f64,
}

impl Disc {
    /// Creates the errors of all joints' encoders. The seed in `encoder` determines the phase of
    /// each disc and the error of each zero.
    pub(super) fn all(encoder: &Encoder) -> Box<[Self; MAX_JOINTS]> {
        let mut random = Rand64::new(u128::from(encoder.seed));
        Box::new(core::array::from_fn(|_| Self {
            step: i64::from(encoder.step.max(1)),
            amplitude: encoder.turn_error,
            phase: TAU * random.rand_float(),
            zero_off: encoder.index_error * (2.0 * random.rand_float() - 1.0),
        }))
    }

    /// Returns the error of the angle that the encoder reads, in rad of the joint. `angle` is the
    /// joint's true angle (rad), and `gear` is the number of encoder turns per joint turn.
    pub(super) fn error(&self, angle: f64, gear: f64) -> f64 {
        self.amplitude / gear * libm::sin(angle * gear + self.phase)
    }

    /// Returns the angle that the encoder reads if the joint's true angle is `angle`, in rad of the
    /// joint. `gear` is the number of encoder turns per joint turn.
    pub(super) fn reading(&self, angle: f64, gear: f64) -> f64 {
        angle + self.error(angle, gear)
    }

    /// Returns the ratio of the rate that the encoder reads to the joint's true rate, at the true
    /// angle `angle` (rad).
    pub(super) fn slope(&self, angle: f64, gear: f64) -> f64 {
        1.0 + self.amplitude * libm::cos(angle * gear + self.phase)
    }

    /// Rounds an encoder count down to a multiple of the encoder's step.
    pub(super) fn coarse(&self, count: i64) -> i64 {
        count.div_euclid(self.step) * self.step
    }
}
