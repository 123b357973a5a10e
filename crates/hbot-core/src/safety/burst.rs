//! Limits how much energy the rig gives to the hand in a short time, with a leaky bucket.
//!
//! The total of the passivity observer is not suitable for this. A damped spring absorbs so much
//! energy over hours that the total would hide any burst. A scene that vibrates gives energy out
//! without end, as it should. So only the energy above a permitted constant power is counted.

use crate::design::rig::EnergyLimit;
use crate::real::Real;

/// Counts the energy that the rig has recently given to the hand in excess of a permitted constant
/// power, J. It serves to detect a burst of energy.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Burst {
    limit: EnergyLimit,
    level: Real,
}

impl Burst {
    pub(crate) fn new(limit: EnergyLimit) -> Self {
        Self { limit, level: 0.0 }
    }

    /// Lowers the counted energy by what the permitted power allows in `dt` seconds. If the motors
    /// are off (`powered` is false), sets it to zero, because no energy is given to the hand.
    #[inline]
    pub(crate) fn leak(&mut self, dt: Real, powered: bool) {
        self.level = if powered { (self.level - self.limit.power * dt).max(0.0) } else { 0.0 };
    }

    /// Adds `energy` to the counted energy, J. It is positive if it was given to the hand, and
    /// negative if it was absorbed. The count never falls below zero, so absorbed energy is no
    /// credit for later.
    #[inline]
    pub(crate) fn add(&mut self, energy: Real) {
        self.level = (self.level + energy).max(0.0);
    }

    /// Returns true if the counted energy is above the burst limit.
    #[inline]
    pub(crate) fn over(&self) -> bool {
        self.level > self.limit.burst
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bucket() -> Burst {
        Burst::new(EnergyLimit { burst: 1.0, power: 2.0 })
    }

    #[test]
    fn energy_that_came_in_is_no_credit_and_permitted_power_is_none_either() {
        let mut burst = bucket();
        burst.add(-100.0);
        burst.add(1.25);
        assert!(burst.over(), "absorbed energy is no credit in the same tick");
        let mut burst = bucket();
        burst.leak(100.0, true);
        burst.add(1.25);
        assert!(burst.over(), "a long time without energy is no credit");
    }

    #[test]
    fn the_permitted_power_lowers_the_count_with_time() {
        let mut burst = bucket();
        burst.add(1.25);
        burst.leak(0.0625, true);
        assert!(burst.over(), "1.125 J of 1 J");
        burst.leak(0.0625, true);
        assert!(!burst.over(), "1 J of 1 J");
    }

    #[test]
    fn motors_that_are_off_give_nothing_and_empty_the_count() {
        let mut burst = bucket();
        burst.add(1.25);
        burst.leak(0.0, false);
        assert!(!burst.over());
        burst.add(0.75);
        assert!(!burst.over(), "nothing is left of the energy before");
    }
}
