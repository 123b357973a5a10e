//! Finds the joint torques of least cost by solving the dual problem.
//!
//! If the target is reachable, the torques are x_k = clip(give_k b_k.y) for some vector y of three
//! numbers. This y minimises the convex, piecewise quadratic function D(y) = sum psi_k(b_k.y) -
//! target.y, in which the derivative of psi_k(z) is clip(give_k z). A Newton step is exact on each
//! piece and the line search is exact too, so the method ends after a few steps. On the border of
//! the reachable set y is not unique and can go to infinity along the facet's normal, but x is
//! unique.

use super::problem::Problem;
use crate::design::device::MAX_JOINTS;
use crate::linear::Sym3;
use crate::real::{Real, Vec3, fabs};

/// Largest number of Newton steps of the dual method. Random problems need 2 to 9 steps, degenerate
/// ones up to 20. If the method stops at this number, the final corrections start from the best
/// solution so far.
const MAX_STEPS: usize = 32;

/// Largest residual torque with which a solution is still accepted, as a fraction of the largest
/// term in the sum of torques. The value is about the square root of the rounding error of a
/// [`Real`]. Only joints that act on the sphere in nearly parallel directions cause a residual of
/// this size. For them, rounding also limits how accurately the largest reachable torque is known.
pub(super) const FORGIVEN: Real = if Real::EPSILON < 1.0e-10 { 1.5e-8 } else { 3.5e-4 };

/// Returns the vector y of three numbers from which the least-cost joint torques follow, if joints
/// have no limits. With these joint torques, the torque on the sphere is `direction`.
pub(super) fn unlimited(problem: &Problem, direction: Vec3) -> Vec3 {
    let mut moment = Sym3::ZERO;
    for k in 0..problem.n {
        moment.add(problem.rows[k], problem.give[k]);
    }
    let mut y = solve(&moment, direction);
    // Refinement: costs that differ by many orders of magnitude make the moment ill-conditioned,
    // whatever the rows.
    for _ in 0..3 {
        let mut left = direction;
        for k in 0..problem.n {
            left -= problem.rows[k] * (problem.give[k] * problem.rows[k].dot(y));
        }
        y += solve(&moment, left);
    }
    y
}

/// Returns the joint torques that follow from the dual vector `size * y`. Returns `None` if a joint
/// torque exceeds its limit, or if the joint torques do not make the torque `size * direction` on
/// the sphere.
pub(super) fn unsaturated(
    problem: &Problem,
    y: Vec3,
    direction: Vec3,
    size: Real,
) -> Option<[Real; MAX_JOINTS]> {
    let mut x = [0.0; MAX_JOINTS];
    let mut left = direction;
    let mut terms = direction.abs();
    for k in 0..problem.n {
        let gives = problem.give[k] * problem.rows[k].dot(y);
        left -= problem.rows[k] * gives;
        terms += (problem.rows[k] * gives).abs();
        x[k] = gives * size;
    }
    let made = left.abs().max_element() <= FORGIVEN * terms.max_element();
    (made && x.iter().all(|x| fabs(*x) <= 1.0)).then_some(x)
}

/// Returns the least-cost joint torques that make the torque `target` on the sphere within the
/// joint limits. Returns `None` if the torques found do not make `target`. The search starts at the
/// dual vector `y`.
pub(super) fn clipped(problem: &Problem, target: Vec3, mut y: Vec3) -> Option<[Real; MAX_JOINTS]> {
    let mut best = [0.0; MAX_JOINTS];
    let (mut least, mut stalls) = (Real::INFINITY, 0);
    for _ in 0..MAX_STEPS {
        let mut x = [0.0; MAX_JOINTS];
        for k in 0..problem.n {
            x[k] = clip(problem.give[k] * problem.rows[k].dot(y));
        }
        let (left, step, sizes) = newton(problem, target, &x);
        let size = sizes.max_element();
        let error = left.abs().max_element();
        // Far from the origin y has few accurate digits, and steps stop reducing the error.
        stalls = if error < 0.5 * least { 0 } else { stalls + 1 };
        if error < least {
            (best, least) = (x, error);
        }
        if least <= problem.rounding * size || (stalls > 3 && least <= FORGIVEN * size) {
            break;
        }
        let noise = problem.rounding * size * step.abs().element_sum();
        y += step * line_search(problem, y, step, -left.dot(step), noise);
    }
    // The torques of the joints between their limits have more accurate digits than y. So the last
    // steps correct these torques directly.
    for _ in 0..4 {
        let (left, step, sizes) = newton(problem, target, &best);
        least = left.abs().max_element() / sizes.max_element();
        if least <= problem.rounding {
            break;
        }
        for k in 0..problem.n {
            if fabs(best[k]) < 1.0 {
                best[k] = clip(best[k] + problem.give[k] * problem.rows[k].dot(step));
            }
        }
    }
    (least <= FORGIVEN).then_some(best)
}

