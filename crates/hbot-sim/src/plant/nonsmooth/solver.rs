//! Finds the speeds after a step as the unique minimum of a strictly convex function.
//!
//! With A positive definite, it minimises 1/2 uᵀ A u - rᵀ u + sum g_k(W_k u) over the speeds u.
//! Stops, and friction of a fixed limit, have convex g_k. The minimum therefore exists and is
//! unique for any masses. It is found by the method of multipliers (Rockafellar 1976) with Newton
//! steps inside. Each subproblem is strictly convex and smooth except for kinks. Semismooth Newton
//! steps with a line search on the slope converge from any start (Qi and Sun 1993).
//!
//! Speeds are scaled so that A has a unit diagonal. Penalties are then relative to the mass of each
//! row.

use super::law::{Element, Law, MAX_DIMENSION, Response, Row};
use super::{MAX_SPEEDS, Vector};

/// Initial penalty of the method of multipliers, relative to the mass on which a law acts. With a
/// larger penalty, the method needs fewer rounds but loses digits.
const PENALTY: f64 = 1.0e3;
/// Largest penalty of the method of multipliers. Above it, rounding errors of the Newton matrix
/// become noticeable.
const MAX_PENALTY: f64 = 1.0e9;
/// Largest velocity that the solver can leave to a sticking part. It is relative to the velocity
/// that the momentum and the impulses of the step would cause.
const STICKING: f64 = 1.0e-12;
/// Slope of the minimised function that counts as zero in a line search, as a fraction of the slope
/// at the start of the search.
const LEVEL: f64 = 1.0e-2;
/// Safety factor for rounding: a gradient up to this many times the estimated rounding error counts
/// as zero.
const NEAR: f64 = 64.0;
/// Tolerance that replaces [`STICKING`] if the solution does not improve even with the largest
/// penalties.
///
/// This happens if no equation determines some of the impulses, as in a device that is held fast
/// everywhere, or a gear with almost no play. These impulses then drift slowly while the speeds
/// stay constant.
const STALLED: f64 = 1.0e-10;
const MAX_ROUNDS: usize = 60;
const MAX_NEWTON: u32 = 60;
const MAX_HALVINGS: usize = 40;

/// The mass matrix and the momentum of one step. They define the quadratic part of the function
/// that the solver minimises over the speeds. `mass` is stored by rows, and only its lower half is
/// used.
#[derive(Debug, Clone)]
pub(super) struct StepProblem {
    pub(super) n: usize,
    pub(super) mass: [Vector; MAX_SPEEDS],
    pub(super) momentum: Vector,
    /// Whether `mass` contains springs. These can be so large that their shares in the product of
    /// mass and speeds nearly cancel, and leave their rounding errors.
    pub(super) springs: bool,
}

/// How many iterations the solver needed in one step of a plant with sticking, slip or play.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Number of rounds of the method of multipliers.
    pub rounds: u32,
    /// Total number of Newton steps in all rounds.
    pub newton: u32,
    /// Whether the solver converged within its limits of rounds and Newton steps.
    pub converged: bool,
}

/// Memory that the solver reuses in every step, so that a step allocates nothing.
#[derive(Debug, Clone)]
pub(super) struct Workspace {
    factor: [Vector; MAX_SPEEDS],
    scale: Vector,
    scaled: Vec<Element>,
    responses: Vec<Response>,
    penalty: Vec<f64>,
    size: Vec<f64>,
}

impl StepProblem {
    pub(super) const EMPTY: Self =
        Self { n: 0, mass: [[0.0; MAX_SPEEDS]; MAX_SPEEDS], momentum: [0.0; MAX_SPEEDS], springs: false };

    /// Adds an inertia to the mass matrix. It couples the velocities `a` and `b`, so the matrix
    /// mass aᵀ b is added.
    pub(super) fn weigh(&mut self, a: &Row, b: &Row, mass: f64) {
        for (i, a) in a.terms() {
            for (j, b) in b.terms() {
                self.mass[i][j] += mass * a * b;
            }
        }
    }

    /// Adds an impulse to the momentum. It acts in the direction of the velocity `row`.
    pub(super) fn push(&mut self, row: &Row, impulse: f64) {
        for (i, by) in row.terms() {
            self.momentum[i] += by * impulse;
        }
    }
}

impl Workspace {
    pub(super) fn new(elements: usize) -> Self {
        Self {
            factor: [[0.0; MAX_SPEEDS]; MAX_SPEEDS],
            scale: [0.0; MAX_SPEEDS],
            scaled: Vec::with_capacity(elements),
            responses: Vec::with_capacity(elements),
            penalty: Vec::with_capacity(elements),
            size: Vec::with_capacity(elements),
        }
    }

