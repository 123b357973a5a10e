//! A filter over the error of the orientation: it weighs measurements from outside by their
//! uncertainty (physics notes, section 4).
//!
//! The true orientation is q exp(e), with the estimate q and an error e in the sphere's axes. Turns
//! of the sphere multiply q from the left, so they leave e as it is. What they add to it is taken
//! for a random walk: its variance grows with the turn and with the time. A measurement is taken by
//! a Kalman filter, unless it is so far away that only one in a thousand would be.

use crate::design::rig::Rig;
use crate::linear::limited;
use crate::real::{Mat3, PI, Quat, Real, Vec3, atan2, sqrt};
use crate::rotation;

/// Variance that the error gains in each axis with each radian of turn, rad² / rad, on a rig that
/// says no `drift`. If its cones, toes and radii are those of the drawing, the error after ten
/// turns about random axes is 0.15 rad.
const AS_DRAWN: Real = 4.0e-4;
/// Variance that the error gains in each axis with the time, rad² / s. A contact that creeps turns
/// the sphere by a degree in a few hours.
const TIME_VARIANCE: Real = 1.0e-8;
/// Largest variance of the error, rad². No orientation is further away than pi.
const UNKNOWN: Real = PI * PI;
/// Squared distances, relative to what is expected, above which one measurement in a thousand is,
/// for 2 and 3 components (quantiles of chi²).
const GATE: [Real; 2] = [13.816, 16.266];
/// Factor by which the variance grows with each measurement that is refused. So after a fall or a
/// slip that no wheel noticed, measurements that agree with each other are taken in the end.
const DOUBT: Real = 1.1;

/// How fast the error of the orientation grows with the turn of the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Drift {
    /// Variance that the error gains in each axis with each radian, rad² / rad. 0: [`AS_DRAWN`].
    variance: Real,
}

impl Drift {
    pub(crate) fn of(rig: &Rig) -> Self {
        Self { variance: rig.drift.map_or(0.0, |drift| drift * drift) }
    }

    /// Returns the variance that the error gains in each axis in a turn by `angle` rad, rad².
    pub(crate) fn after(self, angle: Real) -> Real {
        angle * if self.variance > 0.0 { self.variance } else { AS_DRAWN }
    }
}

/// The uncertainty of the orientation. It exists once a measurement with a sigma has been taken.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Uncertainty {
    /// Covariance of the error in the sphere's axes, rad².
    covariance: Mat3,
}

/// The result of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fused {
    /// Rotation vector by which the estimate is to be corrected, in the sphere's axes, rad. Zero if
    /// the measurement is refused.
    pub(crate) correction: Vec3,
    /// Angle between the measurement and the estimate, rad.
    pub(crate) angle: Real,
    /// False if the measurement is too far from the estimate.
    pub(crate) used: bool,
}

impl Uncertainty {
    /// An orientation of which nothing is known.
    pub(crate) const NOTHING_KNOWN: Self = Self { covariance: Mat3::from_diagonal(Vec3::splat(UNKNOWN)) };

    /// Lets the uncertainty grow over `dt` seconds, in which the sphere made `turn` (rotation
    /// vector, rad).
    pub(crate) fn grow(&mut self, turn: Vec3, dt: Real, drift: Drift) {
        let variance = drift.after(sqrt(turn.length_squared())) + TIME_VARIANCE * dt;
        let c = &mut self.covariance;
        c.x_axis.x = (c.x_axis.x + variance).min(UNKNOWN);
        c.y_axis.y = (c.y_axis.y + variance).min(UNKNOWN);
        c.z_axis.z = (c.z_axis.z + variance).min(UNKNOWN);
    }

    /// Returns the standard deviations of the error about the axes of frame N, rad, if the estimate
    /// is `q`.
    pub(crate) fn sigma(&self, q: Quat) -> Vec3 {
        let about = |axis: Vec3| {
            let own = q.conjugate() * axis;
            sqrt(own.dot(self.covariance * own).max(0.0))
        };
        Vec3::new(about(Vec3::X), about(Vec3::Y), about(Vec3::Z))
    }

    /// Takes the orientation `measured` (a unit quaternion), which has errors with the standard
    /// deviations `sigma` about the axes of frame N, rad. The estimate was `then` when it was
    /// measured, and its error has gained the variance `since` in each axis since, rad².
    pub(crate) fn take_orientation(&mut self, measured: Quat, sigma: Vec3, then: Quat, since: Real) -> Fused {
        let residual = then.conjugate() * rotation::difference(measured, then);
        let rotate = Mat3::from_quat(then);
        let noise = rotate.transpose() * Mat3::from_diagonal(sigma * sigma) * rotate
            + Mat3::from_diagonal(Vec3::splat(since));
        let inverse = (self.covariance + noise).inverse();
        let angle = sqrt(residual.length_squared());
        // What is no number is refused.
        if !(residual.dot(inverse * residual) <= GATE[1]) {
            return self.refused(angle);
        }
        let gain = self.covariance * inverse;
        let correction = gain * residual;
        self.update(gain, gain * noise * gain.transpose(), correction);
        Fused { correction, angle, used: true }
    }

