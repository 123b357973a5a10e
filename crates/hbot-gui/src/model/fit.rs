//! Fits stiffness and damping to samples of torque and deflection, as in the paper's figure 8.

use glam::{DMat3, DQuat, DVec3};
use hbot_api::{Mode, StateEvent};

use super::sample::{deflection, zero};

/// Smallest number of samples from which stiffness and damping are fitted.
const LEAST_SAMPLES: usize = 20;
/// Smallest standard deviation of the deflection from which stiffness and damping are fitted, rad.
const LEAST_SPREAD: f64 = 2e-3;
/// Largest root mean square of what a fit leaves unexplained, as a share of the torque's standard
/// deviation, with which the samples count as those of one spring. 0.1 leaves 1 % of the variance.
/// A spring whose stiffness doubled half way leaves 10 %.
const MOST_UNEXPLAINED: f64 = 0.1;

/// Stiffness and damping about one axis, fitted to samples by the law torque = offset - stiffness ×
/// deflection - damping × rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    /// Fitted stiffness, N m/rad.
    pub(crate) stiffness: f64,
    /// Fitted damping, N m s/rad.
    pub(crate) damping: f64,
    /// Fitted torque at zero deflection and zero rate, N m.
    pub(crate) offset: f64,
    /// Smallest and largest deflection among the samples, rad.
    pub(crate) range: [f64; 2],
    /// Root mean square of the torque that the law leaves unexplained, N m.
    pub(crate) residual: f64,
    /// Standard deviation of the torque, N m.
    spread: f64,
}

impl Fit {
    /// Returns whether the samples are those of one spring and damper. Otherwise the fitted values
    /// describe nothing that exists: a wall, friction, or two springs one after the other.
    pub(crate) fn is_one_spring(&self) -> bool {
        self.residual <= MOST_UNEXPLAINED * self.spread
    }
}

/// Fits stiffness and damping about each axis to samples, by least squares. Deflections are
/// measured from the orientation `chosen`, or if it is `None`, from the zero of each sample.
/// Returns `None` for an axis with too few samples or too little deflection. Ignores samples whose
/// torque was limited, and samples of a rig that is not active.
pub(crate) fn fit<'a>(
    samples: impl Iterator<Item = &'a StateEvent>,
    chosen: Option<DQuat>,
) -> [Option<Fit>; 3] {
    let mut axes = [Axis::default(); 3];
    for sample in samples.filter(|sample| sample.mode == Mode::Active && sample.scale > 0.999) {
        let zero = zero(sample, chosen);
        let deflection = deflection(sample, zero);
        let omega = zero.conjugate() * DVec3::from(sample.omega);
        let torque = zero.conjugate() * DVec3::from(sample.torque);
        for (k, axis) in axes.iter_mut().enumerate() {
            axis.add(deflection[k], omega[k], torque[k]);
        }
    }
    axes.map(|axis| axis.solve())
}

/// Sums over samples for the least-squares fit of one axis: the matrix and the right side of the
/// normal equations. The unknowns are the coefficients of deflection, of rate, and of 1.
#[derive(Clone, Copy, Default)]
struct Axis {
    count: usize,
    matrix: [DVec3; 3],
    right: DVec3,
    squares: f64,
    range: Option<[f64; 2]>,
}

impl Axis {
    fn add(&mut self, deflection: f64, rate: f64, torque: f64) {
        let row = DVec3::new(deflection, rate, 1.0);
        self.matrix = [0, 1, 2].map(|k| self.matrix[k] + row[k] * row);
        self.right += row * torque;
        self.squares += torque * torque;
        self.count += 1;
        let [low, high] = self.range.unwrap_or([deflection; 2]);
        self.range = Some([low.min(deflection), high.max(deflection)]);
    }