    /// Solves for the speeds at the end of a step, starting from the guess in `speeds`. `elements`
    /// holds start values of the impulses, which are replaced by the solution.
    pub(super) fn solve(
        &mut self,
        problem: &mut StepProblem,
        elements: &mut [Element],
        speeds: &mut Vector,
    ) -> Effort {
        let n = problem.n;
        self.normalize(problem, elements);
        for i in 0..n {
            speeds[i] /= self.scale[i];
        }
        let mut effort = Effort::default();
        let (mut worst_before, mut largest) = (f64::INFINITY, false);
        let momentum = norm(&problem.momentum[..n]);
        for _ in 0..MAX_ROUNDS {
            effort.rounds += 1;
            let (newton, minimized) = self.minimize(problem, speeds);
            effort.newton += newton;
            // The distance of each velocity from the one that its law allows at this impulse.
            let (mut worst, mut pace) = (0.0f64, momentum);
            for (k, (element, now)) in self.scaled.iter_mut().zip(&self.responses).enumerate() {
                let change = [0, 1, 2].map(|c| now.impulse[c] - element.impulse[c]);
                let stiffness = self.penalty[k] * self.size[k];
                if !matches!(element.law, Law::Elastic { .. }) {
                    worst = worst.max(norm(&change) / stiffness);
                }
                pace += self.size[k] * norm(&now.impulse);
                element.impulse = now.impulse;
            }
            let stalled = largest && worst > 0.5 * worst_before;
            if minimized && worst <= if stalled { STALLED } else { STICKING } * pace {
                effort.converged = true;
                break;
            }
            if worst > 0.1 * worst_before {
                largest = true;
                for (penalty, size) in self.penalty.iter_mut().zip(&self.size) {
                    let most = MAX_PENALTY / (size * size);
                    largest &= *penalty >= most;
                    *penalty = (*penalty * 10.0).min(most);
                }
            }
            worst_before = worst;
        }
        for (element, scaled) in elements.iter_mut().zip(&self.scaled) {
            element.impulse = scaled.impulse;
        }
        for i in 0..n {
            speeds[i] *= self.scale[i];
        }
        effort
    }

    /// Scales the problem so that the mass matrix has a unit diagonal.
    fn normalize(&mut self, problem: &mut StepProblem, elements: &[Element]) {
        let n = problem.n;
        for i in 0..n {
            self.scale[i] = 1.0 / libm::sqrt(problem.mass[i][i]);
        }
        for i in 0..n {
            problem.momentum[i] *= self.scale[i];
            for j in 0..=i {
                problem.mass[i][j] *= self.scale[i] * self.scale[j];
            }
        }
        self.scaled.clear();
        self.penalty.clear();
        self.size.clear();
        for element in elements {
            let mut scaled = *element;
            let mut size2: f64 = 0.0;
            for row in &mut scaled.rows[..element.dimension] {
                *row = row.scaled(&self.scale);
                size2 = size2.max(row.terms().map(|(_, by)| by * by).sum());
            }
            self.scaled.push(scaled);
            self.penalty.push(PENALTY / size2);
            self.size.push(libm::sqrt(size2));
        }
    }

    /// Computes the impulses of all laws at `speeds`, and the gradient of the function that is
    /// minimised. Returns the size of the gradient that rounding errors alone can cause.
    fn look(&mut self, problem: &StepProblem, speeds: &Vector, gradient: &mut Vector) -> f64 {
        let n = problem.n;
        let pace = norm(&speeds[..n]);
        let mut terms = norm(&problem.momentum[..n]) + if problem.springs { pace } else { 0.0 };
        *gradient = multiplied(problem, speeds);
        for i in 0..n {
            gradient[i] -= problem.momentum[i];
        }
        self.responses.clear();
        for k in 0..self.scaled.len() {
            let element = &self.scaled[k];
            let mut u = [0.0; MAX_DIMENSION];
            for c in 0..element.dimension {
                u[c] = element.rows[c].dot(speeds);
            }
            let response = element.response(&u, &element.impulse, self.penalty[k]);
            self.push(k, &response.impulse, gradient);
            terms += self.size[k] * (norm(&response.impulse) + response.along * self.size[k] * pace);
            self.responses.push(response);
        }
        2.0 * f64::EPSILON * terms
    }

    #[inline]
    fn push(&self, k: usize, impulse: &[f64; MAX_DIMENSION], on: &mut Vector) {
        let element = &self.scaled[k];
        for c in 0..element.dimension {
            for (at, by) in element.rows[c].terms() {
                on[at] += by * impulse[c];
            }
        }
    }

