//! A Kalman filter of the angle, rate and acceleration of each joint (physics notes, section 9).
//!
//! The model treats the jerk as white noise, and the rounding to counts as a measurement noise of
//! 1/12 counts². The gains vary with time, so uneven steps and the start are no special cases. A
//! step costs about 50 multiplications and one division per joint.
//!
//! Units are counts and ticks, which keeps all numbers near 1. The angle is kept relative to the
//! last count, so it stays small however far the joint turns.

use crate::design::device::MAX_JOINTS;
use crate::real::Real;

/// Time for which the acceleration of a joint lasts before it changes, s. A hand changes its motion
/// in about this time. In Singer's model of a manoeuvre (1970), an acceleration of size a lasts for
/// about this time. Over much shorter times it is a random walk, driven by white-noise jerk of the
/// intensity 2 a² / time.
const MANOEUVRE_S: Real = 0.1;

/// Variance of the error when an angle is rounded to a whole encoder count, counts².
const ROUNDING: Real = 1.0 / 12.0;

/// Largest number of ticks between two readings that the filter bridges. After a longer gap it
/// restarts with the mean rate over the gap.
const LONGEST_STEP: Real = 8.0;

/// Smallest variance that is assumed for a reading, as a fraction of the acceleration's initial
/// variance (both in units of counts and ticks). It matters only for encoders that are so fine that
/// rounding to counts is negligible. There it keeps the computed covariance accurate.
const LEAST_NOISE: Real = if Real::EPSILON < 1.0e-10 { 1.0e-9 } else { 1.0e-3 };

/// The Kalman filters of all joints, which estimate joint rates from encoder counts.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Kalman {
    joints: [Filter; MAX_JOINTS],
    /// True if only one reading is known. The next one then gives the rates by a difference.
    fresh: bool,
}

#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Filter {
    /// Intensity of the white-noise jerk (rate of change of acceleration) in the filter's model,
    /// counts²/tick⁵.
    jerk: Real,
    /// Variance of the acceleration before any reading, counts²/tick⁴.
    prior: Real,
    /// Variance of the error of a reading, counts².
    noise: Real,
    /// Estimated angle minus the last reading, in encoder counts. The next two fields are the
    /// estimated rate (counts/tick) and acceleration (counts/tick²).
    offset: Real,
    rate: Real,
    acceleration: Real,
    p: Covariance,
}

/// Covariance matrix of the errors in the estimated angle x, rate v and acceleration a.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
struct Covariance {
    xx: Real,
    xv: Real,
    xa: Real,
    vv: Real,
    va: Real,
    aa: Real,
}

impl Kalman {
    /// Creates filters for joints that turn by `per_count` radians per encoder count.
    /// `acceleration` is the typical size of a joint's acceleration, rad/s². `period` is the loop's
    /// period, s.
    pub(super) fn new(acceleration: Real, per_count: &[Real; MAX_JOINTS], period: Real) -> Self {
        Self { joints: per_count.map(|unit| Filter::new(acceleration, unit, period)), fresh: true }
    }

    pub(super) fn restart(&mut self) {
        self.fresh = true;
    }

    /// Takes the next reading: the change of each joint in encoder counts, over a time of `ticks`
    /// ticks.
    #[inline]
    pub(super) fn push(&mut self, counts: &[i32], ticks: Real) {
        let anew = core::mem::replace(&mut self.fresh, false) || ticks > LONGEST_STEP;
        for (filter, counts) in self.joints.iter_mut().zip(counts) {
            if anew {
                filter.begin(*counts as Real, ticks);
            } else {
                filter.advance(*counts as Real, ticks);
            }
        }
    }

    /// Returns the estimated rate of `joint` at the last reading, in encoder counts per tick.
    #[inline]
    pub(super) fn slope(&self, joint: usize) -> Real {
        self.joints[joint].rate
    }
}

impl Filter {
    fn new(acceleration: Real, per_count: Real, period: Real) -> Self {
        let size = acceleration * period * period / per_count;
        let prior = size * size;
        Self {
            jerk: 2.0 * prior * period / MANOEUVRE_S,
            prior,
            noise: ROUNDING.max(LEAST_NOISE * prior),
            offset: 0.0,
            rate: 0.0,
            acceleration: 0.0,
            p: Covariance { xx: 0.0, xv: 0.0, xa: 0.0, vv: 0.0, va: 0.0, aa: 0.0 },
        }
    }

