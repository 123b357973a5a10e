//! The path of the joints between two readings: a polynomial in time through the last few readings
//! (physics notes, section 4).
//!
//! A method of odometry is exact only for the path that it is given, and joints do not move at
//! constant rates. The error of the polynomial through the last k readings, over the last interval,
//! falls with the k-th power of the interval. The interval lies at the end of the readings used but
//! between two of them, so no future reading is needed.

use crate::design::device::MAX_JOINTS;
use crate::design::rig::PathFit;
use crate::real::Real;

/// Shortest earlier interval between readings that a fit may use, as a fraction of the last
/// interval. A fit through readings that are close together extrapolates their rounding errors over
/// a long gap: it magnifies them by the ratio of the two lengths.
const LEAST_RATIO: Real = 0.25;

/// The angles of all joints between the last two readings, as polynomials of s. At s = 0 the
/// interval begins, at s = 1 it ends.
///
/// angle(s) - angle(0) = delta s + bend s (s - 1) + twist s (s - 1) (s + before)
///
/// This is Newton's form of the polynomial. `before` is the length of the previous interval as a
/// fraction of the last one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    delta: [Real; MAX_JOINTS],
    bend: [Real; MAX_JOINTS],
    twist: [Real; MAX_JOINTS],
    before: Real,
}

impl Path {
    /// Returns the change of each joint's angle over the interval, rad. It is always the measured
    /// change, whichever curve is fitted.
    #[inline]
    #[must_use]
    pub fn delta(&self) -> &[Real; MAX_JOINTS] {
        &self.delta
    }

    /// Returns the angle that `joint` has turned from the start of the interval to the point `s`,
    /// rad.
    #[inline]
    #[must_use]
    pub fn turned(&self, joint: usize, s: Real) -> Real {
        s * (self.delta[joint] + (s - 1.0) * (self.bend[joint] + (s + self.before) * self.twist[joint]))
    }

    /// Returns the rate of `joint` at the point `s` of the path, in rad per interval.
    #[inline]
    #[must_use]
    pub fn rate(&self, joint: usize, s: Real) -> Real {
        let twice = 2.0 * s - 1.0;
        self.delta[joint]
            + twice * self.bend[joint]
            + (twice * (s + self.before) + s * (s - 1.0)) * self.twist[joint]
    }
}

/// Stores how the joints moved between the last few readings, so that a path can be fitted through
/// these readings.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Trail {
    /// Changes of the joint angles in earlier steps between readings, rad; the latest step first.
    delta: [[Real; MAX_JOINTS]; 2],
    /// Durations of the earlier steps between readings, in any unit of time; the latest step first.
    time: [Real; 2],
    /// Number of earlier steps that are stored, 0 to 2.
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, 2>"))]
    known: usize,
}

impl Trail {
    /// A trail in which no step is stored.
    pub const START: Self = Self { delta: [[0.0; MAX_JOINTS]; 2], time: [0.0; 2], known: 0 };

