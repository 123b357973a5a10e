//! The orientation of the sphere: integrated turns, corrected by measurements from outside (physics
//! notes, section 4).

use crate::linear::limited;
use crate::motion::odometry;
use crate::motion::reference::combined;
use crate::real::{Quat, Real, Vec3};
use crate::rotation::{exp, renormalized};

/// Number of past orientations that a controller stores, one per tick. It limits how old an
/// [`Align`](crate::inputs::Command::Align) command can be: one second at 1 kHz. Older commands are
/// refused.
///
/// Each entry holds a tick number and a quaternion: 40 bytes with f64, 24 with f32. The history is
/// the largest part of a controller. Its length is a power of two, so that an index is computed
/// without a division.
pub const ALIGN_HISTORY: usize = 1024;

/// The orientation of the sphere and its history.
///
/// The orientation is q = integral * correction. The integral comes from the turns measured at the
/// wheels, the correction from independent measurements. The wheels measure turns in frame N, which
/// multiply from the left. So the correction stands on the right: on the left it would turn the
/// axes of all later turns. The history contains only the integral, so later corrections also apply
/// to past orientations.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Orientation {
    /// Orientation of the sphere, a unit quaternion.
    pub(crate) q: Quat,
    integral: Quat,
    correction: Quat,
    /// The part of the correction that is not applied yet, as a rotation vector in the sphere's
    /// axes, in rad.
    pending: Vec3,
    /// True if a measurement from outside has ever corrected the orientation. Until then, the
    /// integral is the orientation.
    corrected: bool,
    #[cfg_attr(feature = "exact", serde(with = "serde_big_array::BigArray"))]
    history: [(u64, Quat); ALIGN_HISTORY],
}

impl Orientation {
    pub(crate) fn new() -> Self {
        Self {
            q: Quat::IDENTITY,
            integral: Quat::IDENTITY,
            correction: Quat::IDENTITY,
            pending: Vec3::ZERO,
            corrected: false,
            // Each entry gets a tick number that cannot belong to it, so it matches no tick.
            history: core::array::from_fn(|i| (i as u64 + 1, Quat::IDENTITY)),
        }
    }

    /// Adds a turn of the sphere that was measured at the wheels (rotation vector in frame N, rad).
    #[inline(always)]
    pub(crate) fn advance(&mut self, turn: Vec3) {
        self.integral = odometry::advance(self.integral, turn);
    }

    /// Ends the orientation of tick `tick`: applies at most `step` rad of the pending correction,
    /// sets `q`, and adds an entry to the history.
    #[inline(always)]
    pub(crate) fn settle(&mut self, tick: u64, step: Real) {
        self.history[tick as usize % ALIGN_HISTORY] = (tick, self.integral);
        if !self.corrected {
            self.q = self.integral;
            return;
        }
        if self.pending != Vec3::ZERO {
            let turn = limited(self.pending, step);
            self.pending -= turn;
            self.correction = renormalized(self.correction * exp(turn));
        }
        // A correction of zero leaves the bits of the integral.
        self.q = if self.correction == Quat::IDENTITY {
            self.integral
        } else {
            renormalized(self.integral * self.correction)
        };
    }

    /// Returns the orientation of the sphere at tick `tick`, with all corrections until now.
    /// Returns `None` if the tick is not in the history.
    pub(crate) fn at(&self, tick: u64) -> Option<Quat> {
        let (when, integral) = self.history[tick as usize % ALIGN_HISTORY];
        (when == tick).then(|| integral * self.correction)
    }

    /// Returns the orientation at tick `tick` as [`at`](Self::at) does, with the pending correction
    /// too.
    pub(crate) fn corrected_at(&self, tick: u64) -> Option<Quat> {
        self.at(tick).map(|q| q * exp(self.pending))
    }

    /// Returns the present orientation with the pending correction.
    pub(crate) fn corrected(&self) -> Quat {
        self.integral * self.correction * exp(self.pending)
    }

    /// Adds `turn` (rotation vector in the sphere's axes, rad) to the pending correction.
    pub(crate) fn correct_further(&mut self, turn: Vec3) {
        self.pending = combined(self.pending, turn);
        self.corrected = true;
    }

    /// Starts a correction of the orientation by the fraction `weight` of the turn `delta`
    /// (rotation vector in frame N, rad), which was measured when the orientation was `then`. It
    /// replaces a correction that is still pending.
    pub(crate) fn correct(&mut self, then: Quat, delta: Vec3, weight: Real) {
        self.pending = then.conjugate() * (delta * weight);
        self.corrected = true;
    }
}