    /// Takes a direction: the direction `body` of the sphere points to `world` in frame N (unit
    /// vectors), with an error of the standard deviation `sigma` about each axis across it, rad.
    /// The estimate was `then` when it was measured, and its error has gained the variance `since`
    /// in each axis since, rad².
    pub(crate) fn take_direction(
        &mut self,
        (body, world): (Vec3, Vec3),
        sigma: Real,
        then: Quat,
        since: Real,
    ) -> Fused {
        let seen = then.conjugate() * world;
        let (cross, cosine) = (body.cross(seen), body.dot(seen));
        let sine = sqrt(cross.length_squared());
        let angle = atan2(sine, cosine);
        // Across the direction of the estimate, not the measured one: its noise would say something
        // about the turn around it.
        let (a, b) = seen.any_orthonormal_pair();
        let axis = match (sine > 0.0, cosine > 0.0) {
            (true, _) => cross / sine,
            // At the opposite direction every axis across is as good.
            (false, false) => a,
            (false, true) => Vec3::ZERO,
        };
        let residual = axis * angle;
        let (along_a, along_b) = (self.covariance * a, self.covariance * b);
        let noise = sigma * sigma + since;
        let (aa, ab, bb) = (a.dot(along_a) + noise, a.dot(along_b), b.dot(along_b) + noise);
        let det = aa * bb - ab * ab;
        let (x, y) = (residual.dot(a), residual.dot(b));
        // The inverse of the 2 x 2 matrix, times the residual.
        let (u, v) = ((bb * x - ab * y) / det, (aa * y - ab * x) / det);
        if !(x * u + y * v <= GATE[0]) {
            return self.refused(angle);
        }
        let gain_a = (along_a * bb - along_b * ab) / det;
        let gain_b = (along_b * aa - along_a * ab) / det;
        let outer = |p: Vec3, q: Vec3| Mat3::from_cols(p * q.x, p * q.y, p * q.z);
        let gain = outer(gain_a, a) + outer(gain_b, b);
        let correction = gain_a * x + gain_b * y;
        self.update(gain, (outer(gain_a, gain_a) + outer(gain_b, gain_b)) * noise, correction);
        Fused { correction, angle, used: true }
    }

    fn refused(&mut self, angle: Real) -> Fused {
        let most = self.covariance.x_axis.x.max(self.covariance.y_axis.y).max(self.covariance.z_axis.z);
        if most * DOUBT < UNKNOWN {
            self.covariance *= DOUBT;
        }
        Fused { correction: Vec3::ZERO, angle, used: false }
    }

    /// Updates the covariance to (1 - `gain`) P (1 - `gain`)ᵀ + `noise`, which stays symmetric and
    /// positive whatever the gain (Joseph's form).
    ///
    /// The covariance then turns with the sphere's axes, which `correction` turns: in frame N it
    /// stays. Else a large correction by a direction would say something about the turn around it
    /// (the invariant filter of Barrau and Bonnabel 2017).
    fn update(&mut self, gain: Mat3, noise: Mat3, correction: Vec3) {
        let left = Mat3::IDENTITY - gain;
        let turn = Mat3::from_quat(rotation::exp(-correction));
        let new = turn * (left * self.covariance * left.transpose() + noise) * turn.transpose();
        // Rounding must not make it unsymmetric.
        self.covariance = (new + new.transpose()) * 0.5;
    }
}

