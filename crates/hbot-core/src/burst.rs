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

    /// Takes away what the power allows in `dt` seconds; without power everything, as nothing is given out.
    #[inline]
    pub(crate) fn leak(&mut self, dt: Real, powered: bool) {
        self.level = if powered { (self.level - self.limit.power * dt).max(0.0) } else { 0.0 };
    }

    /// Records the energy given out to the hand, J; negative if it came in. Energy that came in is no credit for later.
    #[inline]
    pub(crate) fn add(&mut self, energy: Real) {
        self.level = (self.level + energy).max(0.0);
    }

    /// Whether it is more than the limit.
    #[inline]
    pub(crate) fn over(&self) -> bool {
        self.level > self.limit.burst
    }
}