    /// Fits a path to the newest step, in which the joints turned by `delta` (rad) in the time
    /// `time`, and stores the step. Returns the path.
    ///
    /// `time` must be positive and always in the same unit. If too few earlier steps are stored, or
    /// if they are much shorter than this one, the path is a polynomial of lower degree.
    #[inline]
    #[must_use]
    pub fn step(&mut self, fit: PathFit, delta: &[Real; MAX_JOINTS], time: Real) -> Path {
        let wanted = match fit {
            PathFit::Straight => 0,
            PathFit::Quadratic => 1,
            PathFit::Cubic => 2,
        };
        let mut path = Path { delta: *delta, bend: [0.0; MAX_JOINTS], twist: [0.0; MAX_JOINTS], before: 0.0 };
        let [before, earlier] = [self.time[0] / time, self.time[1] / time];
        let usable = wanted.min(self.known);
        if usable > 0 && before >= LEAST_RATIO {
            // Divided differences over the times 1, 0, -before, -before - earlier.
            let (of_one, of_two) = (1.0 / before, 1.0 / (1.0 + before));
            for (j, bend) in path.bend.iter_mut().enumerate() {
                *bend = (delta[j] - self.delta[0][j] * of_one) * of_two;
            }
            path.before = before;
            if usable > 1 && earlier >= LEAST_RATIO {
                let of_one_earlier = 1.0 / earlier;
                let (of_two_earlier, of_three) = (1.0 / (before + earlier), 1.0 / (1.0 + before + earlier));
                for (j, twist) in path.twist.iter_mut().enumerate() {
                    let bend =
                        (self.delta[0][j] * of_one - self.delta[1][j] * of_one_earlier) * of_two_earlier;
                    *twist = (path.bend[j] - bend) * of_three;
                }
            }
        }
        self.delta = [*delta, self.delta[0]];
        self.time = [time, self.time[0]];
        self.known = (self.known + 1).min(2);
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the path that is fitted to the last step between readings at the given `times`,
    /// which can be uneven. Joint 0 follows the function `of`, and joint 3 its negative.
    fn fitted(fit: PathFit, times: &[Real], of: impl Fn(Real) -> Real) -> Path {
        let mut trail = Trail::START;
        let mut path = None;
        for pair in times.windows(2) {
            let mut delta = [0.0; MAX_JOINTS];
            (delta[0], delta[3]) = (of(pair[1]) - of(pair[0]), of(pair[0]) - of(pair[1]));
            path = Some(trail.step(fit, &delta, pair[1] - pair[0]));
        }
        path.unwrap()
    }

    /// Tolerance for rounding errors of the fit. A divided difference of numbers of size 1, over
    /// intervals of at least a quarter, has an error of about 100 units in the last place.
    const ROUNDING: Real = 256.0 * Real::EPSILON;

    #[test]
    fn a_polynomial_of_the_fit_s_degree_is_met_exactly_at_uneven_times() {
        let cubic = |t: Real| 0.3 * t - 0.2 * t * t + 0.05 * t * t * t;
        let square = |t: Real| 0.3 * t - 0.2 * t * t;
        let line = |t: Real| 0.3 * t;
        let times = [0.0, 1.0, 1.75, 2.75];
        let check = |fit, of: &dyn Fn(Real) -> Real, rate: &dyn Fn(Real) -> Real| {
            let path = fitted(fit, &times, of);
            for s in [0.0, 0.2, 0.5, 0.9, 1.0] {
                let t = 1.75 + s;
                let (angle, speed) = (path.turned(0, s), path.rate(0, s));
                assert!((angle - (of(t) - of(1.75))).abs() < ROUNDING, "{fit:?}: {angle} at {s}");
                assert!((speed - rate(t)).abs() < ROUNDING, "{fit:?}: {speed} at {s}");
                assert!((path.turned(3, s) + angle).abs() < ROUNDING);
            }
            assert_eq!(path.turned(1, 0.5), 0.0);
        };
        check(PathFit::Cubic, &cubic, &|t| 0.3 - 0.4 * t + 0.15 * t * t);
        check(PathFit::Cubic, &square, &|t| 0.3 - 0.4 * t);
        check(PathFit::Quadratic, &square, &|t| 0.3 - 0.4 * t);
        check(PathFit::Quadratic, &line, &|_| 0.3);
        check(PathFit::Straight, &line, &|_| 0.3);
    }

    #[test]
    fn too_few_readings_or_a_long_gap_lower_the_degree() {
        let square = |t: Real| t * t;
        let straight = |path: &Path| (path.turned(0, 0.5) - 0.5 * path.delta()[0]).abs() < ROUNDING;
        assert!(straight(&fitted(PathFit::Cubic, &[0.0, 1.0], square)), "the first step");
        let third = fitted(PathFit::Straight, &[0.0, 1.0, 2.0, 3.0], square);
        assert!(straight(&third), "a straight path, however many readings are known");
        let second = fitted(PathFit::Cubic, &[0.0, 1.0, 2.0], square);
        assert!((second.turned(0, 0.5) - 1.25).abs() < ROUNDING, "a quadratic in the second");
        assert!(straight(&fitted(PathFit::Cubic, &[0.0, 1.0, 2.0, 7.0], square)), "over a gap of five");
        // The gap itself is a long interval, and the next fit can use it.
        let after = fitted(PathFit::Quadratic, &[0.0, 5.0, 6.0], square);
        assert!((after.turned(0, 0.5) - 5.25).abs() < ROUNDING * 36.0);
    }

    #[test]
    fn the_ends_are_the_readings_whatever_the_fit() {
        for fit in [PathFit::Straight, PathFit::Quadratic, PathFit::Cubic] {
            let path = fitted(fit, &[0.0, 1.0, 2.0, 3.5], |t| t * t * t * t);
            assert_eq!(path.turned(0, 0.0), 0.0);
            assert_eq!(path.turned(0, 1.0), path.delta()[0]);
        }
    }
}
