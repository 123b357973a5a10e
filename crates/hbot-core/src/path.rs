//! The way of the joints between two readings: a polynomial in time through the last few of them (physics notes,
//! section 4).
//!
//! A method of odometry is exact only for the path that it is given, and joints do not move in straight lines. The
//! polynomial through the last k readings, taken over the last interval, is off by the k-th power of the interval: no
//! reading has to be waited for, since the interval lies at the end of the stencil but inside it.

use crate::device::MAX_JOINTS;
use crate::real::Real;
use crate::rig::PathFit;

/// An earlier reading counts only where its interval is at least this part of the last one. A fit through readings that lie
/// close together would carry their rounding to counts over a long gap, magnified by the ratio of the two.
const LEAST_RATIO: Real = 0.25;

/// The angles of all joints over the last interval, as functions of s, 0 at its start and 1 at its end:
///
/// angle(s) - angle(0) = delta s + bend s (s - 1) + twist s (s - 1) (s + before)
///
/// in Newton's form, `before` being the length of the interval before over that of the last one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    delta: [Real; MAX_JOINTS],
    bend: [Real; MAX_JOINTS],
    twist: [Real; MAX_JOINTS],
    before: Real,
}

impl Path {
    /// What each joint turned in all, rad: what was measured, whatever the fit.
    #[inline]
    #[must_use]
    pub fn delta(&self) -> &[Real; MAX_JOINTS] {
        &self.delta
    }

    /// How far `joint` has turned at `s`, rad.
    #[inline]
    #[must_use]
    pub fn turned(&self, joint: usize, s: Real) -> Real {
        s * (self.delta[joint] + (s - 1.0) * (self.bend[joint] + (s + self.before) * self.twist[joint]))
    }

    /// How fast `joint` turns at `s`, rad for the whole interval.
    #[inline]
    #[must_use]
    pub fn rate(&self, joint: usize, s: Real) -> Real {
        let twice = 2.0 * s - 1.0;
        self.delta[joint]
            + twice * self.bend[joint]
            + (twice * (s + self.before) + s * (s - 1.0)) * self.twist[joint]
    }
}

/// The last steps of the joints, from which paths are fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trail {
    /// What the joints turned between earlier readings, rad, the latest first.
    delta: [[Real; MAX_JOINTS]; 2],
    /// The time between those, in any unit.
    time: [Real; 2],
    /// How many of them there are.
    known: usize,
}

impl Trail {
    /// No step yet.
    pub const START: Self = Self { delta: [[0.0; MAX_JOINTS]; 2], time: [0.0; 2], known: 0 };

    /// The path of the step in which the joints turned by `delta` (rad) in `time` (positive, in the same unit every time), and
    /// remembers it. Where there are too few steps before it, or ones much shorter than it, the fit is one of lower degree.
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

    /// Readings at uneven times of a polynomial in each of two joints; the last step's path.
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

    /// Rounding of a divided difference of numbers of size 1 over intervals of at least a quarter: some 100 units.
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
        let second = fitted(PathFit::Cubic, &[0.0, 1.0, 2.0], square);
        assert!((second.turned(0, 0.5) - 1.25).abs() < ROUNDING, "a quadratic in the second");
        assert!(straight(&fitted(PathFit::Cubic, &[0.0, 1.0, 2.0, 7.0], square)), "over a gap of five");
        // The gap itself is a long interval, and may serve the next fit.
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
