//! How much energy may go into the hand: a bucket that leaks.
//!
//! The passivity observer's total is no measure of it: hours of a damped spring take in so much that any burst would be covered,
//! and a scene that vibrates gives out without end, as it should. So what counts is the energy given out faster than a power that is
//! allowed for ever.

use crate::real::Real;
use crate::rig::EnergyLimit;

/// The energy given out beyond what the power allows, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Burst {
    limit: EnergyLimit,
    level: Real,
}

impl Burst {
    pub(crate) fn new(limit: EnergyLimit) -> Self {
        Self { limit, level: 0.0 }
    }

    /// `dt` seconds have passed. Without power nothing is given out, and what was is forgotten.
    #[inline]
    pub(crate) fn pass(&mut self, dt: Real, powered: bool) {
        self.level = if powered { (self.level - self.limit.power * dt).max(0.0) } else { 0.0 };
    }

    /// So much was given out, J; less than nothing where it came in. Energy that came in is no credit for later.
    #[inline]
    pub(crate) fn given(&mut self, energy: Real) {
        self.level = (self.level + energy).max(0.0);
    }

    /// Too much.
    #[inline]
    pub(crate) fn over(&self) -> bool {
        self.level > self.limit.burst
    }
}
