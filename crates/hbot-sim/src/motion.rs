//! Exact motions of a sphere without slip, with the joint angles that encoders would read.
//!
//! Odometry methods are measured against them, at the server's start and in the accuracy study.

use core::f64::consts::TAU;

use hbot_core::design::kinematics::Posture;
use hbot_core::motion::path::Path;
use hbot_core::{Device, MAX_WHEELS, Quat, Vec3, rotation};

use crate::extrapolation;

/// Number of wheels of the devices for which these motions are computed.
pub const WHEELS: usize = 2;
/// Number of joints of the devices for which these motions are computed: two for each wheel.
pub const JOINTS: usize = 2 * WHEELS;
/// Length of the state vector: the orientation q as w, x, y, z, followed by the joint angles.
const SIZE: usize = 4 + JOINTS;

/// A prescribed motion of the sphere, defined by its angular velocity over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueMotion {
    /// Name of the motion, such as `brisk`. It becomes part of the ids of figures in the accuracy
    /// study.
    pub name: &'static str,
    /// Mean angular speed of the sphere, rad/s.
    pub speed: f64,
    /// Frequency at which the angular velocity varies, Hz.
    pub hertz: f64,
    /// Whether the sphere turns back and forth, so that its wheels are pushed backwards. Otherwise
    /// it keeps turning in one direction.
    pub reversing: bool,
}

/// The motions with which odometry is tested: gentle, brisk and violent, each both turning steadily
/// and turning back and forth.
pub const MOTIONS: [TrueMotion; 6] = {
    const fn motion(name: &'static str, speed: f64, hertz: f64, reversing: bool) -> TrueMotion {
        TrueMotion { name, speed, hertz, reversing }
    }
    [
        motion("gentle", 0.5, 0.5, false),
        motion("brisk", 3.0, 2.0, false),
        motion("violent", 15.0, 5.0, false),
        motion("gentle_reversing", 0.5, 0.5, true),
        motion("brisk_reversing", 3.0, 2.0, true),
        motion("violent_reversing", 15.0, 5.0, true),
    ]
};

/// Mean axis about which the sphere turns in a motion. It is parallel to neither steering axis of
/// the prototype.
const AXIS: Vec3 = Vec3::new(0.5, 0.8, 0.331_662_479);
/// Frequencies at which the angular velocity varies about the three axes, relative to
/// [`Motion::hertz`]. They have no common period.
const RATIOS: [f64; 3] = [1.0, core::f64::consts::SQRT_2, 1.618_033_988_749_895];

impl TrueMotion {
    /// Returns the angular velocity of the sphere at time `t` (s), in frame N, rad/s.
    #[must_use]
    pub fn omega(&self, t: f64) -> Vec3 {
        let wave = |k: usize, phase: f64| libm::sin(TAU * self.hertz * RATIOS[k] * t + phase);
        let waves = Vec3::new(wave(0, 0.3), wave(1, 1.1), wave(2, 2.5));
        if self.reversing {
            (AXIS * (core::f64::consts::SQRT_2 * wave(0, 0.7)) + waves * 0.25) * self.speed
        } else {
            (AXIS + waves * 0.3) * self.speed
        }
    }
}

/// The orientation and the joint angles at one moment of an exact motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionSample {
    /// Orientation as a quaternion w, x, y, z that maps sphere axes to frame N.
    pub q: [f64; 4],
    /// Joint angles in the order steer, drive of each wheel, rad.
    pub joints: [f64; JOINTS],
}

/// Time for which a motion runs before the first moment that is returned, s. During it the wheels
/// align with their rolling direction.
const BEFORE: f64 = 1.0;

/// Number of readings that must precede the first measured interval. The longest path between
/// readings, a cubic one, needs them.
pub const LEAD: usize = 3;

impl TrueMotion {
    /// Returns `count` moments of the motion at a rate of `hz` moments per second, accurate to
    /// rounding error.
    ///
    /// Moment number `lead` (counted from 0) is at time 0, and its orientation is the identity.
    #[must_use]
    pub fn moments(&self, device: &Device, hz: u32, count: usize, lead: usize) -> Vec<MotionSample> {
        let h = 1.0 / f64::from(hz);
        let states: Vec<[f64; SIZE]> = self.course(device, -(lead as f64) * h, h).take(count).collect();
        let zero = orientation(&states[lead]).conjugate();
        let moment = |y: &[f64; SIZE]| MotionSample {
            q: rotation::to_wxyz(orientation(y) * zero),
            joints: core::array::from_fn(|i| y[4 + i]),
        };
        states.iter().map(moment).collect()
    }
}

