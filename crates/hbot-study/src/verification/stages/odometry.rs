//! Odometry: the orientation of the sphere from readings of the joints.

use std::hint::black_box;

use hbot_sim::motion::{JOINTS, LEAD, WHEELS};

use super::hbot::design::kinematics::{Posture, forward};
use super::hbot::design::rig::OdometryMethod::{self, Euler, Magnus4, Midpoint};
use super::hbot::design::rig::PathFit::{self, Cubic, Quadratic, Straight};
use super::hbot::motion::odometry::{advance, turn, turn_along};
use super::hbot::motion::path::Trail;
use super::hbot::{Device, MAX_JOINTS, Quat, Real, Vec3, rotation};
use super::{real, vector, wide4};
use crate::timing::Timed;

/// The odometry methods by increasing order of accuracy, each with its name in the ids of figures
/// and in rig files.
pub(crate) const METHODS: [(&str, OdometryMethod); 3] =
    [(Euler.name(), Euler), (Midpoint.name(), Midpoint), (Magnus4.name(), Magnus4)];
/// Order of accuracy of each method in [`METHODS`], if the joints really move along the path that
/// is assumed between readings.
pub(crate) const ORDERS: [u32; 3] = [1, 2, 4];

/// The paths that the joints are assumed to take between two readings, each with its name in the
/// ids of figures and in rig files.
pub(crate) const PATHS: [(&str, PathFit); 3] =
    [(Straight.name(), Straight), (Quadratic.name(), Quadratic), (Cubic.name(), Cubic)];
/// Order of accuracy that each assumed path in [`PATHS`] allows.
pub(crate) const PATH_ORDERS: [u32; 3] = [2, 3, 4];

/// An odometry method and an assumed path of the joints, as indices into [`METHODS`] and [`PATHS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Choice {
    pub(crate) method: usize,
    pub(crate) path: usize,
}

/// Returns the turn of the sphere between two readings, as a rotation vector in frame N, rad. Calls
/// the functions that the controller calls for this odometry method and path.
#[inline]
fn step_turn(
    device: &Device,
    choice: Choice,
    trail: &mut Trail,
    th: &[Real],
    delta: &[Real; MAX_JOINTS],
) -> Vec3 {
    match (METHODS[choice.method].1, PATHS[choice.path].1) {
        // Euler's method does not depend on the path.
        (Euler, _) => turn(device, Euler, th, delta),
        (method, Straight) => turn(device, method, th, delta),
        (method, fit) => turn_along(device, method, th, &trail.step(fit, delta, 1.0)),
    }
}

/// Computes the orientation [w, x, y, z] at each of `readings` (joint angles, rad). The orientation
/// at reading [`LEAD`] is the identity. The result begins with this reading.
pub(crate) fn track(device: &Device, choice: Choice, readings: &[[f64; JOINTS]]) -> Vec<[f64; 4]> {
    let mut q = Quat::IDENTITY;
    let mut all = vec![wide4(q)];
    let mut trail = Trail::START;
    for (k, pair) in readings.windows(2).enumerate() {
        let (th, delta) = step(&pair[0], &pair[1]);
        let turn = step_turn(device, choice, &mut trail, &th, &delta);
        if k >= LEAD {
            q = advance(q, turn);
            all.push(wide4(q));
        }
    }
    all
}

/// Returns the steer angles at the reading `from`, and the turn of each joint from this reading to
/// the reading `to`, in rad.
///
/// Steer angles are reduced to one turn, so that they have the same rounding errors as in a
/// controller, which reduces integer encoder counts to one turn.
fn step(from: &[f64; JOINTS], to: &[f64; JOINTS]) -> ([Real; WHEELS], [Real; MAX_JOINTS]) {
    let th = core::array::from_fn(|i| real(hbot_core::rotation::wrap_angle(from[2 * i])));
    let mut delta = [0.0; MAX_JOINTS];
    for j in 0..JOINTS {
        delta[j] = real(to[j] - from[j]);
    }
    (th, delta)
}

