//! Checks of odometry: the orientation after segments of constant joint rates, by each method.

use super::super::core::design::rig::OdometryMethod;
use super::super::core::design::singularity::interior_margin;
use super::super::core::motion::odometry::{advance, turn};
use super::super::core::{Quat, Real, design::device::Device};
use super::{EPS, device, norm, posture, quaternion, real, reals, row_condition, wide, worst, wxyz};
use crate::golden_support::{Ledger, vectors};

/// Accuracy of the vectors, rad (tests/golden/README.md).
const GOLDEN: f64 = 1e-11;

/// Returns the sphere's orientation and the steer angles after all segments, and the number of
/// steps. In each step neither a wheel nor the sphere turns by more than `stride` rad.
fn integrate(
    case: &vectors::Odometry,
    device: &Device,
    method: OdometryMethod,
    stride: f64,
) -> (Quat, Vec<f64>, usize) {
    let mut q = quaternion(case.q0);
    let mut theta = case.theta0.clone();
    let mut taken = 0;
    for segment in &case.segments {
        let steering = segment.joint_rates.iter().step_by(2).fold(0.0, |m: f64, rate| m.max(rate.abs()));
        let forward = posture(device, &theta).forward(device, &reals(&segment.joint_rates));
        let fastest = steering.max(2.0 * wide(forward.omega.length()));
        let steps = (fastest * segment.duration / stride).ceil().max(1.0) as usize;
        let h = segment.duration / steps as f64;
        let delta: Vec<Real> = segment.joint_rates.iter().map(|rate| real(rate * h)).collect();
        for k in 0..steps {
            let th: Vec<Real> = theta
                .iter()
                .zip(segment.joint_rates.iter().step_by(2))
                .map(|(th, rate)| real(th + rate * h * k as f64))
                .collect();
            q = advance(q, turn(device, method, &th, &delta));
        }
        for (th, rate) in theta.iter_mut().zip(segment.joint_rates.iter().step_by(2)) {
            *th += rate * segment.duration;
        }
        taken += steps;
    }
    (q, theta, taken)
}

/// Returns the part of the orientation's error that is due to rounding. Each step adds a random
/// rounding of q. The whole way also has the relative error of the sphere's rate, which is that of
/// the rows times the condition of the least squares.
fn rounding(case: &vectors::Odometry, device: &Device, steps: usize) -> f64 {
    let mut theta = case.theta0.clone();
    let (mut way, mut condition, mut reach) = (1.0, 1.0_f64, norm(&theta));
    for segment in &case.segments {
        let steer = |k: usize| segment.joint_rates[2 * k];
        for part in [0.0, 0.5, 1.0] {
            let at: Vec<f64> =
                (0..theta.len()).map(|k| theta[k] + part * segment.duration * steer(k)).collect();
            let posture = posture(device, &at);
            condition = condition.max(1.0 / wide(interior_margin(&posture)).powi(2));
            let omega = posture.forward(device, &reals(&segment.joint_rates)).omega;
            way += wide(omega.length()) * segment.duration;
            reach = reach.max(norm(&at));
        }
        for k in 0..theta.len() {
            theta[k] += segment.duration * steer(k);
        }
    }
    let rows = worst(&case.device, &vec![reach; theta.len()], row_condition);
    EPS * (4.0 * (steps as f64).sqrt() + 16.0 * way * rows * condition)
}

pub fn odometry(case: &vectors::Odometry, ledger: &mut Ledger) {
    let device = match device(&case.device) {
        Ok(device) => device,
        Err(error) => return ledger.fail("device", error.to_string()),
    };
    // The error of the Magnus method is about stride^4/500 per radian: 3e-14 with steps of 2 mrad
    // and 3e-10 with steps of 20 mrad. This is far below the rounding of f64 over that many steps,
    // and below that of f32.
    let stride = if EPS < 1e-10 { 2e-3 } else { 2e-2 };
    let (q, theta, steps) = integrate(case, &device, OdometryMethod::Magnus4, stride);
    let exact = GOLDEN + rounding(case, &device, steps);
    ledger.rotation("q", &[], wxyz(q), case.q, exact);
    for (k, (got, want)) in theta.iter().zip(&case.theta).enumerate() {
        // theta is the sum of four numbers, which this test computes itself in both widths.
        ledger.number("theta", &[k], *got, *want, 1e-12 * (1.0 + want.abs()));
    }
    if theta.len() != case.theta.len() {
        ledger.fail("theta", format!("got {} angles, expected {}", theta.len(), case.theta.len()));
    }
    // The other methods are checked by their order: with half the step, a half or a quarter of the
    // error remains. Another fifth is allowed for the next order, which is a few per cent at these
    // strides.
    for (method, field, order) in
        [(OdometryMethod::Euler, "q by Euler", 1), (OdometryMethod::Midpoint, "q by midpoint", 2)]
    {
        let stride = 2e-2;
        let whole = apart(wxyz(integrate(case, &device, method, stride).0), case.q);
        let (half, _, steps) = integrate(case, &device, method, 0.5 * stride);
        let most = 1.2 * whole / f64::from(1 << order);
        let within = most + GOLDEN + 2.0 * rounding(case, &device, steps);
        ledger.rotation(field, &[], wxyz(half), case.q, within);
    }
}

/// Returns the distance between two unit quaternions, regardless of their signs.
fn apart(a: [f64; 4], b: [f64; 4]) -> f64 {
    let [minus, plus] = [-1.0, 1.0].map(|s| norm(&[0, 1, 2, 3].map(|k| a[k] + s * b[k])));
    minus.min(plus)
}
