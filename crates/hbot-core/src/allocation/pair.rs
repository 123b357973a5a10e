//! The solution for two wheels with at least one joint at its limit. G has four rows, so the null
//! space of Gᵀ is one line and every step has a closed form.

use crate::real::{Real, Vec3, fabs};

/// Largest excess of a least-cost joint torque over its limit that can come from rounding alone, as
/// a fraction of the limit.
const DOUBT: Real = if Real::EPSILON < 1.0e-10 { 2.0e-10 } else { 1.0e-5 };

/// Joint torques change linearly with a free parameter alpha. If a joint torque changes by less
/// than this fraction of the one that changes most, its change can come from rounding alone. The
/// value is about the square root of the rounding error of a [`Real`].
const HARDLY: Real = if Real::EPSILON < 1.0e-10 { 1.5e-8 } else { 3.5e-4 };

/// Returns the least-cost joint torques for the largest reachable torque along `u`, and the size of
/// that torque on the sphere. The size is at most `size`.
///
/// `least` holds the least-cost joint torques for a torque of `u` if there were no limits. `peak`
/// holds the joint limits, 0 for a joint that is not driven. The rows of G must span all three
/// dimensions.
///
/// Let z be the null vector of Gᵀ: joint torques along z make no torque on the sphere. Apart from
/// its sign, z_k is the determinant of the three other rows. Every solution has the form `size`
/// least + alpha z, and alpha = 0 is the cheapest. So the result uses the alpha nearest to 0 that
/// the limits allow.
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

    // For the facet that rows i and j span, the two other rows k and l extend along its normal n by
    // |g_k.n| = |z_l| and |g_l.n| = |z_k|.
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
        // If three rows lie in one plane, alpha moves the fourth joint only by rounding. Alpha must
        // not become huge because this joint exceeds its limit by rounding.
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
    // On the border of the reachable set the interval is one point. If rounding made it empty, the
    // point in between violates both limits equally little.
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
