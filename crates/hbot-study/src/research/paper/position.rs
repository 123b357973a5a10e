//! The position control of fig. 6 on the simulated rig: drives that follow joint rates, and a
//! position loop around them.

use core::f64::consts::TAU;

use hbot_core::allocation::{ContactArms, traction};
use hbot_core::design::kinematics::Posture;
use hbot_core::outputs::Outputs;
use hbot_core::rotation::{self, error_eq24, shortest, vector_part};
use hbot_core::{MAX_JOINTS, Quat, Vec3};
use hbot_sim::phenomena::{CageFriction, JointFriction, Motor, Phenomena};
use serde_json::json;

use crate::whole::{Whole, inertia, prototype, scene_of};

/// Corner frequency of the integral part of a rate loop, as a fraction of the corner frequency of
/// its proportional part.
const INTEGRAL: f64 = 0.2;
/// Time in which the sine at the input rises to its full amplitude, s.
const FADE_S: f64 = 0.5;
/// Smallest number of ticks for the response to settle, and again for its observation. At 1 kHz
/// each takes 1 s.
const LEAST: u32 = 1000;
/// A gain of -3 dB. The bandwidth is the frequency at which the gain has fallen to this value.
const DOWN: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Longest sine period in the search for a bandwidth, ticks.
const LONGEST: f64 = 2000.0;
/// Shortest sine period in the search for a bandwidth, ticks.
const SHORTEST: f64 = 20.0;
/// Ratio of two successive sine periods in the search for a bandwidth.
const RATIO: f64 = 1.15;

/// Parameters of motors with a lag and a limited speed. They have no other error and do not heat
/// up.
pub(super) const MOTOR: Motor = Motor {
    torque_scale: 1.0,
    lag_s: 5.0e-4,
    steer_no_load_rate: 500.0,
    drive_no_load_rate: 60.0,
    thermal_time_s: 1.0e5,
};

/// The settings of one experiment: a position loop, and the sine that it follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Setting {
    /// Gain K_O of the position loop, 1/s.
    pub(super) gain: f64,
    /// Corner frequency of the drives' rate loops for a turn of the sphere about `axis`, Hz.
    pub(super) inner_hz: f64,
    /// Amplitude of the desired sine, rad.
    pub(super) amplitude: f64,
    /// Axis about which the sphere follows the sine, a unit vector in frame N.
    pub(super) axis: Vec3,
    /// Whether the joints and the cage have friction.
    pub(super) friction: bool,
}

/// A position loop that controls the simulated rig in virtual time.
struct Loop {
    run: Whole,
    setting: Setting,
    arms: [ContactArms; 2],
    /// Proportional gain of each joint's rate loop, N m s/rad.
    gains: [f64; MAX_JOINTS],
    /// Gain of the integral part of the rate loops, 1/s.
    integral_gain: f64,
    integral: [f64; MAX_JOINTS],
}

impl Loop {
    fn new(setting: Setting) -> Self {
        let config = prototype(&[]);
        let device = config.rig.device;
        let phenomena = Phenomena {
            motor: Some(MOTOR),
            joint_friction: setting.friction.then(JointFriction::default),
            cage_friction: setting.friction.then(CageFriction::default),
            ..Phenomena::default()
        };
        let radius = device.sphere_radius();
        let posture = Posture::new(&device, &[0.0; 2]);
        // With joint gains in proportion to the squares of the contact arms, the rate loops resist
        // a turn of the sphere by R² sum (I - c3 c3ᵀ), for any headings.
        let resist: f64 = posture.frames().iter().map(|frame| 1.0 - frame.c3.dot(setting.axis).powi(2)).sum();
        let scale = TAU * setting.inner_hz * inertia(&device, setting.axis) / (radius * radius * resist);
        let arms = [0, 1].map(|i| ContactArms::of(&device.wheels()[i], radius));
        let mut gains = [0.0; MAX_JOINTS];
        for (pair, arm) in gains.chunks_exact_mut(2).zip(&arms) {
            pair.copy_from_slice(&[scale * arm.steer * arm.steer, scale * arm.roll * arm.roll]);
        }
        Self {
            run: Whole::new(&config, scene_of(json!({"name": "study"})), phenomena),
            setting,
            arms,
            gains,
            integral_gain: INTEGRAL * TAU * setting.inner_hz,
            integral: [0.0; MAX_JOINTS],
        }
    }

    /// Runs one tick. The position loop asks for the joint rates zd = G K_O e_O, and the rate loops
    /// turn these into joint torques within the rig's limits.
    fn step(&mut self, wanted: Quat) {
        let Self { run, setting, arms, gains, integral_gain, integral } = self;
        let rig = *run.controller().rig();
        let period = run.period();
        let torque = |told: &Outputs| {
            let q = told.state.q;
            // The nearer of the two quaternions.
            let error = error_eq24(shortest(wanted * q.conjugate()) * q, q);
            let posture = Posture::new(&rig.device, &[told.state.angle[0], told.state.angle[2]]);
            let rates = posture.inverse(error * setting.gain);
            let mut tau = [0.0; MAX_JOINTS];
            let mut held = true;
            for j in 0..rig.device.joints() {
                let asked = gains[j] * (rates[j] - told.state.rate[j] + *integral_gain * integral[j]);
                tau[j] = asked.clamp(-rig.joints[j].peak, rig.joints[j].peak);
                held &= asked == tau[j];
            }
            // Applies the limits that the server applies: the torque on the sphere, and the force
            // at each contact.
            let grip = rig.limits.traction.map_or(f64::INFINITY, |grip| grip.mu * grip.normal_force);
            let size = posture.torque_on_sphere(&tau[..rig.device.joints()]).length();
            let over = (size / rig.limits.torque).max(traction(arms, &tau, grip)).max(1.0);
            for j in 0..rig.device.joints() {
                tau[j] /= over;
                // The integral stops while the torque is saturated, so that it does not wind up.
                if held && over == 1.0 {
                    integral[j] += (rates[j] - told.state.rate[j]) * period;
                }
            }
            tau
        };
        run.step_driven(torque);
    }
}