    fn solve(self) -> Option<Fit> {
        let n = self.count as f64;
        let variance = self.matrix[0][0] / n - (self.matrix[0][2] / n).powi(2);
        if self.count < LEAST_SAMPLES || variance < LEAST_SPREAD * LEAST_SPREAD {
            return None;
        }
        let [a, b, c] = self.matrix;
        let matrix = DMat3::from_cols(a, b, c) * (1.0 / n);
        let right = self.right / n;
        // If the rate hardly varies (a sphere that creeps) or depends on the deflection, fit the
        // stiffness alone.
        let rate_variance = self.matrix[1][1] / n - (self.matrix[1][2] / n).powi(2);
        let solution = if rate_variance > 1e-6 && matrix.determinant() > 1e-9 * variance * rate_variance {
            matrix.inverse() * right
        } else {
            let mean = self.matrix[0][2] / n;
            let slope = (right.x - mean * right.z) / variance;
            DVec3::new(slope, 0.0, right.z - slope * mean)
        };
        let range = self.range?;
        let square = self.squares / n;
        let [residual, spread] =
            [square - solution.dot(2.0 * right - matrix * solution), square - right.z * right.z]
                .map(|variance| variance.max(0.0).sqrt());
        let fit =
            Fit { stiffness: -solution.x, damping: -solution.y, offset: solution.z, range, residual, spread };
        (fit.stiffness.is_finite() && fit.damping.is_finite()).then_some(fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(k: usize, zero: DQuat, stiffness: DVec3, damping: f64) -> StateEvent {
        let t = k as f64 * 1e-2;
        let deflection = DVec3::new(0.02 * t.sin(), 0.01 * (1.7 * t).cos(), 0.0);
        let rate = DVec3::new(0.02 * t.cos(), -0.017 * (1.7 * t).sin(), 0.0);
        let torque = (zero * (-stiffness * deflection - damping * rate)).to_array();
        let q = zero * DQuat::from_scaled_axis(deflection);
        let (q, omega) = ([q.w, q.x, q.y, q.z], (zero * rate).to_array());
        StateEvent { mode: Mode::Active, q, omega, torque, ..StateEvent::default() }
    }

    #[test]
    fn stiffness_and_damping_are_found_again() {
        let zero = DQuat::from_rotation_y(0.7);
        let samples: Vec<_> = (0..1000).map(|k| moving(k, zero, DVec3::new(4.0, 2.0, 1.0), 0.05)).collect();
        let [a, b, c] = fit(samples.iter(), Some(zero));
        let (a, b) = (a.expect("moved"), b.expect("moved"));
        // The points lie on a line, so the only error is rounding, magnified by the condition
        // number of the sums.
        assert!((a.stiffness - 4.0).abs() < 1e-9 && (a.damping - 0.05).abs() < 1e-9, "{a:?}");
        assert!((b.stiffness - 2.0).abs() < 1e-9 && b.offset.abs() < 1e-9, "{b:?}");
        assert_eq!(c, None, "an axis that did not move says nothing");
    }

    #[test]
    fn two_springs_one_after_the_other_are_not_told_as_one() {
        let stiff = |k: usize| if k < 500 { 2.0 } else { 4.0 };
        let samples: Vec<_> =
            (0..1000).map(|k| moving(k, DQuat::IDENTITY, DVec3::splat(stiff(k)), 0.05)).collect();
        let [both, ..] = fit(samples.iter(), None);
        let both = both.expect("moved");
        assert!(!both.is_one_spring(), "{both:?}");
        for (part, stiffness) in [(&samples[..500], 2.0), (&samples[500..], 4.0)] {
            let fit = fit(part.iter(), None)[0].expect("moved");
            assert!(fit.is_one_spring() && (fit.stiffness - stiffness).abs() < 1e-9, "{fit:?}");
        }
    }

    #[test]
    fn what_a_limit_has_cut_is_left_out() {
        let mut samples: Vec<_> =
            (0..1000).map(|k| moving(k, DQuat::IDENTITY, DVec3::splat(1.0), 0.0)).collect();
        for sample in samples.iter_mut().step_by(2) {
            sample.torque = sample.torque.map(|part| 0.5 * part);
            sample.scale = 0.5;
        }
        let [a, ..] = fit(samples.iter(), None);
        assert!((a.expect("moved").stiffness - 1.0).abs() < 1e-9);
    }
}
