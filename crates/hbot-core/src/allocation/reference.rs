//! Slow reference solutions in 64 bits. For few joints, every set of joints at their limits is
//! tried. For any number of joints, an interior-point method is used.

extern crate std;

use std::vec::Vec;

use glam::{DMat3, DVec3};

/// An allocation problem for the slow reference solvers: the rows of G, the torque limits and the
/// cost weights of joints that are all driven.
pub(super) struct Reference {
    pub(super) rows: Vec<DVec3>,
    pub(super) peak: Vec<f64>,
    pub(super) weight: Vec<f64>,
}

impl Reference {
    /// Returns the largest s from 0 to 1 for which joint torques within their limits make the
    /// torque `s * wanted` on the sphere.
    ///
    /// It tries every vertex of the linear program. At a vertex, all joints except two are at their
    /// limits, and three equations give these two joint torques and s.
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

    /// Returns the smallest cost of joint torques within their limits that make `torque` on the
    /// sphere. Returns infinity if no such joint torques exist.
    ///
    /// It tries every combination of joints that are free, at the upper limit or at the lower
    /// limit. Three equations then give the torques of the free joints.
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

    /// Returns the smallest cost of joint torques that make `torque` on the sphere. `torque` must
    /// be smaller than the largest reachable torque in its direction.
    ///
    /// The method takes Newton steps on the cost plus a logarithmic barrier at each limit, and
    /// reduces the weight of the barrier towards zero (Boyd and Vandenberghe 2004, 11.3 and 10.3).
    pub(super) fn cost_by_barrier(&self, torque: DVec3) -> f64 {
        let n = self.rows.len();
        let mut x = std::vec![0.0_f64; n];
        // Scales the costs to about 1, whatever their unit.
        let dearest = (0..n).map(|k| self.weight[k] * self.peak[k] * self.peak[k]).fold(0.0, f64::max);
        let mut barrier = 1.0;
        while barrier > 1e-14 {
            barrier *= 0.3;
            for _ in 0..8 {
                let (mut slope, mut bend) = (std::vec![0.0; n], std::vec![0.0; n]);
                let (mut moment, mut right) = (DMat3::ZERO, torque);
                for k in 0..n {
                    let (above, below) = (self.peak[k] - x[k], self.peak[k] + x[k]);
                    let weight = self.weight[k] / dearest;
                    slope[k] = weight * x[k] + barrier * (1.0 / above - 1.0 / below);
                    bend[k] = weight + barrier * (1.0 / (above * above) + 1.0 / (below * below));
                    let g = self.rows[k];
                    moment += DMat3::from_cols(g * g.x, g * g.y, g * g.z) * (1.0 / bend[k]);
                    right += g * (slope[k] / bend[k] - x[k]);
                }
                let y = moment.inverse() * right;
                let step: Vec<f64> = (0..n).map(|k| (self.rows[k].dot(y) - slope[k]) / bend[k]).collect();
                let room = (0..n).map(|k| (self.peak[k] - x[k] * step[k].signum()) / step[k].abs());
                let length = room.fold(1.0, |length: f64, room| length.min(0.95 * room));
                for k in 0..n {
                    x[k] += length * step[k];
                }
            }
        }
        let made: DVec3 = (0..n).map(|k| self.rows[k] * x[k]).sum();
        assert!((made - torque).length() < 1e-10, "{made} for {torque}");
        x.iter().zip(&self.weight).map(|(tau, w)| 0.5 * w * tau * tau).sum()
    }
}
