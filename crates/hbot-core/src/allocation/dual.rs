//! The joint torques of least cost by the dual problem.
//!
//! Where the target is within reach, the torques are x_k = clip(give_k b_k.y) for some y of three numbers: the
//! minimiser of the convex, piecewise quadratic D(y) = sum psi_k(b_k.y) - target.y with psi_k' = clip. Newton's
//! step is exact on each piece, and the line search is exact too, so the method ends after a few steps. On the
//! border of the reach y is not unique (it may go to infinity along the facet's normal), but x is.

use super::problem::Problem;
use crate::device::MAX_JOINTS;
use crate::linear::Sym3;
use crate::real::{Real, Vec3, fabs};

/// Random problems take 2 to 9, degenerate ones up to 20. Where that is not enough, the best so far gets its last steps.
const MAX_STEPS: usize = 32;

/// What may be left over at the end, beside the terms that it is the difference of: half the digits. Only rows that are
/// parallel but for a few digits use that up, where the border of the reach itself is known no better.
const FORGIVEN: Real = if Real::EPSILON < 1.0e-10 { 1.5e-8 } else { 3.5e-4 };

/// The y of the torques of least cost for `direction`, were there no limits.
pub(super) fn unlimited(problem: &Problem, direction: Vec3) -> Vec3 {
    let mut moment = Sym3::ZERO;
    for k in 0..problem.n {
        moment.add(problem.rows[k], problem.give[k]);
    }
    let mut y = solve(&moment, direction);
    // Costs that differ by many orders make the moment ill-conditioned, whatever the rows.
    for _ in 0..3 {
        let mut left = direction;
        for k in 0..problem.n {
            left -= problem.rows[k] * (problem.give[k] * problem.rows[k].dot(y));
        }
        y += solve(&moment, left);
    }
    y
}

/// The torques of `size` times y, if none is over its limit and they do make `size` times `direction`.
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

/// The torques of least cost within the limits that make `target`, starting at `y`; `None` where they do not.
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
        // Far out y has few digits left, and no step makes the error less.
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
    // The torques of the joints between their limits have more digits than y: they themselves take the last steps.
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

/// Makes `target` of joint torques that make it but for a part of their terms, to rounding in each coordinate: one may be that of an
/// axis a thousand times as strong as another's, and there a little of it is much. What the joints between their limits change is the
/// least possible, whatever it costs.
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

/// What the torques x leave of the target, Newton's step of y for it, and the sizes of the terms of the difference.
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

/// Newton's step. Directions that no joint between its limits reaches get a long one, which the line search cuts to
/// what is right; coordinates that are not in use, none.
fn solve(moment: &Sym3, left: Vec3) -> Vec3 {
    let trace = moment.trace();
    moment.solve(left, if trace > 0.0 { 8.0 * Real::EPSILON * trace } else { 1.0 })
}

/// Where along `step` the dual function is least: its slope is piecewise linear, so walk from corner to corner until
/// it crosses zero, or is within `noise` of it. `slope` is that at the start, negative.
///
/// On the border of the reach the slope only comes to zero, and rounding must not send y to infinity: so the walk ends
/// within `noise`, and a row that is at right angles to the step but for rounding does not move.
fn line_search(problem: &Problem, y: Vec3, step: Vec3, mut slope: Real, noise: Real) -> Real {
    // Between `from` and `to` joint k is between its limits and bends the slope by `bend`.
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
            // With no corner left the slope stays as it is: only rounding can want to go on.
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
