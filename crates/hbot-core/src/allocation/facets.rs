//! The facets of what limited joints can make.
//!
//! The torques within reach, sums of x_k b_k with |x_k| <= 1, form a zonotope: a centrally symmetric polytope. The
//! planes that bound it are spanned by two rows each (n = b_i x b_j), because on a facet every row that is not parallel
//! to it must be at its limit; and the farthest that it extends along n is the sum of |b_k.n|. A torque s v is inside
//! if and only if s |v.n| is at most that for all of these n.

use super::problem::Problem;
use crate::device::MAX_JOINTS;
use crate::real::{Real, Vec3, fabs};

/// The facet where a ray from the origin leaves the zonotope.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    /// How often the direction fits: the ray leaves at `reach` times it. Infinite for a zero direction.
    pub(super) reach: Real,
    normal: Vec3,
    span: [usize; 2],
}

/// The facet where the ray along `direction` leaves the zonotope.
///
/// Any normal gives a bound that holds; the facets' give the least. So nearly parallel rows, whose cross product is
/// half rounding, cannot make the answer too small.
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

/// The only joint torques that make `target`, a point of a facet spanned by two rows alone; `None` where more rows lie
/// in the facet (or the rank is below 3), so that there is a choice, or where rounding left no answer.
pub(super) fn on_facet(problem: &Problem, facet: &Facet, target: Vec3) -> Option<[Real; MAX_JOINTS]> {
    let [i, j] = facet.span;
    if i == j {
        return None;
    }
    let n = if facet.normal.dot(target) < 0.0 { -facet.normal } else { facet.normal };
    let (bi, bj) = (problem.rows[i], problem.rows[j]);
    // The normal is known to rounding of |b_i| |b_j|; a row no farther off the facet may lie in it.
    let doubt = problem.rounding * problem.rounding * bi.length_squared() * bj.length_squared();
    let mut x = [0.0; MAX_JOINTS];
    let mut rest = target;
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
    }
    // Cramer's rule with n = b_i x b_j, as it was before its sign was chosen.
    let square = facet.normal.length_squared();
    x[i] = rest.cross(bj).dot(facet.normal) / square;
    x[j] = bi.cross(rest).dot(facet.normal) / square;
    // Outside by more than the rounding of a well-spanned facet: leave it to the general way.
    let limit = 1.0 + 1024.0 * Real::EPSILON;
    (fabs(x[i]) <= limit && fabs(x[j]) <= limit).then_some(x)
}