/// Returns the rotation vector of the turn by `first` and then, in the turned axes, by `second`,
/// rad. It is at most pi long.
pub(crate) fn combined(first: Vec3, second: Vec3) -> Vec3 {
    limited(rotation::log(rotation::exp(first) * rotation::exp(second)), PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEGREE: Real = PI / 180.0;
    const AS_A_DRAWING: Drift = Drift { variance: 0.0 };

    fn known(sigma: Real) -> Uncertainty {
        Uncertainty { covariance: Mat3::from_diagonal(Vec3::splat(sigma * sigma)) }
    }

    fn near(a: Vec3, b: Vec3, most: Real) -> bool {
        (a - b).length_squared() < most * most
    }

    #[test]
    fn two_equal_uncertainties_meet_in_the_middle() {
        let then = rotation::exp(Vec3::new(0.4, -1.0, 0.7));
        let mut filter = known(0.02);
        // Measured 0.03 rad about n2 from the estimate.
        let measured = rotation::exp(Vec3::Y * 0.03) * then;
        let fused = filter.take_orientation(measured, Vec3::splat(0.02), then, 0.0);
        let halfway = then.conjugate() * (Vec3::Y * 0.015);
        assert!(fused.used && near(fused.correction, halfway, 1e-6), "{}", fused.correction);
        assert!((fused.angle - 0.03).abs() < 1e-6);
        let left = 0.02 * core::f64::consts::FRAC_1_SQRT_2 as Real;
        assert!(near(filter.sigma(then), Vec3::splat(left), 1e-6));
    }

    #[test]
    fn the_first_measurement_is_taken_as_it_is_and_its_sigma_is_about_the_axes_of_n() {
        let then = rotation::exp(Vec3::new(0.4, -1.0, 0.7));
        let mut filter = Uncertainty::NOTHING_KNOWN;
        let measured = rotation::exp(Vec3::new(0.5, 0.2, -0.3)) * then;
        let sigma = Vec3::new(0.01, 0.02, 0.05);
        let fused = filter.take_orientation(measured, sigma, then, 0.0);
        let got = then * rotation::exp(fused.correction);
        assert!(rotation::angle_between(got, measured) < 1e-3);
        assert!(near(filter.sigma(got), sigma, 1e-4), "{}", filter.sigma(got));
    }

    #[test]
    fn a_direction_says_nothing_about_the_turn_around_it() {
        let then = rotation::exp(Vec3::new(0.4, -1.0, 0.7));
        let mut filter = known(0.1);
        let truth = rotation::exp(Vec3::new(0.05, -0.03, 0.08)) * then;
        let body = truth.conjugate() * -Vec3::Z;
        let fused = filter.take_direction((body, -Vec3::Z), 1e-4, then, 0.0);
        assert!(fused.used);
        let got = then * rotation::exp(fused.correction);
        // The tilt is found, to the square of the turn about n3 that stays.
        assert!(near(got * body, -Vec3::Z, 5e-4), "{}", got * body);
        let sigma = filter.sigma(got);
        assert!(sigma.x < 2e-4 && sigma.y < 2e-4 && (sigma.z - 0.1).abs() < 1e-4, "{sigma}");
    }

    #[test]
    fn a_measurement_beyond_the_gate_changes_nothing_but_the_doubt() {
        let then = Quat::IDENTITY;
        let far = |angle: Real| rotation::exp(Vec3::X * angle);
        // sqrt(16.266 (0.01² + 0.01²)) = 0.05704 rad.
        for (angle, used) in [(0.0569, true), (0.0572, false)] {
            let mut filter = known(0.01);
            let fused = filter.take_orientation(far(angle), Vec3::splat(0.01), then, 0.0);
            assert_eq!((fused.used, fused.correction == Vec3::ZERO), (used, !used), "{angle}");
        }
        // sqrt(13.816 (0.01² + 0.01²)) = 0.05257 rad.
        for (angle, used) in [(0.0524, true), (0.0527, false)] {
            let mut filter = known(0.01);
            let body = far(angle).conjugate() * Vec3::Z;
            let fused = filter.take_direction((body, Vec3::Z), 0.01, then, 0.0);
            assert_eq!(fused.used, used, "{angle}");
        }
        // Measurements that agree with each other are taken in the end.
        let mut filter = known(0.01);
        let refused = (0..200)
            .take_while(|_| !filter.take_orientation(far(0.5), Vec3::splat(0.01), then, 0.0).used)
            .count();
        assert!((10..100).contains(&refused), "{refused}");
    }

    #[test]
    fn the_uncertainty_grows_with_turn_and_time_up_to_a_half_turn() {
        let mut filter = known(0.0);
        for _ in 0..1000 {
            filter.grow(Vec3::new(0.0, 0.02, 0.0), 1.0e-3, AS_A_DRAWING);
        }
        let want = sqrt(20.0 * AS_DRAWN + TIME_VARIANCE);
        assert!(near(filter.sigma(Quat::IDENTITY), Vec3::splat(want), 1e-5 * want));
        for _ in 0..100 {
            filter.grow(Vec3::X * 1e4, 1.0, AS_A_DRAWING);
        }
        assert!(near(filter.sigma(Quat::IDENTITY), Vec3::splat(PI), 1e-3));
    }

    /// A camera with noise of a degree leaves less than half a degree, and its own sigma says so.
    #[test]
    fn many_measurements_leave_less_than_each() {
        let mut filter = Uncertainty::NOTHING_KNOWN;
        let (mut estimate, mut state) = (Quat::IDENTITY, 1_u32);
        let mut noise = || {
            // The sum of four uniform numbers of variance 1/12 each, scaled to a degree.
            let mut sum = 0.0;
            for _ in 0..4 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                sum += (state >> 8) as Real / 16_777_216.0 - 0.5;
            }
            sum * sqrt(3.0) * DEGREE
        };
        for _ in 0..300 {
            let measured = rotation::exp(Vec3::new(noise(), noise(), noise()));
            let fused = filter.take_orientation(measured, Vec3::splat(DEGREE), estimate, 0.0);
            estimate = rotation::renormalized(estimate * rotation::exp(fused.correction));
            filter.grow(Vec3::X * 0.002, 1.0 / 30.0, AS_A_DRAWING);
        }
        assert!(rotation::angle_between(estimate, Quat::IDENTITY) < 0.5 * DEGREE);
        assert!(filter.sigma(estimate).max_element() < 0.5 * DEGREE);
    }
}
