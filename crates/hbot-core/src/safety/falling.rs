//! A torque that falls early as it rises late, so that the slew limit gives out no energy.
//!
//! The torque changes by at most the slew limit r in a second. A wall of the stiffness K that is
//! hit at the rate v asks for a change of K v. If this is more than r, the torque rises late, and
//! brakes the sphere too little. If it fell as late on the way out, it would push when the sphere
//! has left the wall. So it begins to fall as soon as it has just time enough to fall with the
//! scene's torque:
//!
//! ```text
//! |T| <= r s        s is the time in which the scene's torque will have fallen to zero
//! ```
//!
//! On the way out the torque then lacks what it lacked on the way in, and the energy that the wall
//! took is what it gives back. The time s is that of a parabola through the torques of the last
//! three ticks, T s + T' s + T'' s²/2 = 0, before the torque limit. It is the lead's part for the
//! slew limit: the pose of the lead is that of the middle of this tick.

use crate::real::{Real, Vec3, sqrt};

/// Follows the torque of scene and stream from tick to tick, and finds how large it may be so that
/// it can fall in time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Falling {
    /// Torque of the last tick before the torque limit, N m, and its change in that tick.
    last: Vec3,
    change: Vec3,
}

impl Falling {
    pub(crate) const NONE: Self = Self { last: Vec3::ZERO, change: Vec3::ZERO };

    /// Returns the largest torque of this tick, N m, at most `limit`. `sum` is the torque of scene
    /// and stream before the torque limit, and `reach` the largest change of torque in a tick.
    #[inline(always)]
    pub(crate) fn most(&mut self, sum: Vec3, reach: Real, limit: Real) -> Real {
        let change = sum - self.last;
        // The size of the torque times its fall in this tick.
        let falls = -change.dot(sum);
        if falls <= 0.5 * reach * reach {
            // The torque is below the reach, or its fall is below half of the reach. The fall grows
            // by at most itself in a tick, so in both cases the bound is above the torque.
            (self.last, self.change) = (sum, change);
            return limit;
        }
        self.bound(sum, reach, limit)
    }

    #[cold]
    #[inline(never)]
    fn bound(&mut self, sum: Vec3, reach: Real, limit: Real) -> Real {
        let change = sum - self.last;
        let before = core::mem::replace(&mut self.change, change);
        self.last = sum;
        let size2 = sum.length_squared();
        // What is below the reach can fall in this tick.
        if !(size2 > reach * reach) {
            return limit;
        }
        let size = sqrt(size2);
        let fall = -change.dot(sum) / size;
        if !(fall > 0.0) {
            return limit;
        }
        // The change of the fall in a tick. It is no more than the fall itself, so that the end of
        // a step is not taken for the top of a parabola.
        let more = ((before - change).dot(sum) / size).clamp(0.0, fall);
        let ticks = 2.0 * size / (fall + sqrt(fall * fall + 2.0 * more * size));
        (reach * ticks).min(limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REACH: Real = 0.2;

    /// Returns the bound in the last of three ticks with the torques `torques` about one axis.
    fn most(torques: [Real; 3]) -> Real {
        let mut falling = Falling::NONE;
        torques.map(|torque| falling.most(Vec3::Y * torque, REACH, 2.0))[2]
    }

    #[test]
    fn a_torque_has_the_time_of_its_fall() {
        // 0.4 N m a tick: it is 0 in three ticks. The bound is the same in both directions.
        for sign in [1.0, -1.0] {
            assert!((most([2.0, 1.6, 1.2].map(|x| sign * x)) - 3.0 * REACH).abs() < 1e-6);
        }
        // 3 - k²/4 - k/2 falls by 0.25, 0.75 and 1.25; the parabola through them is 0 at 0.96
        // ticks.
        let ticks = 2.0 * 0.75 / (1.25 + sqrt(1.25 * 1.25 + 2.0 * 0.5 * 0.75));
        assert!((most([2.75, 2.0, 0.75]) - REACH * ticks).abs() < 1e-6);
    }

    #[test]
    fn what_rises_rests_or_falls_slowly_is_not_bounded() {
        for torques in [[0.4, 0.8, 1.2], [1.0, 1.0, 1.0], [1.21, 1.2, 1.19], [0.0, 1.0, 1.0], [0.9, 0.5, 0.1]]
        {
            assert!(most(torques) >= torques[2].abs(), "{torques:?}");
        }
    }

    /// The short way finds the same torques as the bound itself: both leave a torque as it is, or
    /// both bound it to the same.
    #[test]
    fn the_short_way_bounds_no_torque_less_than_the_bound() {
        let mut state = 1_u32;
        let mut unit = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as Real / 16_777_216.0 - 0.5
        };
        let mut bounded = 0;
        for k in 0..4000 {
            // From falls far below the reach to falls far beyond it.
            let scale = [0.05, 0.3, 1.0, 4.0][k % 4];
            let (mut short, mut long) = (Falling::NONE, Falling::NONE);
            let mut torque = Vec3::new(unit(), unit(), unit()) * 4.0;
            for _ in 0..3 {
                let size = sqrt(torque.length_squared());
                let [a, b] = [short.most(torque, REACH, 9.0), long.bound(torque, REACH, 9.0)];
                assert!((a.min(size) - b.min(size)).abs() < 1e-5, "{torque} {a} {b}");
                assert_eq!(short, long);
                bounded += usize::from(b < size);
                torque += (Vec3::new(unit(), unit(), unit()) - torque * unit()) * scale;
            }
        }
        assert!(bounded > 300, "{bounded} of 12000 are bounded");
    }
}