    /// Runs Newton's method on the function that is minimised, while the multipliers stay fixed.
    /// Writes the minimum to `speeds` and the laws' impulses there to `responses`. Returns the
    /// number of Newton steps, and whether the gradient is zero apart from rounding.
    fn minimize(&mut self, problem: &StepProblem, speeds: &mut Vector) -> (u32, bool) {
        let n = problem.n;
        let mut gradient = [0.0; MAX_SPEEDS];
        let mut floor = self.look(problem, speeds, &mut gradient);
        let mut steps = 0;
        while steps < MAX_NEWTON && norm(&gradient[..n]) > floor {
            let mut step = gradient.map(|g| -g);
            self.factorize(problem);
            self.back_substitute(n, &mut step);
            let before = norm(&gradient[..n]);
            floor = self.walk(problem, speeds, &step, &mut gradient);
            steps += 1;
            let left = norm(&gradient[..n]);
            if left >= 0.5 * before && left <= NEAR * floor {
                // The estimate of the rounding error can be too small for sums of many terms. If a
                // step brings no progress near it, only rounding is left.
                break;
            }
        }
        (steps, norm(&gradient[..n]) <= NEAR * floor)
    }

    /// Moves `speeds` along the Newton step `step` by a line search on the slope. Returns the
    /// rounding error of the gradient.
    ///
    /// It takes the whole step unless the function rises at its end. Otherwise it bisects to a
    /// point at which the function does not rise and is at most half as steep as at the start. Up
    /// to such a point the function only falls. Beyond such a point it could be larger than at the
    /// start, and the steps could repeat in a cycle.
    fn walk(
        &mut self,
        problem: &StepProblem,
        speeds: &mut Vector,
        step: &Vector,
        gradient: &mut Vector,
    ) -> f64 {
        let n = problem.n;
        let start = *speeds;
        let slope = dot(gradient, step, n).abs();
        let (mut low, mut high, mut t) = (0.0, 1.0, 1.0);
        let mut floor = 0.0;
        for _ in 0..MAX_HALVINGS {
            for i in 0..n {
                speeds[i] = start[i] + t * step[i];
            }
            floor = self.look(problem, speeds, gradient);
            let here = dot(gradient, step, n);
            if here <= LEVEL * slope && (t == 1.0 || here >= -0.5 * slope) {
                break;
            }
            if here > 0.0 {
                high = t;
            } else {
                low = t;
            }
            t = 0.5 * (low + high);
        }
        floor
    }

    /// Computes the Cholesky factor of the Newton matrix for the present responses of all laws.
    fn factorize(&mut self, problem: &StepProblem) {
        let n = problem.n;
        for i in 0..n {
            self.factor[i][..=i].copy_from_slice(&problem.mass[i][..=i]);
        }
        for k in 0..self.scaled.len() {
            let Response { along, across, direction, .. } = self.responses[k];
            let element = &self.scaled[k];
            if along == 0.0 {
                continue;
            }
            let factor = &mut self.factor;
            let mut add = |row: &Row, other: &Row, weight: f64| {
                for (i, a) in row.terms() {
                    for (j, b) in other.terms() {
                        if j <= i {
                            factor[i][j] += weight * a * b;
                        }
                    }
                }
            };
            for c in 0..element.dimension {
                add(&element.rows[c], &element.rows[c], along);
                if across == 0.0 {
                    continue;
                }
                for d in 0..element.dimension {
                    add(&element.rows[c], &element.rows[d], across * direction[c] * direction[d]);
                }
            }
        }
        for i in 0..n {
            for j in 0..=i {
                let mut sum = self.factor[i][j];
                for k in 0..j {
                    sum -= self.factor[i][k] * self.factor[j][k];
                }
                self.factor[i][j] = if i == j {
                    // Rounding can leave less than this of the unit diagonal, or a negative number.
                    libm::sqrt(sum.max(f64::EPSILON))
                } else {
                    sum / self.factor[j][j]
                };
            }
        }
    }

    fn back_substitute(&self, n: usize, b: &mut Vector) {
        for i in 0..n {
            for k in 0..i {
                b[i] -= self.factor[i][k] * b[k];
            }
            b[i] /= self.factor[i][i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                b[i] -= self.factor[k][i] * b[k];
            }
            b[i] /= self.factor[i][i];
        }
    }
}

/// Returns the mass matrix times `x`.
fn multiplied(problem: &StepProblem, x: &Vector) -> Vector {
    let mut y = [0.0; MAX_SPEEDS];
    for i in 0..problem.n {
        for j in 0..i {
            y[i] += problem.mass[i][j] * x[j];
            y[j] += problem.mass[i][j] * x[i];
        }
        y[i] += problem.mass[i][i] * x[i];
    }
    y
}

fn dot(a: &Vector, b: &Vector, n: usize) -> f64 {
    a[..n].iter().zip(&b[..n]).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    libm::sqrt(a.iter().map(|a| a * a).sum())
}

#[cfg(test)]
mod tests;
