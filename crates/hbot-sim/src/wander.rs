//! A device that is not as drawn, and a person's hand that turns its sphere for long, about all
//! axes: the exact joint angles, which encoders would read.
//!
//! Methods that find the true geometry are measured against them.

use core::f64::consts::{PI, TAU};

use hbot_core::design::device::{Device, DeviceError, WheelSpec};
use hbot_core::design::kinematics::Posture;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Quat, Vec3, rotation};
use oorandom::Rand64;

/// Standard deviation of an angle of a device from its drawing, rad: half a degree.
const ANGLE: f64 = 0.5 * PI / 180.0;
/// Standard deviation of a wheel's radius from its drawing, as a fraction of the radius.
const RADIUS: f64 = 0.01;
/// Number of sines of which the motion about each axis is made.
const SINES: usize = 8;
/// Range of their frequencies, Hz.
const HERTZ: [f64; 2] = [0.03, 0.5];
/// sqrt(3)/6 and sqrt(3)/12: Gauss points and cross product of the Magnus expansion of order 4.
const ROOT3: [f64; 2] = [0.288_675_134_594_812_9, 0.144_337_567_297_406_44];

/// A device that differs at random from its drawing: axes, cones, toes and zeros by half a degree,
/// radii by 1 % (standard deviations).
#[derive(Debug, Clone)]
pub struct Built {
    /// The true geometry.
    pub device: Device,
    /// True angle of each steer joint where its encoder reads zero, rad.
    pub zeros: Vec<f64>,
}

impl Built {
    /// Builds `drawing` with tolerances from the random numbers of `seed`.
    ///
    /// # Errors
    /// Fails if the device that comes out is not legal.
    pub fn new(drawing: &Device, seed: u64) -> Result<Self, DeviceError> {
        let mut random = Rand64::new(u128::from(seed));
        let mut specs = Vec::new();
        let mut zeros = Vec::new();
        for wheel in drawing.wheels() {
            let spec = *wheel.spec();
            let mut next = || normal(|| random.rand_float());
            let tilt = Vec3::new(next(), next(), next()) * ANGLE;
            specs.push(WheelSpec {
                axis: spec.axis + tilt.cross(spec.axis),
                cone: spec.cone + ANGLE * next(),
                toe: spec.toe + ANGLE * next(),
                radius: spec.radius * (1.0 + RADIUS * next()),
                ..spec
            });
            zeros.push(ANGLE * next());
        }
        let device = Device::new(drawing.sphere_radius(), drawing.sphere_mass(), &specs)?;
        Ok(Self { device, zeros })
    }
}

/// Returns a number of the normal distribution with mean 0 and standard deviation 1, made of two
/// numbers that are uniformly distributed in [0, 1) (Box and Muller 1958).
pub fn normal(mut uniform: impl FnMut() -> f64) -> f64 {
    let (u, v) = (uniform().max(f64::MIN_POSITIVE), uniform());
    libm::sqrt(-2.0 * libm::log(u)) * libm::cos(TAU * v)
}

/// A motion of the sphere by a hand.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "one exists for each recording")]
pub enum Wander {
    /// Turns about all axes that never repeat: size (rad/s), pace (rad/s) and phase (rad) of the
    /// sines about n1, n2 and n3.
    Sines([[[f64; 3]; SINES]; 3]),
    /// Whole turns, one after another: their axes, and the time of each, s.
    Turns(Vec<Vec3>, f64),
}

/// Orientation and joint angles at one moment of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Orientation of the sphere. It maps sphere axes to frame N.
    pub q: Quat,
    /// Angles of the joints, steer and drive of each wheel, rad.
    pub angles: [f64; MAX_JOINTS],
}

impl Wander {
    /// Creates a motion from the random numbers of `seed`. The angular velocity about n1, n2 and n3
    /// has the root mean squares `speed`, rad/s.
    #[must_use]
    pub fn new(seed: u64, speed: Vec3) -> Self {
        let mut random = Rand64::new(u128::from(seed));
        let sines = core::array::from_fn(|axis| {
            core::array::from_fn(|_| {
                let size = speed[axis] * libm::sqrt(2.0 / SINES as f64);
                let pace = TAU * (HERTZ[0] + (HERTZ[1] - HERTZ[0]) * random.rand_float());
                [size, pace, TAU * random.rand_float()]
            })
        });
        Self::Sines(sines)
    }

