//! Orientation from readings of the joints.

use std::hint::black_box;

use super::hbot::odometry::{advance, turn};
use super::hbot::rig::OdometryMethod::{self, Euler, Magnus4, Midpoint};
use super::hbot::{Device, Quat, Real, rotation};
use super::{real, wide4};
use crate::motion::{JOINTS, WHEELS};
use crate::timing::Timed;

/// The methods, as ids have them, by rising order.
pub(crate) const METHODS: [(&str, OdometryMethod); 3] =
    [("euler", Euler), ("midpoint", Midpoint), ("magnus4", Magnus4)];
/// Their orders on a path that is known.
pub(crate) const ORDERS: [u32; 3] = [1, 2, 4];

/// The ways that the joints may be taken to have gone between two readings, as ids have them.
pub(crate) const PATHS: [&str; 1] = ["straight"];
/// The orders of what they miss.
pub(crate) const PATH_ORDERS: [u32; 1] = [2];
/// Readings that a path needs before the first that it is followed from.
pub(crate) const LEAD: usize = 3;

/// Which method on which path, by their places in [`METHODS`] and [`PATHS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Choice {
    pub(crate) method: usize,
    pub(crate) path: usize,
}

/// The orientation at each of `readings` (angles of the joints, rad) from the [`LEAD`]th on, where it is the identity.
pub(crate) fn track(device: &Device, choice: Choice, readings: &[[f64; JOINTS]]) -> Vec<[f64; 4]> {
    let method = METHODS[choice.method].1;
    let mut q = Quat::IDENTITY;
    let mut all = vec![wide4(q)];
    for pair in readings[LEAD..].windows(2) {
        let (th, delta) = step(&pair[0], &pair[1]);
        q = advance(q, turn(device, method, &th, &delta));
        all.push(wide4(q));
    }
    all
}

/// Steering angles at a reading and the joints' turns to the next, as a controller has them: angles within a turn from integer
/// counts, so that they round like numbers of their own size.
fn step(from: &[f64; JOINTS], to: &[f64; JOINTS]) -> ([Real; WHEELS], [Real; JOINTS]) {
    let th = core::array::from_fn(|i| real(hbot_core::rotation::wrap_angle(from[2 * i])));
    (th, core::array::from_fn(|j| real(to[j] - from[j])))
}

/// The orientation after joints have turned at the constant rates `zd` (rad/s) from the steering angles `th` for `ticks` ticks
/// of `h` seconds.
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

/// The deviation of |q| from 1 that `ticks` ticks of brisk turning back and forth leave at most.
pub(crate) fn unit_norm_after(
    device: &Device,
    method: usize,
    ticks: u64,
    go_on: impl Fn() -> bool,
) -> Option<f64> {
    // A table of turns, so that what is run is the odometry alone.
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
        if tick.is_multiple_of(1 << 20) && !go_on() {
            return None;
        }
    }
    // |q| = 1 + d has |q|² = 1 + 2 d.
    Some(0.5 * super::wide(worst))
}

/// One step of odometry, timed.
pub(crate) fn timed(device: Device, choice: Choice) -> Timed<'static> {
    let method = METHODS[choice.method].1;
    let th: [Real; WHEELS] = [0.3, -0.5];
    let delta: [Real; JOINTS] = [0.01, 0.02, -0.01, 0.015];
    let mut q = Quat::IDENTITY;
    Timed::new(move || {
        q = advance(q, turn(&device, method, black_box(&th), black_box(&delta)));
        q
    })
}
