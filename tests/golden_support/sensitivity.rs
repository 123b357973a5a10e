//! How far the exact allocation moves when what goes into it does.
//!
//! The answer is unique and goes piecewise smoothly with rows, torque, limits and weights, but how steeply depends on
//! which joints are at their limits. Nothing is guessed: each input is moved in turn and the changes are added up.

use hbot_core::Vec3;
use hbot_core::allocation::{JointLimits, allocate, capability};
use hbot_core::singularity::singular_values;

/// All that comes out: scale, cost, capability along n1, n2, n3, then the joint torques.
pub type Answer = Vec<f64>;

/// Where in an [`Answer`] the torques begin.
pub const TORQUES: usize = 5;

/// The part of itself by which each input is moved: far above rounding, far below what separates one set of
/// saturated joints from the next, mostly; where not, the steeper side counts.
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

/// For each figure of the answer the most that it moves, over the relative change of all inputs at once.
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

/// The condition of the moments sum g gᵀ / w, from which least-cost torques are found: the square of the rows'.
pub fn moment_condition(rows: &[Vec3], limits: &JointLimits) -> f64 {
    let scaled: Vec<Vec3> =
        rows.iter().zip(limits.weight).map(|(row, weight)| *row / weight.sqrt()).collect();
    let [largest, _, least] = singular_values(&scaled);
    (largest / least).powi(2)
}
