//! Sensitivity of the exact allocation to its inputs.
//!
//! The solution is unique and depends piecewise smoothly on rows, torque, limits and weights. The
//! slope depends on which joints are at their limits. It is measured, not estimated: each input is
//! changed in turn and the changes of the solution are added up.

use hbot_core::Vec3;
use hbot_core::allocation::{JointLimits, allocate, capability};
use hbot_core::design::singularity::singular_values;

/// All results: scale, cost, the capabilities along n1, n2 and n3, then the joint torques.
pub type Answer = Vec<f64>;

/// Index of the first joint torque in an [`Answer`].
pub const TORQUES: usize = 5;

/// Relative change of each input. It is far above rounding, and mostly far below the changes at
/// which other joints saturate. If it is not, the steeper side counts.
const STEP: f64 = 1e-6;

pub fn answer(rows: &[Vec3], limits: &JointLimits, torque: Vec3) -> Answer {
    let allocation = allocate(rows, limits, torque);
    let tau = &allocation.torque[..rows.len()];
    let cost = 0.5 * tau.iter().zip(&limits.weight).map(|(t, w)| w * t * t).sum::<f64>();
    let mut answer = vec![allocation.scale, cost];
    answer.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|axis| capability(rows, limits, axis)));
    answer.extend(tau);
    answer
}

/// Returns for each result its largest change if all inputs change at once, divided by the relative
/// change of the inputs.
pub fn sensitivity(rows: &[Vec3], limits: &JointLimits, torque: Vec3) -> Answer {
    let start = answer(rows, limits, torque);
    let mut sum = vec![0.0; start.len()];
    let mut add = |moved: [Answer; 2]| {
        for (k, sum) in sum.iter_mut().enumerate() {
            *sum += (moved[0][k] - start[k]).abs().max((moved[1][k] - start[k]).abs()) / STEP;
        }
    };
    for axis in 0..3 {
        for j in 0..rows.len() {
            add([STEP, -STEP].map(|step| {
                let mut rows = rows.to_vec();
                rows[j][axis] += step * rows[j].length();
                answer(&rows, limits, torque)
            }));
        }
        add([STEP, -STEP].map(|step| {
            let mut torque = torque;
            torque[axis] += step * torque.length();
            answer(rows, limits, torque)
        }));
    }
    for j in 0..rows.len() {
        add([STEP, -STEP].map(|step| {
            let mut limits = *limits;
            limits.peak[j] *= 1.0 + step;
            answer(rows, &limits, torque)
        }));
        add([STEP, -STEP].map(|step| {
            let mut limits = *limits;
            limits.weight[j] *= 1.0 + step;
            answer(rows, &limits, torque)
        }));
    }
    sum
}

/// Returns the condition of the moments sum g gᵀ / w, from which least-cost torques are computed.
/// It is the square of the rows' condition.
pub fn moment_condition(rows: &[Vec3], limits: &JointLimits) -> f64 {
    let scaled: Vec<Vec3> =
        rows.iter().zip(limits.weight).map(|(row, weight)| *row / weight.sqrt()).collect();
    let [largest, _, least] = singular_values(&scaled);
    (largest / least).powi(2)
}