/// Returns gain and phase (rad) of the sphere's turn relative to the desired turn, in steady state.
///
/// The desired turn is a sine with a period of `ticks` ticks. The sphere's turn is evaluated at
/// this frequency by one bin of a Fourier series.
pub(super) fn response(setting: Setting, ticks: u32) -> [f64; 2] {
    let mut run = Loop::new(setting);
    let settle = LEAST.div_ceil(ticks).max(3) * ticks;
    let looks = LEAST.div_ceil(ticks).max(2) * ticks;
    let fade = FADE_S / run.run.period();
    let (mut re, mut im) = (0.0, 0.0);
    for k in 0..settle + looks {
        let (sin, cos) = libm::sincos(TAU * f64::from(k % ticks) / f64::from(ticks));
        let amplitude = setting.amplitude * (f64::from(k) / fade).min(1.0);
        run.step(rotation::exp(setting.axis * (amplitude * sin)));
        if k >= settle {
            // Compares the tick's reference with the true orientation at that time.
            let q = shortest(run.run.rig().state().q);
            let turn = 2.0 * libm::atan2(vector_part(q).dot(setting.axis), q.w);
            (re, im) = (re + turn * sin, im + turn * cos);
        }
    }
    let scale = 2.0 / (f64::from(looks) * setting.amplitude);
    [libm::hypot(re, im) * scale, libm::atan2(im, re)]
}

/// Returns the frequency at which the gain has fallen to -3 dB, Hz. It is interpolated between the
/// first two frequencies of a scan that enclose it.
pub(super) fn bandwidth(setting: Setting) -> f64 {
    let mut period = LONGEST;
    let mut before = [0.0, 1.0];
    while period >= SHORTEST {
        let ticks = period.round() as u32;
        let (hertz, [size, _]) = (1.0e3 / f64::from(ticks), response(setting, ticks));
        if size < DOWN {
            return between(before, [hertz, size]);
        }
        before = [hertz, size];
        period /= RATIO;
    }
    f64::NAN
}

/// Returns gain and phase (rad) of the position loop in a linear model.
///
/// The rate loops F act on the inertia, with the lag of the motors, half a period for holding and
/// one period from reading to torque. The position loop around them is H = P V / (s + P V z), with
/// P = K_O / 2, V = F / (1 + F z) and the delay z of one period.
pub(super) fn linear_response(setting: &Setting, hertz: f64) -> [f64; 2] {
    let (s, h) = (Complex { re: 0.0, im: TAU * hertz }, 1.0e-3);
    let corner = TAU * setting.inner_hz;
    let one = Complex { re: 1.0, im: 0.0 };
    let delay = |time: f64| {
        let (sin, cos) = libm::sincos(-s.im * time);
        Complex { re: cos, im: sin }
    };
    let lag = one.over(one.plus(s.times_real(MOTOR.lag_s)));
    let pi = one.plus(one.times_real(INTEGRAL * corner).over(s));
    let f = one.times_real(corner).over(s).times(pi).times(lag).times(delay(0.5 * h));
    let v = f.over(one.plus(f.times(delay(h)))).times_real(0.5 * setting.gain);
    let response = v.over(s.plus(v.times(delay(h))));
    [libm::hypot(response.re, response.im), libm::atan2(response.im, response.re)]
}

/// Returns the frequency at which the gain of the linear model has fallen to -3 dB, Hz.
pub(super) fn linear_bandwidth(setting: &Setting) -> f64 {
    let mut before = [0.0, 1.0];
    for k in 0..2000 {
        let hertz = 0.2 * libm::pow(1.005, f64::from(k));
        let [size, _] = linear_response(setting, hertz);
        if size < DOWN {
            return between(before, [hertz, size]);
        }
        before = [hertz, size];
    }
    f64::NAN
}

/// Returns the gain K_O at which the linear model has a bandwidth of `hertz`, 1/s.
pub(super) fn gain_for(setting: &Setting, hertz: f64) -> f64 {
    let (mut low, mut high) = (1.0, 500.0);
    for _ in 0..40 {
        let gain = 0.5 * (low + high);
        if linear_bandwidth(&Setting { gain, ..*setting }) < hertz { low = gain } else { high = gain }
    }
    0.5 * (low + high)
}

/// Returns the frequency at which a straight line through two points of a Bode plot crosses -3 dB,
/// Hz. Each point is a frequency (Hz) and a gain.
fn between([f0, g0]: [f64; 2], [f1, g1]: [f64; 2]) -> f64 {
    let part = (g0 / DOWN).ln() / (g0 / g1).ln();
    (f0.ln() * (1.0 - part) + f1.ln() * part).exp()
}

#[derive(Debug, Clone, Copy)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    fn plus(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }

    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    fn times_real(self, x: f64) -> Self {
        Self { re: self.re * x, im: self.im * x }
    }

    fn over(self, other: Self) -> Self {
        let size = other.re * other.re + other.im * other.im;
        self.times(Self { re: other.re / size, im: -other.im / size })
    }
}
