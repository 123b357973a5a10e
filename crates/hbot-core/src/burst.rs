//! Limits how much energy the rig gives to the hand in a short time, with a leaky bucket.
//!
//! The total of the passivity observer is not suitable for this. A damped spring absorbs so much
//! energy over hours that the total would hide any burst. A scene that vibrates gives energy out
//! without end, as it should. So only the energy above a permitted constant power is counted.

use crate::real::Real;
use crate::rig::EnergyLimit;

/// The energy given to the hand beyond what the permitted power allows, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Burst {
    limit: EnergyLimit,
    level: Real,
}

impl Burst {
    pub(crate) fn new(limit: EnergyLimit) -> Self {
        Self { limit, level: 0.0 }
    }

    /// Lowers the level by the energy that the permitted power allows in `dt` seconds. Sets it to
    /// zero if the motors are off, because no energy is then given out.
    #[inline]
    pub(crate) fn leak(&mut self, dt: Real, powered: bool) {
        self.level = if powered { (self.level - self.limit.power * dt).max(0.0) } else { 0.0 };
    }

    /// Records the energy given to the hand, J; negative if energy was absorbed. Absorbed energy
    /// gives no credit for later.
    #[inline]
    pub(crate) fn add(&mut self, energy: Real) {
        self.level = (self.level + energy).max(0.0);
    }

    /// Returns true if the level is above the burst limit.
    #[inline]
    pub(crate) fn over(&self) -> bool {
        self.level > self.limit.burst
    }
}
