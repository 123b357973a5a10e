//! Checks of allocation: joint torques within limits, and the largest torques along the axes.

use super::super::core::allocation::{JointLimits, allocate, capability};
use super::super::core::{Real, Vec3};
use super::{EPS, GOLDEN, device, norm, posture, real, row_condition, vector, wide, worst};
use crate::golden_support::sensitivity::{self, TORQUES};
use crate::golden_support::{Ledger, double, vectors};

/// Relative accuracy of the vectors' joint torques and costs for more than two wheels
/// (tests/golden/README.md). They come from a search among torques within the limits, which ends at
/// a part of those limits.
const SEARCHED: f64 = 1e-6;

pub fn allocation(case: &vectors::Allocation, ledger: &mut Ledger) {
    let (device, exact) = match (device(&case.device), double::checks::device(&case.device)) {
        (Ok(device), Ok(exact)) => (device, exact),
        (Err(error), _) => return ledger.fail("device", error.to_string()),
        (_, Err(error)) => return ledger.fail("device", error.to_string()),
    };
    let joints = device.joints();
    if [&case.limits, &case.weights, &case.joint_torques].iter().any(|list| list.len() != joints) {
        return ledger
            .fail("limits", format!("not one limit, weight and torque for each of {joints} joints"));
    }
    let posture = posture(&device, &case.theta);
    let (rows, torque) = (posture.rows(), vector(case.torque));
    let mut limits = JointLimits::NONE;
    for j in 0..joints {
        limits.peak[j] = real(case.limits[j]);
        limits.weight[j] = real(case.weights[j]);
    }
    let got = allocate(rows, &limits, torque);
    let tau: Vec<f64> = got.torque[..joints].iter().copied().map(wide).collect();

    // The change of the exact answer if all inputs change by sixteen roundings, and the rows by
    // their own condition.
    let (sensitivity, moment) = {
        let posture = double::checks::posture(&exact, &case.theta);
        let mut limits = hbot_core::allocation::JointLimits::NONE;
        limits.peak[..joints].copy_from_slice(&case.limits);
        limits.weight[..joints].copy_from_slice(&case.weights);
        let torque = case.torque.into();
        (
            sensitivity::sensitivity(posture.rows(), &limits, torque),
            sensitivity::moment_condition(posture.rows(), &limits),
        )
    };
    let rounding = 16.0 * EPS * worst(&case.device, &case.theta, row_condition);

    // Least-cost torques are computed from the moments sum g gᵀ / w, whose condition is the square
    // of the rows'. Rounding of that size enters the torques, and the joint limits propagate it
    // like an error of the inputs.
    let moments = 16.0 * EPS * moment;

    let exactly = |k: usize, size: f64| GOLDEN * size + rounding * (sensitivity[k] + size);
    ledger.number("scale", &[], wide(got.scale), case.scale, exactly(0, case.scale));
    for (k, axis) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
        let want = case.capability[k];
        let along = wide(capability(rows, &limits, axis));
        ledger.number("capability", &[k], along, want, exactly(2 + k, want));
    }
    let searching = if case.device.wheels.len() > 2 { SEARCHED } else { GOLDEN };
    let at_least_cost = |k: usize, size: f64| (rounding + moments) * (sensitivity[k] + size);
    let cost = 0.5 * tau.iter().zip(&case.weights).map(|(t, w)| w * t * t).sum::<f64>();
    ledger.number("cost", &[], cost, case.cost, searching * case.cost + at_least_cost(1, case.cost));
    let size = norm(&case.joint_torques);
    let good = searching * if searching > GOLDEN { norm(&case.limits) } else { size };
    for (j, want) in case.joint_torques.iter().enumerate() {
        ledger.number("joint_torques", &[j], tau[j], *want, good + at_least_cost(TORQUES + j, size));
    }

    // These hold for any vectors: torques are inside the limits to the last bit, and Gᵀ tau = s T
    // to rounding.
    for j in 0..joints {
        let over = wide((got.torque[j].abs() - limits.peak[j]).max(0.0));
        ledger.number("joint torque over its limit", &[j], over, 0.0, 0.0);
    }
    let made = posture.torque_on_sphere(&got.torque[..joints]);
    let terms: Real = rows.iter().zip(&got.torque).map(|(row, tau)| row.length() * tau.abs()).sum();
    let off = wide((made - torque * got.scale).length());
    ledger.number("torque less scale x torque", &[], off, 0.0, (16.0 * EPS + moments) * wide(terms));
}