/// Returns the orientation [w, x, y, z] that odometry computes after `ticks` ticks of `h` seconds.
/// The joints turn at the constant rates `zd` (rad/s), starting from the steer angles `th` (rad).
pub(crate) fn segment(
    device: &Device,
    method: usize,
    th: [f64; WHEELS],
    zd: &[f64; JOINTS],
    h: f64,
    ticks: u32,
) -> [f64; 4] {
    let mut q = Quat::IDENTITY;
    let delta: [Real; JOINTS] = zd.map(|rate| real(rate * h));
    for k in 0..ticks {
        let t = f64::from(k) * h;
        let th: [Real; WHEELS] =
            core::array::from_fn(|i| real(hbot_core::rotation::wrap_angle(th[i] + zd[2 * i] * t)));
        q = advance(q, turn(device, METHODS[method].1, &th, &delta));
    }
    wide4(q)
}

/// A function that returns an orientation after a turn (a rotation vector in frame N, rad).
type Turn = fn(Quat, Vec3) -> Quat;

/// The ways to combine an orientation and a turn, each with its name in the ids of figures.
pub(crate) const WAYS: [(&str, Turn); 2] =
    [("product", rotation::turned_by_product), ("change", rotation::turned_by_change)];

/// Returns the orientation [w, x, y, z] after the successive turns `turns` (rotation vectors in
/// frame N, rad), in this floating-point width. `way` is an index into [`WAYS`].
pub(crate) fn after(turns: &[[f64; 3]], way: usize) -> [f64; 4] {
    wide4(turns.iter().fold(Quat::IDENTITY, |q, turn| WAYS[way].1(q, vector(*turn))))
}

/// Returns the largest deviation of the quaternion's norm |q| from 1 during `ticks` ticks of
/// odometry on a motion back and forth.
pub(crate) fn unit_norm_after(device: &Device, method: usize, ticks: u64) -> f64 {
    // The turns come from a table, so that the loop runs the odometry alone.
    let table: Vec<([Real; WHEELS], [Real; JOINTS])> = (0..1024)
        .map(|k| {
            let phase = f64::from(k) * core::f64::consts::TAU / 1024.0;
            let th = core::array::from_fn(|i| real(3.0 * libm::sin(phase + i as f64)));
            let delta = core::array::from_fn(|j| real(0.02 * libm::cos(3.0 * phase + j as f64)));
            (th, delta)
        })
        .collect();
    let (mut q, mut worst): (Quat, Real) = (Quat::IDENTITY, 0.0);
    let mut tick = 0;
    while tick < ticks {
        for (th, delta) in &table {
            q = advance(q, turn(device, METHODS[method].1, th, delta));
        }
        worst = worst.max((rotation::to_wxyz(q).iter().map(|x| x * x).sum::<Real>() - 1.0).abs());
        tick += table.len() as u64;
    }
    // For |q| = 1 + d with small d, |q|² = 1 + 2 d.
    0.5 * super::wide(worst)
}

/// Prepares to measure the time of one odometry step. For Euler's method, the contact frames of the
/// last reading are computed in advance, because the controller already has them.
pub(crate) fn timed(device: Device, choice: Choice) -> Timed<'static> {
    let th: [Real; WHEELS] = [0.3, -0.5];
    let mut delta = [0.0; MAX_JOINTS];
    delta[..JOINTS].copy_from_slice(&[0.01, 0.02, -0.01, 0.015]);
    let posture = Posture::new(&device, &th);
    let mut trail = Trail::START;
    let mut q = Quat::IDENTITY;
    if METHODS[choice.method].1 == Euler {
        return Timed::new(move || {
            q = advance(q, forward(&device, black_box(posture.frames()), black_box(&delta)));
            q
        });
    }
    Timed::new(move || {
        q = advance(q, step_turn(&device, choice, &mut trail, black_box(&th), black_box(&delta)));
        q
    })
}
