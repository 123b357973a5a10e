//! The cogging of a motor: a torque that repeats with the angle of its rotor.

use crate::design::rig::Harmonic;
use crate::real::{Real, sincos};

/// Phase that a harmonic may advance in a tick until less of it is fed forward, rad. At twice this
/// phase nothing is fed forward. The torque is held for a tick, so it can no longer follow.
const FAST: Real = 0.5;

impl Harmonic {
    /// Returns the torque that the harmonic makes when the torque of this tick acts, N m. The
    /// encoder's shaft was at the angle `shaft.0` (rad) in the reading and turns at the rate
    /// `shaft.1` (rad/s). `times` are the period of the loop and the delay from the reading to the
    /// middle of the torque, s.
    #[inline]
    pub(super) fn torque(&self, shaft: (Real, Real), times: (Real, Real)) -> Real {
        let ((angle, rate), (period, delay)) = (shaft, times);
        let fast = crate::real::fabs(rate) * self.per_turn as Real * period / FAST;
        let left = (2.0 - fast).clamp(0.0, 1.0);
        if left == 0.0 {
            return 0.0;
        }
        let at = (angle + rate * delay) * self.per_turn as Real + self.phase;
        self.amplitude * left * sincos(at).0
    }
}