    /// Creates a motion of `count` whole turns about axes at random, each from rest to rest in
    /// `seconds`.
    #[must_use]
    pub fn turns(seed: u64, count: usize, seconds: f64) -> Self {
        let mut random = Rand64::new(u128::from(seed));
        let mut next = || normal(|| random.rand_float());
        let axes = (0..count).map(|_| Vec3::new(next(), next(), next()).normalize_or(Vec3::Z));
        Self::Turns(axes.collect(), seconds)
    }

    /// Returns the angular velocity of the sphere at time `t` (s), in frame N, rad/s.
    #[must_use]
    pub fn omega(&self, t: f64) -> Vec3 {
        let sines = match self {
            Self::Sines(sines) => sines,
            Self::Turns(axes, seconds) => {
                let (number, part) = (libm::floor(t / seconds), t / seconds);
                let axis = axes.get(number as usize).copied().unwrap_or(Vec3::ZERO);
                return axis * (TAU / seconds * (1.0 - libm::cos(TAU * (part - number))));
            }
        };
        let about = |sines: &[[f64; 3]; SINES]| {
            sines.iter().map(|[size, pace, phase]| size * libm::sin(pace * t + phase)).sum()
        };
        Vec3::new(about(&sines[0]), about(&sines[1]), about(&sines[2]))
    }

    /// Returns an endless iterator over the motion of `device` with a moment every `h` seconds. It
    /// begins at time 0 with the orientation identity and all joint angles 0.
    ///
    /// Its steps are of order 4. At steps of 1 ms the error of a step is some 1e-11 rad.
    pub fn course<'a>(&'a self, device: &'a Device, h: f64) -> impl Iterator<Item = Moment> + 'a {
        let n = device.wheels().len();
        let rates = move |t: f64, z: &[f64; MAX_JOINTS]| {
            let th: [f64; MAX_WHEELS] = core::array::from_fn(|i| z[2 * i]);
            Posture::new(device, &th[..n]).inverse(self.omega(t))
        };
        let plus = |z: &[f64; MAX_JOINTS], k: &[f64; MAX_JOINTS], h: f64| -> [f64; MAX_JOINTS] {
            core::array::from_fn(|j| z[j] + h * k[j])
        };
        let mut now = Moment { q: Quat::IDENTITY, angles: [0.0; MAX_JOINTS] };
        (0_u32..).map(move |k| {
            let before = now;
            let (t, z) = (f64::from(k) * h, &before.angles);
            let a = rates(t, z);
            let b = rates(t + 0.5 * h, &plus(z, &a, 0.5 * h));
            let c = rates(t + 0.5 * h, &plus(z, &b, 0.5 * h));
            let d = rates(t + h, &plus(z, &c, h));
            now.angles = core::array::from_fn(|j| z[j] + h / 6.0 * (a[j] + 2.0 * b[j] + 2.0 * c[j] + d[j]));
            let (first, last) = (self.omega(t + (0.5 - ROOT3[0]) * h), self.omega(t + (0.5 + ROOT3[0]) * h));
            let turn = (first + last) * (0.5 * h) - first.cross(last) * (ROOT3[1] * h * h);
            now.q = (rotation::exp(turn) * before.q).normalize();
            before
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half the step gives the same motion, and its turn is that of the joints.
    #[test]
    fn the_course_is_exact() {
        let device = hbot_config::RigConfig::prototype().rig.device;
        let built = Built::new(&device, 3).expect("near the drawing").device;
        let wander = Wander::new(1, Vec3::splat(1.5));
        let end = |h: f64, k: usize| wander.course(&built, h).nth(k).expect("endless");
        let (coarse, fine) = (end(1e-3, 2000), end(5e-4, 4000));
        assert!(rotation::angle_between(coarse.q, fine.q) < 1e-9);
        for j in 0..4 {
            // 2000 steps of 1e-11 rad, times what a caster makes of an error.
            let off = coarse.angles[j] - fine.angles[j];
            assert!(off.abs() < 1e-6, "{j}: {off:e}");
        }
    }
}