    /// Starts the filter from two readings, `n` ticks apart. The first estimate of the rate is the
    /// mean rate between them. If the joint accelerates, this is the rate in the middle of the
    /// interval, not at its end.
    fn begin(&mut self, counts: Real, n: Real) {
        (self.offset, self.rate, self.acceleration) = (0.0, counts / n, 0.0);
        self.p = Covariance {
            xx: self.noise,
            xv: self.noise / n,
            xa: 0.0,
            vv: 2.0 * self.noise / (n * n) + 0.25 * n * n * self.prior,
            va: 0.5 * n * self.prior,
            aa: self.prior,
        };
    }

    #[inline]
    fn advance(&mut self, counts: Real, n: Real) {
        let p = self.predicted(n);
        let offset = self.offset + n * (self.rate + 0.5 * n * self.acceleration);
        let rate = self.rate + n * self.acceleration;
        // The difference between reading and prediction, and its weight.
        let surprise = counts - offset;
        let weight = 1.0 / (p.xx + self.noise);
        let [gv, ga] = [p.xv * weight, p.xa * weight];
        let left = self.noise * weight;
        self.offset = -left * surprise;
        self.rate = rate + gv * surprise;
        self.acceleration += ga * surprise;
        // (1 - gain) is computed as noise over the sum, so no digit is lost if the gain is near 1.
        self.p = Covariance {
            xx: p.xx * left,
            xv: p.xv * left,
            xa: p.xa * left,
            vv: p.vv - gv * p.xv,
            va: p.va - gv * p.xa,
            aa: p.aa - ga * p.xa,
        };
    }

