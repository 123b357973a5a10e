//! Fits zeros, radii and cones together by damped least squares (Levenberg and Marquardt). Radii
//! and cones are tied to the values of the rig file, as loosely as a caliper measures them.

use super::{Fit, Guess, PARAMETERS};

/// Assumed standard deviation of a wheel's slip between two readings, as a fraction of the root
/// mean square rolling distance.
const STEP: f64 = 0.01;
/// Assumed standard deviation of the wheel radii in the rig file, as a fraction of the radius.
const RADIUS: f64 = 0.05;
/// Assumed standard deviation of the cone angles in the rig file, rad.
const CONE: f64 = 0.05;

impl Fit<'_> {
    /// Returns the residuals of a guess, each divided by its standard deviation: the slips of the
    /// wheels, and the differences of radii and cone angles from the rig file. Returns `None` if
    /// the guess is not a valid geometry.
    fn residuals(&self, guess: &Guess) -> Option<Vec<f64>> {
        let n = self.rig.device.wheels().len();
        let device = self.device(guess, n)?;
        let mut all = Vec::new();
        self.slips(guess, &device, 1, &mut all);
        all.iter_mut().for_each(|slip| *slip /= STEP);
        for (i, [_, scale, cone]) in guess.wheels[..n].iter().enumerate() {
            all.push(scale / RADIUS);
            all.push((cone - self.rig.device.wheels()[i].spec().cone) / CONE);
        }
        Some(all)
    }

    /// Improves the steering zeros, wheel radii and cone angles of `guess` by least squares.
    /// Returns the standard deviation of each zero, rad.
    pub(super) fn refine(&self, guess: &mut Guess) -> Vec<f64> {
        const H: f64 = 1.0e-5;
        let n = self.rig.device.wheels().len();
        let size = PARAMETERS * n;
        let (mut damping, mut deviations) = (1.0e-3, vec![f64::INFINITY; n]);
        let square = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>();
        for _ in 0..60 {
            let Some(here) = self.residuals(guess) else { return deviations };
            let mut columns = Vec::with_capacity(size);
            for k in 0..size {
                let (mut up, mut down) = (*guess, *guess);
                up.wheels[k / PARAMETERS][k % PARAMETERS] += H;
                down.wheels[k / PARAMETERS][k % PARAMETERS] -= H;
                let (Some(up), Some(down)) = (self.residuals(&up), self.residuals(&down)) else {
                    return deviations;
                };
                columns.push(up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * H)).collect::<Vec<_>>());
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let normal: Vec<Vec<f64>> =
                columns.iter().map(|a| columns.iter().map(|b| dot(a, b)).collect()).collect();
            let slope: Vec<f64> = columns.iter().map(|a| -dot(a, &here)).collect();
            for (i, deviation) in deviations.iter_mut().enumerate() {
                let mut unit = vec![0.0; size];
                unit[PARAMETERS * i] = 1.0;
                *deviation =
                    solve(&normal, &unit, 0.0).map_or(f64::INFINITY, |x| x[PARAMETERS * i].max(0.0).sqrt());
            }
            let Some(step) = solve(&normal, &slope, damping) else { return deviations };
            let mut next = *guess;
            for (k, step) in step.iter().enumerate() {
                next.wheels[k / PARAMETERS][k % PARAMETERS] += step;
            }
            match self.residuals(&next) {
                Some(there) if square(&there) <= square(&here) => {
                    *guess = next;
                    damping = (damping * 0.2).max(1.0e-12);
                    if step.iter().all(|x| x.abs() < 1.0e-9) {
                        return deviations;
                    }
                }
                _ if damping > 1.0e9 => return deviations,
                _ => damping *= 5.0,
            }
        }
        deviations
    }
}

/// Solves the symmetric linear system `matrix` x = `right` by elimination, after increasing each
/// diagonal element by the fraction `damping`. Returns `None` if the matrix is not positive
/// definite.
fn solve(matrix: &[Vec<f64>], right: &[f64], damping: f64) -> Option<Vec<f64>> {
    let n = right.len();
    let mut rows: Vec<Vec<f64>> = matrix
        .iter()
        .enumerate()
        .map(|(i, row)| {
            let mut row = row.clone();
            row[i] *= 1.0 + damping;
            row.push(right[i]);
            row
        })
        .collect();
    for k in 0..n {
        // In a positive definite matrix every diagonal element is a good pivot. A pivot that is not
        // positive shows that the matrix is not.
        if !(rows[k][k] > 1.0e-12 * matrix[k][k].max(f64::MIN_POSITIVE)) {
            return None;
        }
        for i in k + 1..n {
            let factor = rows[i][k] / rows[k][k];
            for j in k..=n {
                rows[i][j] -= factor * rows[k][j];
            }
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (rows[k][n] - known) / rows[k][k];
    }
    Some(x)
}
