//! The orientation: integrated turns, corrected by what is seen from outside (physics notes, section 4).

use crate::odometry;
use crate::real::{Quat, Real, Vec3};
use crate::rotation::{self, renormalized};
use crate::shaping::limited;

/// Orientations that a controller remembers, one a tick, so that [`Command::Align`](crate::inputs::Command::Align) can be
/// given as late as that: a second at 1 kHz. A later one is refused.
///
/// Each takes a tick's number and a quaternion, 40 bytes with f64 and 24 with f32: the largest part of a controller. A power of two,
/// so that its place is found without a division.
pub const ALIGN_HISTORY: usize = 1024;

/// Where the sphere is.
///
/// The correction from outside is a turn in N, so it is kept apart from the integral: q = correction * integral. The
/// history then holds for any later correction.
#[derive(Debug, Clone)]
pub(crate) struct Orientation {
    /// Where the sphere is, unit.
    pub(crate) q: Quat,
    integral: Quat,
    correction: Quat,
    /// What is still to be corrected, rad in N.
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
            // A tick that can't stand in its place is no tick at all.
            history: core::array::from_fn(|i| (i as u64 + 1, Quat::IDENTITY)),
        }
    }

    /// Adds a turn (rad, in N) that the wheels measured.
    #[inline]
    pub(crate) fn advance(&mut self, turn: Vec3) {
        self.integral = odometry::advance(self.integral, turn);
    }

    /// Moves the correction on by at most `step` rad and settles `q` for this tick.
    #[inline]
    pub(crate) fn settle(&mut self, tick: u64, step: Real) {
        self.history[tick as usize % ALIGN_HISTORY] = (tick, self.integral);
        if self.pending != Vec3::ZERO {
            let turn = limited(self.pending, step);
            self.pending -= turn;
            self.correction = renormalized(rotation::exp(turn) * self.correction);
        }
        // Without any correction the integral is the orientation.
        self.q = if self.correction == Quat::IDENTITY {
            self.integral
        } else {
            renormalized(self.correction * self.integral)
        };
    }

    /// The orientation at `tick`, by what is known now.
    pub(crate) fn at(&self, tick: u64) -> Option<Quat> {
        let (when, integral) = self.history[tick as usize % ALIGN_HISTORY];
        (when == tick).then(|| self.correction * integral)
    }

    /// Takes over the part `weight` of `delta` (rad, in N), in place of what was pending.
    pub(crate) fn correct(&mut self, delta: Vec3, weight: Real) {
        self.pending = delta * weight;
    }
}