impl TrueMotion {
    /// Returns an endless iterator over the motion, with one item every `h` seconds, starting at
    /// time `start` (s).
    ///
    /// Each item holds the orientation q (w, x, y, z) and the N - 4 joint angles of `device`,
    /// accurate to rounding error.
    pub fn course<const N: usize>(
        self,
        device: &Device,
        start: f64,
        h: f64,
    ) -> impl Iterator<Item = [f64; N]> {
        let rates = move |t: f64, y: &[f64; N]| rates(device, self.omega(t), y);
        let mut y = [0.0; N];
        y[0] = 1.0;
        let steps = 500;
        for k in 0..steps {
            let step = BEFORE / f64::from(steps);
            y = extrapolation::advance(&rates, start - BEFORE + f64::from(k) * step, step, &y);
        }
        (0_u32..).map(move |k| {
            if k > 0 {
                y = extrapolation::advance(&rates, start + f64::from(k - 1) * h, h, &y);
                normalise(&mut y);
            }
            y
        })
    }
}

/// Returns the sphere's orientation (w, x, y, z) after the joints of `device` have turned at
/// constant rates, accurate to rounding error.
///
/// The wheels start at the steer angles `th` (rad), and the joints turn at the rates `zd` (rad/s)
/// for `time` seconds. The sphere starts at the identity.
#[must_use]
pub fn segment(device: &Device, th: [f64; WHEELS], zd: &[f64; JOINTS], time: f64) -> [f64; 4] {
    let turning = |t: f64, y: &[f64; 4]| {
        let th: [f64; WHEELS] = core::array::from_fn(|i| th[i] + zd[2 * i] * t);
        quaternion_rate(y, Posture::new(device, &th).forward(device, zd).omega)
    };
    let mut q = [1.0, 0.0, 0.0, 0.0];
    let steps = 300;
    let h = time / f64::from(steps);
    for k in 0..steps {
        q = extrapolation::advance(&turning, f64::from(k) * h, h, &q);
        normalise(&mut q);
    }
    q
}

/// Returns the sphere's orientation (w, x, y, z) after the joints of `device` have moved along
/// `path`, accurate to rounding error.
///
/// The motion starts at the steer angles `th` (rad) and the orientation `q`.
#[must_use]
pub fn along(device: &Device, th: [f64; WHEELS], path: &Path, q: [f64; 4]) -> [f64; 4] {
    let turning = |s: f64, y: &[f64; 4]| {
        let angles: [f64; WHEELS] = core::array::from_fn(|i| th[i] + path.turned(2 * i, s));
        let rates: [f64; JOINTS] = core::array::from_fn(|j| path.rate(j, s));
        quaternion_rate(y, Posture::new(device, &angles).forward(device, &rates).omega)
    };
    let mut q = extrapolation::advance(&turning, 0.0, 1.0, &q);
    normalise(&mut q);
    q
}

fn orientation(y: &[f64]) -> Quat {
    Quat::from_xyzw(y[1], y[2], y[3], y[0])
}

fn rates<const N: usize>(device: &Device, omega: Vec3, y: &[f64; N]) -> [f64; N] {
    let mut th = [0.0; MAX_WHEELS];
    for (th, joints) in th.iter_mut().zip(y[4..].chunks(2)) {
        *th = joints[0];
    }
    let joints = Posture::new(device, &th[..(N - 4) / 2]).inverse(omega);
    let q = quaternion_rate(&[y[0], y[1], y[2], y[3]], omega);
    core::array::from_fn(|i| if i < 4 { q[i] } else { joints[i - 4] })
}

/// Returns the rate of the orientation quaternion, dq/dt = 1/2 (0, w) q, for the angular velocity
/// `w` in frame N.
fn quaternion_rate(q: &[f64; 4], w: Vec3) -> [f64; 4] {
    let e = Vec3::new(q[1], q[2], q[3]);
    let rate = (w * q[0] + w.cross(e)) * 0.5;
    [-0.5 * w.dot(e), rate.x, rate.y, rate.z]
}

fn normalise(y: &mut [f64]) {
    let norm = libm::sqrt(y[..4].iter().map(|x| x * x).sum());
    y[..4].iter_mut().for_each(|x| *x /= norm);
}

/// Returns the angle between two orientations, rad. Both are quaternions in the order w, x, y, z.
#[must_use]
pub fn angle(a: [f64; 4], b: [f64; 4]) -> f64 {
    rotation::angle_between(orientation(&a), orientation(&b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If the moments of a motion are computed twice as often, the orientation at its end is the
    /// same, apart from rounding errors. This also holds for motions that reverse.
    #[test]
    fn a_motion_does_not_depend_on_how_often_it_is_read() {
        let device = hbot_config::RigConfig::prototype().rig.device;
        for motion in MOTIONS {
            let coarse = motion.moments(&device, 1000, 201, 0);
            let fine = motion.moments(&device, 2000, 401, 0);
            let off = angle(coarse[200].q, fine[400].q);
            // 400 steps with a rounding error of 1e-16 each.
            assert!(off < 4e-14, "{}: {off:e}", motion.name);
        }
    }
}