    /// Returns the covariance predicted for `n` ticks later, F P Fᵀ + Q. Q is the covariance that
    /// white-noise jerk adds in this time.
    #[inline]
    fn predicted(&self, n: Real) -> Covariance {
        let (p, q) = (&self.p, self.jerk);
        let n2 = n * n;
        let xa = p.xa + n * p.va + 0.5 * n2 * p.aa;
        let va = p.va + n * p.aa;
        let xv = p.xv + n * p.vv + 0.5 * n2 * p.va;
        Covariance {
            xx: p.xx + n * (p.xv + xv) + 0.5 * n2 * (p.xa + xa) + q * n2 * n2 * n / 20.0,
            xv: xv + n * xa + q * n2 * n2 / 8.0,
            xa: xa + q * n2 * n / 6.0,
            vv: p.vv + n * (p.va + va) + q * n2 * n / 3.0,
            va: va + q * n2 / 2.0,
            aa: p.aa + q * n,
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::wide;
    use super::*;
    use std::vec::Vec;

    /// Returns a pseudo-random number, uniform between 0 and 1, and advances `seed`.
    fn uniform(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A simulated joint on which the filter is tested. Random jerk (white noise) changes its
    /// acceleration. Its state is angle, rate and acceleration, in encoder counts and ticks.
    struct Joint {
        seed: u64,
        state: [f64; 3],
        jerk: f64,
    }

    impl Joint {
        fn go(&mut self, ticks: u32) {
            // A jerk that is constant for a 32nd of a tick is white enough: its second moments are
            // right, those of the angle within a thousandth.
            const PARTS: u32 = 32;
            let h = 1.0 / f64::from(PARTS);
            for _ in 0..ticks * PARTS {
                // The sum of twelve uniform numbers, minus six, has the variance 1.
                let normal = (0..12).map(|_| uniform(&mut self.seed)).sum::<f64>() - 6.0;
                let [x, v, a] = self.state;
                let next = a + normal * libm::sqrt(self.jerk * h);
                let mean = 0.5 * (a + next);
                self.state = [x + h * (v + 0.5 * h * mean), v + h * mean, next];
            }
        }
    }

    /// Checks that the errors of the estimated rate and acceleration have the variance that the
    /// filter predicts, for even and uneven times between readings. This shows that the filter's
    /// model and gains are correct.
    #[test]
    fn errors_have_the_variance_that_the_filter_expects() {
        for uneven in [false, true] {
            let acceleration = 3.0;
            let filter = Filter::new(acceleration, 1.0, 1.0);
            let mut joint = Joint { seed: 5, state: [0.0, 40.0, 0.0], jerk: wide(filter.jerk) };
            let mut kalman = Kalman::new(acceleration, &[1.0; MAX_JOINTS], 1.0);
            let mut last = 0.0;
            let (mut rates, mut accelerations) = (Vec::new(), Vec::new());
            for k in 0..6000 {
                let ticks = if uneven && uniform(&mut joint.seed) < 0.3 { 3 } else { 1 };
                joint.go(ticks);
                let reading = libm::round(joint.state[0]);
                kalman.push(&[(reading - last) as i32; 1], ticks as Real);
                last = reading;
                let f = &kalman.joints[0];
                if k > 100 {
                    let square = |error: f64, variance: Real| error * error / wide(variance);
                    rates.push(square(joint.state[1] - wide(f.rate), f.p.vv));
                    accelerations.push(square(joint.state[2] - wide(f.acceleration), f.p.aa));
                }
            }
            for errors in [rates, accelerations] {
                let mean = errors.iter().sum::<f64>() / errors.len() as f64;
                // 6000 squares that are correlated over a few readings: their mean is accurate to
                // about 4 %. Three times this is allowed.
                assert!((mean - 1.0).abs() < 0.12, "uneven {uneven}: {mean} times the variance expected");
            }
        }
    }

    /// Checks the numbers of the filter's model in counts and ticks: the variance of the
    /// acceleration, the intensity of the jerk, 2 a² / 0.1 s, and the noise of a reading.
    #[test]
    fn the_model_is_that_of_the_acceleration_in_counts_and_ticks() {
        for (acceleration, unit, period) in [(100.0, 2.0e-5, 1.0e-3), (3.0, 4.0e-4, 5.0e-3)] {
            let filter = Filter::new(acceleration, unit, period);
            let near = |is: Real, want: Real| (is / want - 1.0).abs() < 32.0 * Real::EPSILON;
            // One tick changes the rate by this many counts per tick.
            let size = acceleration * period / (unit / period);
            assert!(near(filter.prior, size * size), "{}", filter.prior);
            let jerk = 2.0 * acceleration * acceleration / 0.1;
            let in_ticks = jerk * (period * period * period * period * period) / (unit * unit);
            assert!(near(filter.jerk, in_ticks), "{}, not {in_ticks}", filter.jerk);
            assert_eq!(filter.noise, 1.0 / 12.0, "rounding to counts");
        }
        // With counts so fine that rounding is negligible, a reading counts as a little uncertain.
        let fine = Filter::new(1.0, 1.0e-12, 1.0e-2);
        assert!(fine.noise > 1.0 && (fine.noise / (LEAST_NOISE * fine.prior) - 1.0).abs() < 1.0e-3);
    }

    /// Checks that the first estimates of joints that start anywhere, at any rate and with the
    /// expected acceleration, have the errors that the filter expects: after two readings and after
    /// two more, for even and uneven times between them.
    #[test]
    fn the_first_estimates_have_the_variance_that_the_filter_expects() {
        const JOINTS: u32 = 4000;
        // The acceleration is 0.7 counts/tick². A tick is so short that the acceleration hardly
        // changes in it.
        let new = Filter::new(0.7, 1.0e-8, 1.0e-4);
        for steps in [[1, 1, 1], [2, 1, 2], [3, 2, 1]] {
            let mut joint = Joint { seed: 11, state: [0.0; 3], jerk: wide(new.jerk) };
            // Sums of squared errors over their variances: angle, rate, acceleration, and the
            // product of the errors of angle and rate.
            let mut sums = [[0.0; 4]; 3];
            for _ in 0..JOINTS {
                let mut filter = new;
                let normal = (0..12).map(|_| uniform(&mut joint.seed)).sum::<f64>() - 6.0;
                let start = 1000.0 * uniform(&mut joint.seed);
                let rate = 100.0 * uniform(&mut joint.seed) - 50.0;
                joint.state = [start, rate, normal * libm::sqrt(wide(filter.prior))];
                let mut last = libm::round(start);
                for (k, ticks) in steps.into_iter().enumerate() {
                    joint.go(ticks);
                    let reading = libm::round(joint.state[0]);
                    let (counts, n) = ((reading - last) as Real, ticks as Real);
                    if k == 0 {
                        filter.begin(counts, n);
                    } else {
                        filter.advance(counts, n);
                    }
                    last = reading;
                    let angle = joint.state[0] - reading - wide(filter.offset);
                    let rate = joint.state[1] - wide(filter.rate);
                    let change = joint.state[2] - wide(filter.acceleration);
                    let p = &filter.p;
                    let [xx, xv, vv, aa] = [p.xx, p.xv, p.vv, p.aa].map(wide);
                    let both = (angle * rate - xv) / libm::sqrt(xx * vv + xv * xv);
                    let now = [angle * angle / xx, rate * rate / vv, change * change / aa, 1.0 + both];
                    for (sum, term) in sums[k].iter_mut().zip(now) {
                        *sum += term / f64::from(JOINTS);
                    }
                }
            }
            for (k, sums) in sums.into_iter().enumerate() {
                for (what, sum) in ["angle", "rate", "acceleration", "both"].into_iter().zip(sums) {
                    // The mean of 4000 squares is accurate to 2.2 %. Four times this is allowed.
                    assert!((sum - 1.0).abs() < 0.09, "{what} in step {k} of {steps:?}: {sum}");
                }
            }
        }
    }

    #[test]
    fn a_gap_of_eight_ticks_is_bridged_and_a_longer_one_is_not() {
        let after = |ticks: Real| {
            let mut kalman = Kalman::new(100.0, &[1e-4; MAX_JOINTS], 1e-3);
            for _ in 0..2000 {
                kalman.push(&[3], 1.0);
            }
            let angle = 3 * ticks as i32 + 40;
            kalman.push(&[angle], ticks);
            (kalman.slope(0), angle as Real / ticks)
        };
        let (bridged, mean) = after(LONGEST_STEP);
        // At the end of a gap in which the joint became faster, it is faster than on average.
        assert!(bridged > mean + 1.0, "{bridged} against {mean}");
        let (anew, mean) = after(LONGEST_STEP + 1.0);
        assert_eq!(anew, mean);
    }

    #[test]
    fn the_second_reading_gives_the_difference_and_rest_gives_rest() {
        let mut kalman = Kalman::new(100.0, &[1e-4; MAX_JOINTS], 1e-3);
        kalman.push(&[30], 2.0);
        assert_eq!(kalman.slope(0), 15.0);
        for _ in 0..2000 {
            kalman.push(&[0], 1.0);
        }
        // The slowest pole of the filter is at about 1/10 per tick.
        assert!(kalman.slope(0).abs() < 1e-6, "{}", kalman.slope(0));
        kalman.push(&[500], LONGEST_STEP + 1.0);
        assert_eq!(kalman.slope(0), 500.0 / (LONGEST_STEP + 1.0) as Real, "over a gap, the difference");
    }

    #[test]
    fn a_steady_acceleration_is_followed_without_lag() {
        let mut kalman = Kalman::new(100.0, &[1e-4; MAX_JOINTS], 1e-3);
        // 0.5 counts/tick²: at even ticks the readings are whole numbers, so nothing is rounded.
        let place = |k: i32| k * k;
        for k in 1..400 {
            kalman.push(&[place(k) - place(k - 1)], 2.0);
        }
        let want = 399.0;
        assert!((kalman.slope(0) - want).abs() < 1e-3, "{} against {want}", kalman.slope(0));
    }

    #[test]
    fn variances_stay_positive_whatever_the_counts_and_gaps() {
        for (acceleration, unit) in [(1e5, 1e-9), (1e5, 0.1), (0.1, 1e-9), (0.1, 0.1), (100.0, 2e-5)] {
            for period in [5e-5, 1e-3, 0.02] {
                let mut seed = 7;
                let mut kalman = Kalman::new(acceleration, &[unit; MAX_JOINTS], period);
                for _ in 0..3000 {
                    let counts = (2000.0 * uniform(&mut seed) - 1000.0) as i32;
                    let ticks =
                        1 + if uniform(&mut seed) < 0.1 { (12.0 * uniform(&mut seed)) as u32 } else { 0 };
                    kalman.push(&[counts], ticks as Real);
                    let Filter { p, noise, rate, .. } = &kalman.joints[0];
                    assert!(p.xx > 0.0 && p.xx <= *noise && p.vv > 0.0 && p.aa > 0.0, "{p:?}");
                    // Jumps of 1000 counts up and down are extrapolated by a factor of two. A
                    // filter that diverges would exceed this bound.
                    assert!(rate.abs() < 1e5, "{rate}");
                }
            }
        }
    }
}
