//! Converts encoder counts, which wrap, to joint angles.
//!
//! Angles grow without bound and counts wrap at 32 bits. So the difference of two readings is taken
//! in integers, and the angle is kept as an integer within one turn. It becomes a float only when
//! it is read.

use crate::design::rig::Joint;
use crate::real::{Real, TURN};

/// Number of fractional bits with which encoder counts are stored. A gear can make the number of
/// counts per turn of the joint fractional. With units of 2⁻²⁴ counts, a turn is exact to 3e-8
/// counts.
const FRACTION_BITS: u32 = 24;

/// Follows the encoder of one joint: stores the last encoder count and computes the joint's angle
/// within a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Encoder {
    last: i32,
    /// Angle within a turn of the joint, in units of 2⁻²⁴ encoder counts. It is at least 0 and less
    /// than `turn`.
    position: i64,
    turn: i64,
    radians_per_unit: Real,
    /// Angle that the joint turns per encoder count, rad. Negative if the encoder counts up when
    /// the joint turns backwards.
    radians_per_count: Real,
    reversed: bool,
}

impl Encoder {
    pub(crate) fn new(joint: &Joint) -> Self {
        let unit = (1_i64 << FRACTION_BITS) as f64;
        let turn = libm::round(joint.counts() * unit) as i64;
        Self {
            last: 0,
            position: 0,
            turn: turn.max(1),
            radians_per_unit: TURN / turn.max(1) as Real,
            radians_per_count: joint.radians_per_count(),
            reversed: joint.reversed,
        }
    }

    /// Sets the joint's angle from the encoder count `count`, measured from the motor controller's
    /// zero.
    pub(crate) fn take(&mut self, count: i32) {
        self.last = count;
        let signed = if self.reversed { -i64::from(count) } else { i64::from(count) };
        // 2^31 counts times 2^24 units fit in 56 bits.
        self.position = (signed << FRACTION_BITS).rem_euclid(self.turn);
    }

    /// Returns the angle that the joint has turned since the last encoder count was stored, rad.
    /// Does not store `count`.
    #[inline]
    pub(crate) fn peek(&self, count: i32) -> Real {
        self.counted(count) as Real * self.radians_per_count
    }

    /// Returns the change of the encoder count since the last stored one, in the motor controller's
    /// direction. Does not store `count`.
    #[inline]
    pub(crate) fn counted(&self, count: i32) -> i32 {
        count.wrapping_sub(self.last)
    }

    /// Returns the angle that the joint turns per encoder count, rad. Negative if the encoder
    /// counts up when the joint turns backwards.
    #[inline]
    pub(crate) fn radians_per_count(&self) -> Real {
        self.radians_per_count
    }

    /// Stores the encoder count `count` and adds its change to the joint's angle.
    #[inline]
    pub(crate) fn advance(&mut self, count: i32) {
        let delta = i64::from(count.wrapping_sub(self.last)) << FRACTION_BITS;
        self.last = count;
        self.position += if self.reversed { -delta } else { delta };
        if self.position < 0 || self.position >= self.turn {
            self.position = self.position.rem_euclid(self.turn);
        }
    }

    /// Returns the joint's angle within a turn, rad, from 0 to 2 pi.
    #[inline]
    pub(crate) fn angle(&self) -> Real {
        self.position as Real * self.radians_per_unit
    }

    /// Converts a torque or a rate from the joint's direction to the motor controller's direction,
    /// or back.
    #[inline]
    pub(crate) fn signed(&self, x: Real) -> Real {
        if self.reversed { -x } else { x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::rig::Zero;

    fn encoder(counts_per_turn: u32, gear: Real, reversed: bool) -> Encoder {
        Encoder::new(&Joint {
            counts_per_turn,
            gear,
            reversed,
            zero: Zero::Assume,
            peak: 1.0,
            continuous: 1.0,
        })
    }

    #[test]
    fn wrapping_counts_keep_the_angle() {
        for reversed in [false, true] {
            let mut e = encoder(16384, 17.0, reversed);
            e.take(i32::MAX - 5);
            let before = e.angle();
            assert!(
                (e.peek((i32::MAX - 5).wrapping_add(10)) - e.signed(10.0 * TURN / (16384.0 * 17.0))).abs()
                    < 1e-6
            );
            e.advance((i32::MAX - 5).wrapping_add(10));
            let turned = crate::rotation::wrap_angle(e.angle() - before);
            assert!((turned - e.signed(10.0 * TURN / (16384.0 * 17.0))).abs() < 1e-6, "{turned}");
        }
    }

    #[test]
    fn a_hundred_thousand_turns_of_a_fractional_gear_stay_exact() {
        let mut e = encoder(1024, 84.3, false);
        e.take(0);
        let mut count = 0_i32;
        // 843 turns of the encoder are 10 turns of the joint.
        for _ in 0..10_000 {
            for _ in 0..843 {
                count = count.wrapping_add(1024);
                e.advance(count);
            }
        }
        // 1e5 turns, each rounded by at most 2^-25 counts of 86323. The gear of 84.3 is itself
        // rounded to a real, by half a unit in the last place of each turn.
        let off = crate::rotation::wrap_angle(e.angle()).abs();
        let gear = 1e5 * TURN * 0.5 * Real::EPSILON;
        assert!(off < 1e5 / 33_554_432.0 * TURN / 86323.0 + gear + 1e-6, "{off}");
    }
}
