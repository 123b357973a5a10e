//! The facets of the set of torques that joints with limits can make.
//!
//! The reachable torques, sums of x_k b_k with |x_k| <= 1, form a zonotope: a centrally symmetric
//! polytope. Each plane that bounds it is spanned by two rows and has the normal n = b_i x b_j. The
//! reason is that on a facet every row that is not parallel to the facet is at its limit. The
//! zonotope extends along n by the sum of |b_k.n|. A torque s v is inside if and only if s |v.n| is
//! at most this sum for all of these normals.

use super::dual::FORGIVEN;
use super::problem::Problem;
use crate::design::device::MAX_JOINTS;
use crate::real::{Real, Vec3, fabs};

/// The facet through which a ray from the origin leaves the set of reachable torques. This set is a
/// zonotope: a convex polytope that is symmetric about the origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    /// Multiple of the ray's direction at which the ray meets the facet. Infinite if the direction
    /// is zero.
    pub(super) reach: Real,
    normal: Vec3,
    span: [usize; 2],
}

/// Returns the facet through which the ray along `direction` leaves the set of reachable torques.
///
/// Each pair of rows of the problem gives a normal, and each normal gives an upper bound on the
/// reachable torque. The smallest bound belongs to the facet. If two rows are nearly parallel,
/// their normal is inaccurate, but its bound is still valid. So it cannot make the result too
/// small.
pub(super) fn nearest(problem: &Problem, direction: Vec3) -> Facet {
    let mut best = Facet { reach: Real::INFINITY, normal: Vec3::ZERO, span: [0, 0] };
    let rows = &problem.rows[..problem.n];
    let mut consider = |normal: Vec3, span: [usize; 2]| {
        let along = fabs(direction.dot(normal));
        let beyond = if along > 0.0 { best.reach * along } else { return };
        let mut height = 0.0;
        for row in rows {
            height += fabs(row.dot(normal));
        }
        if height < beyond {
            best = Facet { reach: height / along, normal, span };
        }
    };
    match problem.rank {
        3 => {
            for i in 0..rows.len() {
                for j in i + 1..rows.len() {
                    consider(rows[i].cross(rows[j]), [i, j]);
                }
            }
        }
        2 => {
            for i in 0..rows.len() {
                consider(Vec3::new(-rows[i].y, rows[i].x, 0.0), [i, i]);
            }
        }
        _ => consider(Vec3::X, [0, 0]),
    }
    best
}

/// Returns the joint torques, as fractions of their limits, that make the torque `target`. `target`
/// must be a point on `facet`.
///
/// Joint torques are unique only on a facet that is spanned by exactly two rows. So the result is
/// `None` if more than two rows lie in the facet, or if the rank is below 3. It is also `None` if
/// rounding led to a torque above its limit, or to torques that do not make `target`.
pub(super) fn on_facet(problem: &Problem, facet: &Facet, target: Vec3) -> Option<[Real; MAX_JOINTS]> {
    let [i, j] = facet.span;
    if i == j {
        return None;
    }
    let n = if facet.normal.dot(target) < 0.0 { -facet.normal } else { facet.normal };
    let (bi, bj) = (problem.rows[i], problem.rows[j]);
    // The normal is known only to the rounding of |b_i| |b_j|. A row this close to the facet could
    // lie in it.
    let doubt = problem.rounding * problem.rounding * bi.length_squared() * bj.length_squared();
    let mut x = [0.0; MAX_JOINTS];
    let (mut rest, mut terms) = (target, target.abs());
    for k in 0..problem.n {
        if k == i || k == j {
            continue;
        }
        let b = problem.rows[k];
        let height = b.dot(n);
        if height * height <= doubt * b.length_squared() {
            return None;
        }
        x[k] = if height > 0.0 { 1.0 } else { -1.0 };
        rest -= b * x[k];
        terms += b.abs();
    }
    // Cramer's rule with n = b_i x b_j, before its sign was changed.
    let square = facet.normal.length_squared();
    x[i] = rest.cross(bj).dot(facet.normal) / square;
    x[j] = bi.cross(rest).dot(facet.normal) / square;
    // The solution exceeds a limit by more than the rounding of a well-spanned facet. The general
    // method has to solve it.
    let limit = 1.0 + 1024.0 * Real::EPSILON;
    // The normal of rows that are nearly parallel has few accurate digits, and so has the solution.
    let left = rest - bi * x[i] - bj * x[j];
    let made = left.abs().max_element() <= FORGIVEN * terms.max_element();
    (made && fabs(x[i]) <= limit && fabs(x[j]) <= limit).then_some(x)
}
