//! Two wheels, at least one joint at its limit: four rows, so the null space of Gᵀ is one line and everything has a
//! closed form.

use crate::real::{Real, Vec3, fabs};

/// Part of its limit that rounding may have added to a torque of least cost.
const DOUBT: Real = if Real::EPSILON < 1.0e-10 { 2.0e-10 } else { 1.0e-5 };

/// Beside the joint that alpha moves most, one that it moves no more than this (the root of rounding) hardly moves.
const HARDLY: Real = if Real::EPSILON < 1.0e-10 { 1.5e-8 } else { 3.5e-4 };

/// The largest size up to `size` with which the four joints can make torque along `u`, and the joint torques of least
/// cost that make it.
///
/// `least` holds the joint torques of least cost for `u` itself (limits aside), `peak` the limits (0 for a joint that
/// gives nothing). The rows must span space.
///
/// With z the null vector of Gᵀ (z_k is, but for its sign, the determinant of the three other rows), every solution is
/// `size` least + alpha z, and alpha = 0 is cheapest: so alpha is 0 taken into the interval that the limits leave.
pub(super) fn saturated(
    rows: &[Vec3; 4],
    peak: &[Real; 4],
    least: &[Real; 4],
    u: Vec3,
    size: Real,
) -> ([Real; 4], Real) {
    let [g0, g1, g2, g3] = *rows;
    let (n12, n13, n23) = (g1.cross(g2), g1.cross(g3), g2.cross(g3));
    let z = [g1.dot(n23), -g0.dot(n23), g0.dot(n13), -g0.dot(n12)];

    // Of the facet spanned by rows i and j, the rows k and l reach |g_k.n| = |z_l| and |g_l.n| = |z_k| along its normal.
    let mut reached = size;
    let mut facet = |n: Vec3, k: usize, l: usize| {
        let height = peak[k] * fabs(z[l]) + peak[l] * fabs(z[k]);
        let along = fabs(u.dot(n));
        if height < along * reached {
            reached = height / along;
        }
    };
    facet(n23, 0, 1);
    facet(n13, 0, 2);
    facet(n12, 0, 3);
    facet(g0.cross(g3), 1, 2);
    facet(g0.cross(g2), 1, 3);
    facet(g0.cross(g1), 2, 3);

    let particular = least.map(|x| x * reached);
    let steepest = z.iter().fold(0.0, |most: Real, z| most.max(fabs(*z)));
    let (mut low, mut high) = (Real::NEG_INFINITY, Real::INFINITY);
    let (mut low_slope, mut high_slope) = (0.0, 0.0);
    for k in 0..4 {
        if z[k] == 0.0 {
            continue;
        }
        let slope = fabs(z[k]);
        // Three rows in one plane: alpha does not move the fourth joint but for rounding, and must not be pushed far away
        // because that joint is over its limit by rounding.
        let limit = if slope < HARDLY * steepest { peak[k] * (1.0 + DOUBT) } else { peak[k] };
        let (a, b) = ((-limit - particular[k]) / z[k], (limit - particular[k]) / z[k]);
        let (a, b) = if a < b { (a, b) } else { (b, a) };
        if a > low {
            (low, low_slope) = (a, slope);
        }
        if b < high {
            (high, high_slope) = (b, slope);
        }
    }
    // On the border of what can be made the interval is one point; where rounding turned it inside out, the point
    // between that violates both limits equally little.
    let alpha = if low <= high {
        Real::min(Real::max(0.0, low), high)
    } else {
        (low * low_slope + high * high_slope) / (low_slope + high_slope)
    };
    let mut tau = [0.0; 4];
    for k in 0..4 {
        tau[k] = Real::max(-peak[k], Real::min(peak[k], particular[k] + alpha * z[k]));
    }
    (tau, reached)
}
