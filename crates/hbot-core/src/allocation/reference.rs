//! A slow reference for few joints, in 64 bits: it tries every set of joints at their limits.

extern crate std;

use std::vec::Vec;

use glam::{DMat3, DVec3};

/// Rows, peaks and weights, all driven.
pub(super) struct Reference {
    pub(super) rows: Vec<DVec3>,
    pub(super) peak: Vec<f64>,
    pub(super) weight: Vec<f64>,
}

impl Reference {
    /// The largest s in [0, 1]. A vertex of the linear program has all joints but two at their limits, so three
    /// equations give those two and s.
    pub(super) fn scale(&self, wanted: DVec3) -> f64 {
        let n = self.rows.len();
        let mut best: f64 = 0.0;
        for i in 0..n {
            for j in i + 1..n {
                let system = DMat3::from_cols(self.rows[i], self.rows[j], -wanted);
                if system.determinant().abs() < 1e-12 {
                    continue;
                }
                let inverse = system.inverse();
                for signs in 0..1 << (n - 2) {
                    let mut rest = DVec3::ZERO;
                    for (bit, k) in (0..n).filter(|k| *k != i && *k != j).enumerate() {
                        rest +=
                            self.rows[k] * if signs >> bit & 1 == 1 { self.peak[k] } else { -self.peak[k] };
                    }
                    let x = inverse * -rest;
                    if x.x.abs() <= self.peak[i] + 1e-12 && x.y.abs() <= self.peak[j] + 1e-12 {
                        best = best.max(x.z);
                    }
                }
            }
        }
        best.min(1.0)
    }

    /// The least cost of joint torques within the limits that make `torque`, or infinity. Every joint is free, at its
    /// upper or at its lower limit; for the free ones three equations give the multipliers.
    pub(super) fn cost(&self, torque: DVec3) -> f64 {
        let n = self.rows.len();
        let mut best = f64::INFINITY;
        for set in 0..3_usize.pow(n as u32) {
            let state = |k: usize| set / 3_usize.pow(k as u32) % 3;
            let mut moment = DMat3::ZERO;
            let mut rest = torque;
            for k in 0..n {
                let g = self.rows[k];
                match state(k) {
                    0 => moment += DMat3::from_cols(g * g.x, g * g.y, g * g.z) * (1.0 / self.weight[k]),
                    1 => rest -= g * self.peak[k],
                    _ => rest += g * self.peak[k],
                }
            }
            if moment.determinant() < 1e-12 {
                continue;
            }
            let y = moment.inverse() * rest;
            let torques = (0..n).map(|k| match state(k) {
                0 => self.rows[k].dot(y) / self.weight[k],
                1 => self.peak[k],
                _ => -self.peak[k],
            });
            let torques: Vec<f64> = torques.collect();
            if torques.iter().zip(&self.peak).all(|(tau, t)| tau.abs() <= t + 1e-12) {
                best = best.min(torques.iter().zip(&self.weight).map(|(tau, w)| 0.5 * w * tau * tau).sum());
            }
        }
        best
    }
}
