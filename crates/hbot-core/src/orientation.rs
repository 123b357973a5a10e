//! The orientation of the sphere: integrated turns, corrected by measurements from outside (physics
//! notes, section 4).

use crate::odometry;
use crate::real::{Quat, Real, Vec3};
use crate::rotation::{self, renormalized};
use crate::shaping::limited;

/// Number of past orientations that a controller remembers, one per tick. An
/// [`Align`](crate::inputs::Command::Align) command can be this many ticks old: one second at 1
/// kHz. Older ones are refused.
///
/// Each entry holds a tick number and a quaternion: 40 bytes with f64, 24 with f32. The history is
/// the largest part of a controller. The length is a power of two, so that an index is found
/// without a division.
pub const ALIGN_HISTORY: usize = 1024;

/// The orientation of the sphere with its history.
///
/// The correction from outside is a turn in frame N and is kept apart from the integral of the
/// turns: q = correction * integral. So the history stays valid after later corrections.
#[derive(Debug, Clone)]
pub(crate) struct Orientation {
    /// Orientation of the sphere, a unit quaternion.
    pub(crate) q: Quat,
    integral: Quat,
    correction: Quat,
    /// The part of the correction that is not applied yet, rad, in frame N.
    pending: Vec3,
    history: [(u64, Quat); ALIGN_HISTORY],
}

impl Orientation {
    pub(crate) fn new() -> Self {
        Self {
            q: Quat::IDENTITY,
            integral: Quat::IDENTITY,
            correction: Quat::IDENTITY,
            pending: Vec3::ZERO,
            // Each entry gets a tick number that cannot belong to it, so it matches no tick.
            history: core::array::from_fn(|i| (i as u64 + 1, Quat::IDENTITY)),
        }
    }

    /// Adds a turn (rad, frame N) that was measured at the wheels.
    #[inline]
    pub(crate) fn advance(&mut self, turn: Vec3) {
        self.integral = odometry::advance(self.integral, turn);
    }

    /// Advances the correction by at most `step` rad. Then sets `q` for this tick and records it.
    #[inline]
    pub(crate) fn settle(&mut self, tick: u64, step: Real) {
        self.history[tick as usize % ALIGN_HISTORY] = (tick, self.integral);
        if self.pending != Vec3::ZERO {
            let turn = limited(self.pending, step);
            self.pending -= turn;
            self.correction = renormalized(rotation::exp(turn) * self.correction);
        }
        // Without a correction the integral is the orientation.
        self.q = if self.correction == Quat::IDENTITY {
            self.integral
        } else {
            renormalized(self.correction * self.integral)
        };
    }

    /// Returns the orientation at `tick` with all corrections so far, or `None` if it is not in the
    /// history.
    pub(crate) fn at(&self, tick: u64) -> Option<Quat> {
        let (when, integral) = self.history[tick as usize % ALIGN_HISTORY];
        (when == tick).then(|| self.correction * integral)
    }

    /// Starts to correct the fraction `weight` of `delta` (rad, frame N). Replaces a correction
    /// that is still pending.
    pub(crate) fn correct(&mut self, delta: Vec3, weight: Real) {
        self.pending = delta * weight;
    }
}
