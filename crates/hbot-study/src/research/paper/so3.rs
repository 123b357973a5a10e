//! Orientations spread evenly over SO(3), and the paper's own grid (section V.C).
//!
//! Both use Hopf coordinates: (theta, phi) is a point of the sphere, and psi an angle on a circle
//! above it (eq. 23 as corrected in the physics notes, section 10). The measure of SO(3) is the
//! product of the two. So points of equal area on the sphere (HEALPix) times equal steps of psi are
//! spread evenly, as in the paper's source (Yershova et al. 2010). Equal steps of theta are not;
//! they need the weight sin theta.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use hbot_core::{Quat, rotation};

/// Number of angles psi for each point (theta, phi) in Hopf coordinates, at level 0. The number
/// doubles with each level.
const CIRCLE: u64 = 6;

/// Returns the number of orientations that [`uniform`] gives at `level`: 72, 576, 4608, 36864,
/// 294912, ...
pub(crate) const fn count(level: u8) -> usize {
    72 << (3 * level)
}

/// Returns orientations that are spread evenly over SO(3), with equal weights and always in the
/// same order.
///
/// A higher `level` gives more of them; 0 to 5 is practical. There are [`count`] of them, with a
/// distance of about 1.05 rad / 2^level in psi. Each rotation occurs once, as a quaternion of
/// either sign.
pub(crate) fn uniform(level: u8) -> impl Iterator<Item = Quat> {
    let pixels = 12_u64 << (2 * level);
    let steps = CIRCLE << level;
    (0..pixels).flat_map(move |pixel| {
        let (phi, latitude) = cdshealpix::nested::center(level, pixel);
        (0..steps).map(move |k| {
            let psi = TAU * (k as f64 + 0.5) / steps as f64;
            rotation::from_hopf(FRAC_PI_2 - latitude, phi, psi)
        })
    })
}

/// Returns the orientations of the paper's grid: equal steps of pi/`steps` in each Hopf coordinate,
/// with both ends of theta. Each orientation has the weight sin theta, which the paper omits.
pub(crate) fn equal_steps(steps: u32) -> impl Iterator<Item = (Quat, f64)> {
    let h = PI / f64::from(steps);
    (0..=steps).flat_map(move |i| {
        let theta = h * f64::from(i);
        (0..2 * steps).flat_map(move |j| {
            let each = move |k| {
                let q = rotation::from_hopf(theta, h * f64::from(j), h * f64::from(k));
                (q, libm::sin(theta))
            };
            (0..2 * steps).map(each)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_core::Vec3;

    /// Returns the mean square and the mean fourth power of the projections of all orientations
    /// onto each of some fixed quaternions. If the orientations are spread evenly over SO(3), these
    /// means are 1/4 and 1/8, the values for a coordinate of the unit sphere in four dimensions.
    fn moments(weighted: impl Iterator<Item = (Quat, f64)>) -> Vec<[f64; 2]> {
        let weighted: Vec<(Quat, f64)> = weighted.collect();
        let looks =
            [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.5, -0.5, 0.5], [0.1, 0.7, -0.2, 0.68]];
        let looks = looks.map(|look| rotation::from_wxyz(look).expect("not zero"));
        let mean = |look: Quat| {
            let mut sums = [0.0; 3];
            for &(q, weight) in &weighted {
                let square = q.dot(look) * q.dot(look);
                sums[0] += weight;
                sums[1] += weight * square;
                sums[2] += weight * square * square;
            }
            [sums[1] / sums[0], sums[2] / sums[0]]
        };
        looks.map(mean).to_vec()
    }

    #[test]
    fn uniform_orientations_have_the_moments_of_so3() {
        for level in 0..3 {
            assert_eq!(uniform(level).count(), count(level));
            for [second, fourth] in moments(uniform(level).map(|q| (q, 1.0))) {
                // The error of a grid is of the order of the square of its step, which is
                // proportional to 2^-level.
                let bound = 0.02 / f64::from(1_u32 << (2 * level));
                assert!((second - 0.25).abs() < bound, "level {level}: {second}");
                assert!((fourth - 0.125).abs() < bound, "level {level}: {fourth}");
            }
        }
    }

    #[test]
    fn uniform_orientations_are_unit_and_apart() {
        let all: Vec<Quat> = uniform(1).collect();
        for (k, q) in all.iter().enumerate() {
            assert!((q.length_squared() - 1.0).abs() < 4.0 * f64::EPSILON);
            let nearest = all[..k].iter().map(|other| rotation::angle_between(*q, *other));
            // The even spread is over a volume of pi²; 576 balls of this size fill less than half
            // of it.
            assert!(nearest.fold(f64::INFINITY, f64::min) > 0.25);
        }
        assert!(all.iter().any(|q| rotation::log(*q).dot(Vec3::Z).abs() > 2.5));
    }

    #[test]
    fn equal_steps_need_their_weight() {
        let steps = 12;
        // The two ends and the middle of theta enter a sum of 13 terms instead of an integral,
        // which leaves a relative error of h²/12.
        let bound = 0.01;
        for [second, fourth] in moments(equal_steps(steps)) {
            assert!((second - 0.25).abs() < bound && (fourth - 0.125).abs() < bound, "{second} {fourth}");
        }
        // Without the weight the fourth moment about the first axis is at least 9/64.
        let bare = moments(equal_steps(steps).map(|(q, _)| (q, 1.0)));
        assert!(bare.iter().any(|[_, fourth]| (fourth - 0.125).abs() > bound), "{bare:?}");
    }
}
