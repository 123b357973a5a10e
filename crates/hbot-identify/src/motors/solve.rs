//! The unknowns that leave least of the equation of motion: least squares, with less weight for
//! windows that do not fit, and with what is expected as one more observation for each unknown.

use super::rows::Rows;
use crate::fit::median;
use crate::interval::ninety_five;
use crate::matrix::Square;

/// Distance, in standard deviations, from which on a window gets no weight (Tukey's biweight).
const REJECTED: f64 = 4.7;
/// Number of times that the weights are computed.
const ROUNDS: usize = 8;
/// Number of windows in a row whose errors count as related.
const BLOCK: usize = 16;

/// A solution.
pub(super) struct Solved {
    /// The unknowns.
    pub(super) found: Vec<f64>,
    /// Their covariance.
    pub(super) covariance: Vec<Vec<f64>>,
    /// Half the width of the interval of each that holds the truth in 95 % of the cases, in
    /// standard deviations.
    pub(super) quantile: Vec<f64>,
    /// What is left of the equation in each row, N m.
    pub(super) residual: Vec<f64>,
    /// The weight of each window.
    pub(super) weights: Vec<f64>,
    /// Usual size of a row of the residual, N m.
    pub(super) scale: f64,
    /// What is left, root mean square over the windows, N m.
    pub(super) left: f64,
}

impl Solved {
    /// Solves the equation. Returns `None` if the unknowns cannot be told apart.
    pub(super) fn new(rows: &Rows<'_>) -> Option<Self> {
        let count = rows.columns.len();
        let expected: Vec<f64> = rows.terms.iter().map(|term| term.expected(rows.rig)).collect();
        // Unknowns in units of their usual deviation, from what is expected on.
        let usual: Vec<f64> = rows.terms.iter().map(|term| term.usual(rows.rig)).collect();
        let windows = rows.wanted.len() / 3;
        let mut solved = Self {
            found: expected.clone(),
            covariance: Vec::new(),
            quantile: Vec::new(),
            residual: residual(rows, &expected),
            weights: vec![1.0; windows],
            scale: 0.0,
            left: 0.0,
        };
        let mut normal = Square::zero(count);
        let mut row = vec![0.0; count];
        for round in 0..ROUNDS {
            solved.scale = scale(&solved.residual);
            if round > 0 {
                solved.weigh();
            }
            normal = Square::zero(count);
            let mut slope = vec![0.0; count];
            for (r, left) in solved.residual.iter().enumerate() {
                let weight = solved.weights[r / 3] / (solved.scale * solved.scale);
                if weight == 0.0 {
                    continue;
                }
                (0..count).for_each(|k| row[k] = rows.columns[k][r] * usual[k]);
                normal.add_outer(&row, weight);
                slope.iter_mut().zip(&row).for_each(|(slope, row)| *slope += weight * row * left);
            }
            for k in 0..count {
                normal.add(k, k, 1.0);
                slope[k] += (expected[k] - solved.found[k]) / usual[k];
            }
            let change = normal.factor()?.solve(&slope);
            (0..count).for_each(|k| solved.found[k] += change[k] * usual[k]);
            solved.residual = residual(rows, &solved.found);
        }
        let inverse = normal.factor()?.inverse();
        // The jackknife: one block of windows after another is left out. What is expected counts as
        // one more observation, with the deviation 1.
        let mut covariance = inverse.product(&inverse);
        let blocks = windows.div_ceil(BLOCK) as f64;
        // Sum of the fourth powers of what each block changes.
        let mut fourth = vec![0.0; count];
        for first in (0..windows).step_by(BLOCK) {
            let mut gradient = vec![0.0; count];
            let mut without = normal.clone();
            for r in 3 * first..3 * (first + BLOCK).min(windows) {
                let weight = solved.weights[r / 3] / (solved.scale * solved.scale);
                (0..count).for_each(|k| row[k] = rows.columns[k][r] * usual[k]);
                without.add_outer(&row, -weight);
                gradient
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(sum, row)| *sum += weight * row * solved.residual[r]);
            }
            let change = without.factor()?.solve(&gradient);
            covariance.add_outer(&change, (blocks - 1.0) / blocks);
            fourth.iter_mut().zip(&change).for_each(|(sum, change)| *sum += change.powi(4));
        }
        // Satterthwaite's number of degrees of freedom: the square of a variance divided by the sum
        // of the fourth powers of what each block changes. It is small if few blocks make up most
        // of the variance, as those in which a joint turns back do for its friction. The fourth
        // powers are those of single changes, so of many equal blocks with normal errors about a
        // third counts, and intervals are a little too wide.
        solved.quantile = (0..count).map(|k| ninety_five(covariance.at(k, k).powi(2) / fourth[k])).collect();
        solved.covariance = (0..count)
            .map(|a| (0..count).map(|b| usual[a] * usual[b] * covariance.at(a, b)).collect())
            .collect();
        let all = solved.residual.iter().map(|x| x * x).sum::<f64>();
        solved.left = (all / windows.max(1) as f64).sqrt();
        Some(solved)
    }

    /// Adds to the covariance what the unknowns differ from those of `other`, a solution of the
    /// same equation with another approximation: an error that all windows have in common, which
    /// the jackknife does not see.
    pub(super) fn doubt(&mut self, other: &Self) {
        for (k, row) in self.covariance.iter_mut().enumerate() {
            row[k] += (self.found[k] - other.found[k]).powi(2);
        }
    }

    fn weigh(&mut self) {
        for (weight, left) in self.weights.iter_mut().zip(self.residual.chunks_exact(3)) {
            let far = (left.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt() / self.scale;
            *weight = if far < REJECTED { (1.0 - (far / REJECTED).powi(2)).powi(2) } else { 0.0 };
        }
    }
}

/// Returns what the unknowns `found` leave of the equation.
fn residual(rows: &Rows<'_>, found: &[f64]) -> Vec<f64> {
    let mut left = rows.wanted.clone();
    for (column, found) in rows.columns.iter().zip(found) {
        left.iter_mut().zip(column).for_each(|(left, x)| *left -= found * x);
    }
    left
}

/// Returns the usual size of a row: from the median of its sizes, as of a normal distribution.
fn scale(residual: &[f64]) -> f64 {
    if residual.is_empty() {
        return f64::MIN_POSITIVE;
    }
    let median = median(residual.iter().map(|x| x.abs()).collect());
    (median / 0.6745).max(1.0e-9)
}
