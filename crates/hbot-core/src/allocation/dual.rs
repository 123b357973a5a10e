//! The joint torques of least cost by the dual problem.
//!
//! Where the target is within reach, the torques are x_k = clip(give_k b_k.y) for some y of three numbers: the
//! minimiser of the convex, piecewise quadratic D(y) = sum psi_k(b_k.y) - target.y with psi_k' = clip. Newton's
//! step is exact on each piece, and the line search is exact too, so the method ends after a few steps. On the
//! border of the reach y is not unique (it may go to infinity along the facet's normal), but x is.

use super::reach::Problem;
use super::sym::Sym3;
use crate::device::MAX_JOINTS;
use crate::real::{Real, Vec3, fabs};

/// More than ten times what was ever seen in random problems, degenerate ones among them.
const MAX_STEPS: usize = 64;

/// What is left over is rounding below this, beside the sum of the terms it is the difference of.
const ROUNDING: Real = 8.0 * Real::EPSILON;

/// Left over beside the target, no more is forgiven.
const MISSED: Real = 65536.0 * Real::EPSILON;

/// The y of the torques of least cost for `direction`, were there no limits.
pub(super) fn unlimited(problem: &Problem, direction: Vec3) -> Vec3 {
    let mut moment = Sym3::ZERO;
    for k in 0..problem.n {
        moment.add(problem.rows[k], problem.give[k]);
    }
    let moment = regular(problem, moment);
    let mut y = moment.solve(direction);
    // What makes the moment safe to solve is taken out again, and with it the rounding of the solve.
    for _ in 0..3 {
        let mut left = direction;
        for k in 0..problem.n {
            left -= problem.rows[k] * (problem.give[k] * problem.rows[k].dot(y));
        }
        y += moment.solve(left);
    }
    y
}

/// The torques of `size` times y, if none is over its limit.
pub(super) fn unsaturated(problem: &Problem, y: Vec3, size: Real) -> Option<[Real; MAX_JOINTS]> {
    let mut x = [0.0; MAX_JOINTS];
    for k in 0..problem.n {
        x[k] = problem.give[k] * problem.rows[k].dot(y) * size;
        if !(fabs(x[k]) <= 1.0) {
            return None;
        }
    }
    Some(x)
}

/// The torques of y, as large as the limits allow up to `size`, and the part of `size` that this is.
pub(super) fn scaled(problem: &Problem, y: Vec3, size: Real) -> ([Real; MAX_JOINTS], Real) {
    let mut x = [0.0; MAX_JOINTS];
    let mut largest: Real = 0.0;
    for k in 0..problem.n {
        x[k] = problem.give[k] * problem.rows[k].dot(y);
        largest = largest.max(fabs(x[k]));
    }
    let reached = if largest * size > 1.0 { 1.0 / largest } else { size };
    if reached.is_finite() { (x.map(|x| x * reached), reached / size) } else { ([0.0; MAX_JOINTS], 0.0) }
}

/// The torques of least cost within the limits that make `target`, starting at `y`; `None` where they do not.
pub(super) fn clipped(problem: &Problem, target: Vec3, mut y: Vec3) -> Option<[Real; MAX_JOINTS]> {
    let mut x = [0.0; MAX_JOINTS];
    let mut stuck = false;
    for _ in 0..MAX_STEPS {
        for k in 0..problem.n {
            x[k] = clip(problem.give[k] * problem.rows[k].dot(y));
        }
        let (left, step, size) = newton(problem, target, &x);
        if stuck || left.abs().max_element() <= ROUNDING * size {
            break;
        }
        let alpha = line_search(problem, y, step, -left.dot(step));
        let next = y + step * alpha;
        stuck = next == y;
        y = next;
    }
    // Far out, y holds the torques of the joints between their limits to few digits; they themselves take a last step.
    let (_, step, _) = newton(problem, target, &x);
    for k in 0..problem.n {
        if fabs(x[k]) < 1.0 {
            x[k] = clip(x[k] + problem.give[k] * problem.rows[k].dot(step));
        }
    }
    let (left, _, size) = newton(problem, target, &x);
    (left.abs().max_element() <= MISSED * size).then_some(x)
}

/// What the torques x leave of the target, Newton's step of y for it, and the size of the terms of the difference.
fn newton(problem: &Problem, target: Vec3, x: &[Real; MAX_JOINTS]) -> (Vec3, Vec3, Real) {
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
    (left, regular(problem, moment).solve(left), size.max_element())
}

/// A moment made safe to solve: unused coordinates keep to themselves, and directions that no joint between its limits
/// reaches get a long step (which the line search cuts to what is right).
fn regular(problem: &Problem, mut moment: Sym3) -> Sym3 {
    let trace = moment.trace();
    let little = if trace > 0.0 { 256.0 * Real::EPSILON * trace } else { 1.0 };
    let diagonal = |k: usize| if k < problem.rank { little } else { 1.0 };
    moment.add_diagonal([diagonal(0), diagonal(1), diagonal(2)]);
    moment
}

/// Where along `step` the dual function is least: its slope is piecewise linear, so walk from corner to corner until
/// it crosses zero. `slope` is that at the start, negative.
fn line_search(problem: &Problem, y: Vec3, step: Vec3, mut slope: Real) -> Real {
    // Between `from` and `to` joint k is between its limits and bends the slope by `bend`.
    let mut from = [Real::INFINITY; MAX_JOINTS];
    let mut to = [Real::INFINITY; MAX_JOINTS];
    let mut bend = [0.0; MAX_JOINTS];
    for k in 0..problem.n {
        let along = problem.rows[k].dot(step);
        let rate = problem.give[k] * along;
        if rate != 0.0 {
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
            // With no corner left the slope stays as it is: only rounding can want to go on.
            return if root.is_finite() { root } else { alpha };
        }
        slope += curvature * (corner - alpha);
        alpha = corner;
        if slope >= 0.0 {
            break;
        }
    }
    alpha
}

fn clip(x: Real) -> Real {
    Real::max(-1.0, Real::min(1.0, x))
}
