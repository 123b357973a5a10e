//! The paper's way to a posture (section V.D). From a fixed start the rig turns the sphere to an
//! orientation; the steer angles at the end are the posture.
//!
//! The control of the paper's figure 6 turns the sphere about the axis of the remaining rotation,
//! which is the direction of e_O, and this axis stays constant. The turns here are therefore about
//! the axis of log q.
//!
//! Each wheel's steer angle then obeys its own equation, dth/ds = (p cos th + q sin th + s).u /
//! (l.c2). The turn s goes from 0 to |log q|, u is the axis, and c2 = p cos th + q sin th + s is
//! the rolling direction. Let f be the angle where the rate is greatest, and x = tan((th - f)/2).
//! Then x' = ((A + B) + (A - B) x²)/2, a Riccati equation with constant coefficients that is solved
//! exactly.

use core::f64::consts::PI;

use hbot_core::design::kinematics::ContactFrame;
use hbot_core::{Device, Quat, Vec3, rotation};

/// Precomputed vectors that describe how a wheel steers during a turn of the sphere. The steer rate
/// is dth/ds = A + B cos(th - f). The scalar products of the vectors with the axis of the turn give
/// A and B.
#[derive(Debug, Clone, Copy)]
struct Wheel {
    mean: Vec3,
    cos: Vec3,
    sin: Vec3,
}

/// The two wheels of a device with precomputed data, so that their steer angles after many turns
/// can be computed quickly.
#[derive(Debug, Clone)]
pub(super) struct Turns {
    wheels: [Wheel; 2],
}

impl Turns {
    /// Precomputes the data of a device with two wheels.
    pub(super) fn new(device: &Device) -> Self {
        let wheel = |k: usize| {
            let wheel = &device.wheels()[k];
            let [none, half, quarter] = [0.0, PI, 0.5 * PI].map(|th| ContactFrame::at(wheel, th).c2);
            let mean = (none + half) * 0.5;
            let scale = 1.0 / wheel.axis_along_roll();
            Wheel { mean: mean * scale, cos: (none - mean) * scale, sin: (quarter - mean) * scale }
        };
        Self { wheels: [wheel(0), wheel(1)] }
    }

    /// Returns the steer angles after the sphere has turned from the identity to `q`, rad. Before
    /// the turn they are `start`.
    pub(super) fn to(&self, q: Quat, start: [f64; 2]) -> [f64; 2] {
        let turn = rotation::log(q);
        let angle = turn.length();
        if !(angle > 0.0) {
            return start;
        }
        let axis = turn / angle;
        core::array::from_fn(|k| self.wheels[k].turned(axis, angle, start[k]))
    }
}

impl Wheel {
    /// Returns the steer angle after the sphere has turned by `angle` about `axis`, rad. Before the
    /// turn it is `th`.
    fn turned(&self, axis: Vec3, angle: f64, th: f64) -> f64 {
        let (a, c, s) = (self.mean.dot(axis), self.cos.dot(axis), self.sin.dot(axis));
        let b = libm::hypot(c, s);
        let phase = libm::atan2(s, c);
        // x = u/v: u' = (a + b)/2 v, v' = (b - a)/2 u, and both have u'' = k2 u.
        let (v0, u0) = {
            let (sin, cos) = libm::sincos(0.5 * (th - phase));
            (cos, sin)
        };
        let (up, down) = (0.5 * (a + b), 0.5 * (b - a));
        let k2 = up * down;
        let (cosh, sinh_over) = propagator(k2, angle);
        let (u, v) = (cosh * u0 + up * sinh_over * v0, cosh * v0 + down * sinh_over * u0);
        phase + 2.0 * libm::atan2(u, v)
    }
}

/// Returns cosh(k s) and sinh(k s)/k, where `k2` = k² can be negative.
fn propagator(k2: f64, s: f64) -> (f64, f64) {
    let z = k2 * s * s;
    if z.abs() < 1.0e-4 {
        // The next terms are z³/720 and z³/5040.
        return (1.0 + z / 2.0 + z * z / 24.0, s * (1.0 + z / 6.0 + z * z / 120.0));
    }
    let k = libm::sqrt(k2.abs());
    if k2 > 0.0 {
        (libm::cosh(k * s), libm::sinh(k * s) / k)
    } else {
        (libm::cos(k * s), libm::sin(k * s) / k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;
    use hbot_config::RigConfig;
    use hbot_core::design::kinematics::Posture;

    /// Returns the steer angles after the sphere has turned from the identity to `q`, rad. The
    /// kinematics zd = G w are integrated in `steps` steps of the classic Runge-Kutta method of
    /// order 4. `start` are the steer angles before the turn.
    fn stepped(device: &Device, q: Quat, start: [f64; 2], steps: u32) -> [f64; 2] {
        let w = rotation::log(q) / f64::from(steps);
        let rate = |th: [f64; 2]| {
            let zd = Posture::new(device, &th).inverse(w);
            [zd[0], zd[2]]
        };
        let moved = |th: [f64; 2], by: f64, k: [f64; 2]| [th[0] + by * k[0], th[1] + by * k[1]];
        (0..steps).fold(start, |th, _| {
            let k1 = rate(th);
            let k2 = rate(moved(th, 0.5, k1));
            let k3 = rate(moved(th, 0.5, k2));
            let k4 = rate(moved(th, 1.0, k3));
            core::array::from_fn(|i| th[i] + (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0)
        })
    }

    #[test]
    fn the_closed_form_is_where_small_steps_arrive() {
        let device = RigConfig::prototype().rig.device;
        let turns = Turns::new(&device);
        let mut rng = Rng(3);
        for _ in 0..50 {
            let angle = rng.between(0.0, PI);
            let q = rotation::exp(Vec3::from_array(rng.direction()) * angle);
            let start = [rng.between(-PI, PI), rng.between(-PI, PI)];
            let (exact, small) = (turns.to(q, start), stepped(&device, q, start, 2000));
            for k in 0..2 {
                // The error of 2000 steps with at most 0.01 rad of steering, order 4. A wheel that
                // turns around first amplifies it by up to exp(5.7 angle).
                let off = rotation::wrap_angle(exact[k] - small[k]).abs();
                assert!(off < 1e-4, "{q} from {start:?}: {off:e}");
            }
        }
    }

    #[test]
    fn no_turn_moves_nothing_and_rates_of_every_kind_are_solved() {
        let turns = Turns::new(&RigConfig::prototype().rig.device);
        assert_eq!(turns.to(Quat::IDENTITY, [0.3, -0.5]), [0.3, -0.5]);
        for k2 in [-4.0, -1e-5, 0.0, 1e-5, 4.0] {
            // (cosh)² - k2 (sinh/k)² = 1, to the rounding of the larger term.
            let (c, s) = propagator(k2, 1.5);
            assert!((c * c - k2 * s * s - 1.0).abs() < 1e-14 * c * c, "{k2}");
        }
    }
}