/// Corrects rounding errors in the joint torques `x`, so that they make each component of the
/// torque `target` to within rounding.
///
/// `x` must already make `target` except for a small error. Each component is corrected relative to
/// its own size, because torque about one axis can be a thousand times as strong as about another.
/// Joints at their limits stay there, and all other joint torques change as little as possible.
/// Costs are ignored.
pub(super) fn polish(problem: &Problem, target: Vec3, x: &mut [Real; MAX_JOINTS]) {
    let equal = Problem { give: [1.0; MAX_JOINTS], ..*problem };
    let mut next = *x;
    let mut least = Real::INFINITY;
    for _ in 0..4 {
        let (left, step, sizes) = newton(&equal, target, &next);
        let off = (left.abs() / sizes.max(Vec3::splat(Real::MIN_POSITIVE))).max_element();
        if off < least {
            (*x, least) = (next, off);
        }
        if off <= 2.0 * Real::EPSILON {
            break;
        }
        for k in 0..problem.n {
            if fabs(next[k]) < 1.0 {
                next[k] = clip(next[k] + problem.rows[k].dot(step));
            }
        }
    }
}

/// Returns three vectors for the joint torques `x`. The first is the residual: the part of the
/// torque `target` that `x` does not make. The second is the Newton step of the dual vector y for
/// this residual. The third is a scale for rounding errors: for each component, the sum of the
/// sizes of the residual's terms.
fn newton(problem: &Problem, target: Vec3, x: &[Real; MAX_JOINTS]) -> (Vec3, Vec3, Vec3) {
    let mut left = target;
    let mut size = target.abs();
    let mut moment = Sym3::ZERO;
    for k in 0..problem.n {
        let part = problem.rows[k] * x[k];
        left -= part;
        size += part.abs();
        if fabs(x[k]) < 1.0 {
            moment.add(problem.rows[k], problem.give[k]);
        }
    }
    (left, solve(&moment, left), size)
}

/// Returns the Newton step of the dual vector y for the residual torque `left`.
///
/// If no joint between its limits can make torque along the residual, the step is very long. The
/// line search then shortens it. For a component that the problem does not use, the step is zero.
fn solve(moment: &Sym3, left: Vec3) -> Vec3 {
    let trace = moment.trace();
    moment.solve(left, if trace > 0.0 { 8.0 * Real::EPSILON * trace } else { 1.0 })
}

/// Returns the factor t at which the dual function D(`y` + t `step`) is smallest.
///
/// Along `step`, the slope of D is piecewise linear. It changes at corners, where a joint reaches
/// or leaves a limit. The search goes from corner to corner until the slope crosses zero or comes
/// within `noise` of zero. `slope` is the slope at the start, which is negative.
///
/// If the wanted torque is on the border of the reachable set, the slope only approaches zero, and
/// rounding could send y to infinity. The search therefore stops within `noise`. It also ignores
/// joints whose rows are at right angles to `step` except for rounding.
fn line_search(problem: &Problem, y: Vec3, step: Vec3, mut slope: Real, noise: Real) -> Real {
    // For a position between `from` and `to`, joint k is between its limits and adds `bend` to the
    // curvature.
    let mut from = [Real::INFINITY; MAX_JOINTS];
    let mut to = [Real::INFINITY; MAX_JOINTS];
    let mut bend = [0.0; MAX_JOINTS];
    for k in 0..problem.n {
        let along = problem.rows[k].dot(step);
        let rate = problem.give[k] * along;
        let terms = problem.rows[k].abs().dot(step.abs());
        if fabs(along) > problem.rounding * terms {
            let start = problem.give[k] * problem.rows[k].dot(y);
            let (a, b) = ((-1.0 - start) / rate, (1.0 - start) / rate);
            (from[k], to[k]) = if a < b { (a, b) } else { (b, a) };
            bend[k] = rate * along;
        }
    }
    let mut alpha = 0.0;
    for _ in 0..2 * problem.n + 1 {
        let mut curvature = 0.0;
        let mut corner = Real::INFINITY;
        for k in 0..problem.n {
            if from[k] > alpha {
                corner = corner.min(from[k]);
            } else if to[k] > alpha {
                corner = corner.min(to[k]);
                curvature += bend[k];
            }
        }
        let root = if curvature > 0.0 { alpha - slope / curvature } else { Real::INFINITY };
        if root <= corner {
            // If no corner is left, the slope is constant, and only rounding could ask for a longer
            // step.
            return if root.is_finite() { root } else { alpha };
        }
        slope += curvature * (corner - alpha);
        alpha = corner;
        if slope >= -noise {
            break;
        }
    }
    alpha
}

fn clip(x: Real) -> Real {
    Real::max(-1.0, Real::min(1.0, x))
}
