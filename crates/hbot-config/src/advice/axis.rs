//! The transfer functions of one axis of the sampled loop: from the torque that a tick commands to
//! what a later reading shows.

use super::complex::Complex;
use super::sampled::{Hold, Sampled};

/// Largest number of states of an axis: angle, rate, torque, and the errors of the encoders' filter
/// in angle and rate.
const STATES: usize = 5;

/// A matrix of an axis. An axis with fewer states uses its first rows and columns.
type Square = [[f64; STATES + 1]; STATES + 1];

/// Transfer functions of one axis, from the torque that a tick commands to the angle and the
/// filtered rate at readings: two numerators and the denominator, polynomials of z in falling
/// order.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    angle: Vec<f64>,
    rate: Vec<f64>,
    denominator: Vec<f64>,
}

impl Axis {
    /// Creates the transfer functions of an axis with the inertia `inertia` (kg m²) in `hold`.
    pub(super) fn new(sampled: &Sampled, inertia: f64, hold: &Hold) -> Self {
        let (h, j) = (sampled.period, inertia + hold.inertia);
        // The state is angle, rate, torque and the filter's two. The input, behind the last state,
        // is the commanded torque, which is constant over a tick. A lag far below the period is
        // none.
        let lag = sampled.lag.max(1.0e-3 * h);
        let is_filtered = sampled.rate_lag > 1.0e-3 * h;
        let n = if is_filtered { STATES } else { 3 };
        let mut slope: Square = [[0.0; STATES + 1]; STATES + 1];
        let acceleration = [-hold.stiffness / j * h, -hold.damping / j * h, h / j];
        slope[0][1] = h;
        slope[1][..3].copy_from_slice(&acceleration);
        (slope[2][2], slope[2][n]) = (-h / lag, h / lag);
        if is_filtered {
            // The filter's angle X and rate V follow x: X' = V + 2 w (x - X), V' = w² (x - X). So
            // the errors e = x - X and d = x' - V have e' = d - 2 w e and d' = x'' - w² e.
            let w = 2.0 / sampled.rate_lag;
            (slope[3][3], slope[3][4]) = (-2.0 * w * h, h);
            slope[4][..3].copy_from_slice(&acceleration);
            slope[4][3] = -w * w * h;
        }
        let step = exponential(&slope, n + 1);
        let input: Vec<f64> = (0..n).map(|i| step[i][n]).collect();
        // Faddeev and LeVerrier: the adjugate of z - step and its determinant, power by power.
        let (mut angle, mut rate, mut denominator) = (Vec::new(), Vec::new(), vec![1.0]);
        let mut adjugate = identity(n);
        for k in 1..=n {
            let times = |row: usize| adjugate[row][..n].iter().zip(&input).map(|(a, b)| a * b).sum::<f64>();
            let error = |row| if is_filtered { times(row) } else { 0.0 };
            angle.push(times(0) - error(3));
            rate.push(times(1) - error(4));
            let next = product(&step, &adjugate, n);
            let trace: f64 = (0..n).map(|i| next[i][i]).sum();
            let c = -trace / k as f64;
            denominator.push(c);
            adjugate = next;
            (0..n).for_each(|i| adjugate[i][i] += c);
        }
        Self { angle, rate, denominator }
    }

    /// Returns the transfer functions from the torque that a tick computes to the angle and the
    /// rate that a later tick gets, at `z`.
    pub(super) fn responses(&self, sampled: &Sampled, z: Complex) -> [Complex; 2] {
        let back = z.inverse();
        let delay = (0..sampled.delay).fold(Complex::real(1.0), |product, _| product * back);
        let over = polynomial(&self.denominator, z).inverse() * delay;
        let angle = polynomial(&self.angle, z) * over;
        let rate = if sampled.taps.is_empty() {
            polynomial(&self.rate, z) * over
        } else {
            angle * sampled.taps.iter().rev().fold(Complex::real(0.0), |sum, tap| sum * back + *tap)
        };
        [angle, rate]
    }
}

fn polynomial(coefficients: &[f64], z: Complex) -> Complex {
    coefficients.iter().fold(Complex::real(0.0), |sum, c| sum * z + *c)
}

fn identity(n: usize) -> Square {
    let mut m = [[0.0; STATES + 1]; STATES + 1];
    (0..n).for_each(|i| m[i][i] = 1.0);
    m
}

/// Returns the product of the first `n` rows and columns of two matrices.
fn product(a: &Square, b: &Square, n: usize) -> Square {
    let mut m = [[0.0; STATES + 1]; STATES + 1];
    for (i, row) in m.iter_mut().enumerate().take(n) {
        for (k, entry) in row.iter_mut().enumerate().take(n) {
            *entry = (0..n).map(|l| a[i][l] * b[l][k]).sum();
        }
    }
    m
}

/// Returns the exponential of the first `n` rows and columns of a matrix, by its series after
/// halvings.
fn exponential(m: &Square, n: usize) -> Square {
    let size = m.iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let halvings = (size / 0.25).log2().ceil().max(0.0) as i32;
    let small = m.map(|row| row.map(|x| x * 0.5_f64.powi(halvings)));
    let mut sum = identity(n);
    let mut term = sum;
    // 0.25^14/14! is below rounding.
    for k in 1..=14 {
        term = product(&term, &small, n).map(|row| row.map(|x| x / f64::from(k)));
        for (row, more) in sum.iter_mut().zip(term) {
            row.iter_mut().zip(more).for_each(|(x, y)| *x += y);
        }
    }
    (0..halvings).fold(sum, |m, _| product(&m, &m, n))
}
