//! Converts encoder counts, which wrap, to joint angles.
//!
//! Angles grow without bound and counts wrap at 32 bits. So the difference of two readings is taken
//! in integers, and the angle is kept as an integer within one turn. It becomes a float only when
//! it is read.

use crate::real::{Real, TURN};
use crate::rig::Joint;

/// Number of fractional bits of a stored count. A gear can make the counts of a turn fractional;
/// with units of 2⁻²⁴ counts a turn is exact to 3e-8 counts.
const FRACTION_BITS: u32 = 24;

/// The encoder of one joint: the last count and the angle within a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Encoder {
    last: i32,
    /// Angle within a turn, in 2⁻²⁴ counts; 0 <= position < turn.
    position: i64,
    turn: i64,
    radians_per_unit: Real,
    /// Angle of one count, rad. Negative if the motor controller counts against the joint.
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

    /// Takes the reading `count` as the absolute angle from the motor controller's zero.
    pub(crate) fn take(&mut self, count: i32) {
        self.last = count;
        let signed = if self.reversed { -i64::from(count) } else { i64::from(count) };
        // 2^31 counts times 2^24 units fit in 56 bits.
        self.position = (signed << FRACTION_BITS).rem_euclid(self.turn);
    }

    /// Returns the angle, rad, that the joint has turned from the last reading to `count`. Does not
    /// store `count`.
    #[inline]
    pub(crate) fn peek(&self, count: i32) -> Real {
        self.counted(count) as Real * self.radians_per_count
    }

    /// Returns the counts from the last reading to `count`, in the motor controller's direction.
    /// Does not store `count`.
    #[inline]
    pub(crate) fn counted(&self, count: i32) -> i32 {
        count.wrapping_sub(self.last)
    }

    /// Returns the joint's angle for one count, rad. Negative if the motor controller counts
    /// against the joint.
    #[inline]
    pub(crate) fn radians_per_count(&self) -> Real {
        self.radians_per_count
    }

    /// Stores the next reading and adds its change to the angle.
    #[inline]
    pub(crate) fn advance(&mut self, count: i32) {
        let delta = i64::from(count.wrapping_sub(self.last)) << FRACTION_BITS;
        self.last = count;
        self.position += if self.reversed { -delta } else { delta };
        if self.position < 0 || self.position >= self.turn {
            self.position = self.position.rem_euclid(self.turn);
        }
    }

    /// Returns the angle within a turn, rad, 0 to 2 pi.
    #[inline]
    pub(crate) fn angle(&self) -> Real {
        self.position as Real * self.radians_per_unit
    }

    /// Converts a torque or a rate between the joint's direction and the motor controller's
    /// direction.
    #[inline]
    pub(crate) fn signed(&self, x: Real) -> Real {
        if self.reversed { -x } else { x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Zero;

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
