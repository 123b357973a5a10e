//! The rate estimates of the core, a differentiator of Levant and an observer that knows the
//! commanded torque, on one axis of the prototype: noise, lag, and first unstable spring with the
//! lead. docs/internals/velocity.md says what follows.
//!
//! The axis has 1 kHz, a delay of one tick, motors with a lag of 0.5 ms, 0.01 N m s/rad and a lead
//! of 1.1 times the delay. The encoder's step is that of the sphere for all joints together.

use hbot_config::RigConfig;
use hbot_core::design::rig::RateEstimate;
use hbot_core::motion::rates::step_response;

const H: f64 = 1.0e-3;
const LAG: f64 = 5.0e-4;
const LEAD: f64 = 1.1 * (1.5 * H + LAG);
const DAMPING: f64 = 0.01;
/// Apparent inertia of the free sphere, kg m². The observer assumes it.
const INERTIA: f64 = 3.4e-3;
/// Step of the sphere's angle with 16384 counts a turn, rad: 12^(1/2) times the noise that the
/// rounding of all joints makes about the noisiest axis.
const STEP: f64 = 6.27e-5;
/// Ripple that a hand hardly feels, N m (docs/internals/velocity.md).
const FELT: f64 = 3.3e-3;
/// Parts of a tick in which the motion is integrated.
const PARTS: u32 = 20;

/// What holds the sphere: inertia of all that turns, stiffness and damping of the hand.
#[derive(Clone, Copy)]
struct Held {
    inertia: f64,
    stiffness: f64,
    damping: f64,
}

const FREE: Held = Held { inertia: INERTIA, stiffness: 0.0, damping: 0.0 };
/// A hand that triples the inertia.
const HAND: Held = Held { inertia: 3.0 * INERTIA, stiffness: 3.0, damping: 0.05 };

/// An estimate of the rate from the rounded angle and the torque of the motors.
trait Estimate {
    /// Returns the rate at the reading `angle` (rad). `torque` is the mean torque of the motors
    /// since the last reading, N m.
    fn rate(&mut self, angle: f64, torque: f64) -> f64;
}

/// An estimate of the core, by its weights.
struct Weights {
    taps: Vec<f64>,
    last: Vec<f64>,
}

impl Weights {
    fn new(rate: RateEstimate, counts: u32) -> Self {
        let rig = RigConfig::prototype().rig.with(|parts| {
            parts.methods.rate = rate;
            parts.joints.iter_mut().for_each(|joint| joint.counts_per_turn = counts);
        });
        let mut steps = [0.0; 128];
        assert!(step_response(&rig.expect("legal"), 0, &mut steps));
        let before = std::iter::once(0.0).chain(steps);
        let taps: Vec<f64> = steps.iter().zip(before).map(|(step, before)| step - before).collect();
        Self { last: vec![0.0; taps.len()], taps }
    }
}

impl Estimate for Weights {
    fn rate(&mut self, angle: f64, _: f64) -> f64 {
        self.last.rotate_right(1);
        self.last[0] = angle;
        self.taps.iter().zip(&self.last).map(|(tap, angle)| tap * angle).sum()
    }
}

/// The robust exact differentiator of the first order (Levant 1998), with the constants 1.5 and
/// 1.1. `bound` is the bound of the acceleration, rad/s².
struct Levant {
    bound: f64,
    angle: f64,
    rate: f64,
}

impl Estimate for Levant {
    fn rate(&mut self, angle: f64, _: f64) -> f64 {
        // Euler's steps of a twentieth of a tick towards the angle of the reading.
        let step = H / f64::from(PARTS);
        for _ in 0..PARTS {
            let error = self.angle - angle;
            let sign = if error == 0.0 { 0.0 } else { error.signum() };
            let speed = self.rate - 1.5 * (self.bound * error.abs()).sqrt() * sign;
            self.angle += step * speed;
            self.rate -= step * 1.1 * self.bound * sign;
        }
        self.rate
    }
}

/// A filter with the gains of the Kalman filter in the core. It knows the acceleration that the
/// motors make on `inertia`, and estimates the rest of the acceleration.
struct Observer {
    gains: [f64; 3],
    inertia: f64,
    state: [f64; 3],
}

impl Observer {
    /// `acceleration` is the size of the acceleration that others make, rad/s². `step` is the step
    /// of the encoder, rad.
    fn new(acceleration: f64, step: f64, inertia: f64) -> Self {
        let jerk = 2.0 * acceleration * acceleration / 0.1;
        let noise = step * step / 12.0;
        let f = [[1.0, H, 0.5 * H * H], [0.0, 1.0, H], [0.0, 0.0, 1.0]];
        let q = [
            [H.powi(5) / 20.0, H.powi(4) / 8.0, H.powi(3) / 6.0],
            [H.powi(4) / 8.0, H.powi(3) / 3.0, H * H / 2.0],
            [H.powi(3) / 6.0, H * H / 2.0, H],
        ];
        let mut p = [[noise, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, acceleration * acceleration]];
        let mut gains = [0.0; 3];
        for _ in 0..4000 {
            let mut next = [[0.0; 3]; 3];
            for i in 0..3 {
                for j in 0..3 {
                    next[i][j] = jerk * q[i][j];
                    for k in 0..3 {
                        for l in 0..3 {
                            next[i][j] += f[i][k] * p[k][l] * f[j][l];
                        }
                    }
                }
            }
            gains = [0, 1, 2].map(|i| next[i][0] / (next[0][0] + noise));
            for i in 0..3 {
                for j in 0..3 {
                    p[i][j] = next[i][j] - gains[i] * next[0][j];
                }
            }
        }
        Self { gains, inertia, state: [0.0; 3] }
    }
}

impl Estimate for Observer {
    fn rate(&mut self, angle: f64, torque: f64) -> f64 {
        let [x, v, other] = self.state;
        let a = other + torque / self.inertia;
        let surprise = angle - (x + H * (v + 0.5 * H * a));
        self.state[0] = angle - (1.0 - self.gains[0]) * surprise;
        self.state[1] = v + H * a + self.gains[1] * surprise;
        self.state[2] = other + self.gains[2] * surprise;
        self.state[1]
    }
}

fn rounded(angle: f64, step: f64) -> f64 {
    (angle / step).floor() * step
}

/// Returns whether a tap of the axis on a spring is at rest after 2 s: whether the angle stays
/// within some steps of the encoder.
fn rests(estimate: &mut dyn Estimate, held: Held, stiffness: f64, step: f64) -> bool {
    let part = H / f64::from(PARTS);
    let left = (-part / LAG).exp();
    let (mut x, mut v, mut torque) = (0.3 * step, 0.5, 0.0);
    let (mut command, mut mean) = (0.0, 0.0);
    let mut sum = 0.0;
    for tick in 0..2500 {
        let angle = rounded(x, step);
        let rate = estimate.rate(angle, mean);
        let next = -stiffness * (angle + LEAD * rate) - DAMPING * rate;
        mean = 0.0;
        for _ in 0..PARTS {
            let after = command + (torque - command) * left;
            let acts = 0.5 * (torque + after);
            let a = (acts - held.stiffness * x - held.damping * v) / held.inertia;
            v += part * a;
            x += part * (v - 0.5 * part * a);
            mean += acts / f64::from(PARTS);
            torque = after;
        }
        // The torque of this reading acts from the next tick on, and is no more than the motors
        // make.
        command = next.clamp(-0.9, 0.9);
        if tick >= 2000 {
            sum += x * x;
        }
    }
    (sum / 500.0).sqrt() < 3.0 * step
}

/// Returns the first unstable spring, N m/rad, to 2 %.
fn border(new: &dyn Fn() -> Box<dyn Estimate>, held: Held, step: f64) -> f64 {
    let mut stiffness = 8.0;
    while stiffness < 400.0 && rests(&mut *new(), held, stiffness, step) {
        stiffness *= 1.04;
    }
    stiffness / 1.02
}

/// Returns the noise of a torque for each N m/rad of stiffness (N m, rms) and the lag of the rate
/// (s), while a hand moves the sphere by some rad at 1.5 Hz against no torque.
fn noise(estimate: &mut dyn Estimate, step: f64) -> [f64; 2] {
    let pace = std::f64::consts::TAU * 1.5;
    let (mut errors, mut ticks) = (Vec::new(), 0.0);
    for tick in 0..6000_u32 {
        let t = f64::from(tick) * H;
        // Two swings without a common period, so that the rounding is at all phases.
        let (a, b) = (pace * t, 0.618 * pace * t);
        let x = 0.1 * (a.sin() + b.sin());
        let v = 0.1 * pace * (a.cos() + 0.618 * b.cos());
        let growth = -0.1 * pace * pace * (a.sin() + 0.618 * 0.618 * b.sin());
        let angle = rounded(x, step);
        let rate = estimate.rate(angle, 0.0);
        if tick > 500 {
            errors.push((rate - v, growth, angle - x + 0.5 * step));
            ticks += 1.0;
        }
    }
    let lag = -errors.iter().map(|(e, g, _)| e * g).sum::<f64>()
        / errors.iter().map(|(_, g, _)| g * g).sum::<f64>();
    let sum: f64 = errors.iter().map(|(e, g, x)| (x + LEAD * (e + lag * g)).powi(2)).sum();
    [(sum / ticks).sqrt(), lag]
}

/// The figures of one estimate with the parameter that is best.
#[derive(Debug, Clone)]
struct Found {
    name: String,
    noise: f64,
    lag: f64,
    free: f64,
    hand: f64,
}

impl Found {
    fn of(name: String, new: &dyn Fn() -> Box<dyn Estimate>, step: f64) -> Self {
        let [noise, lag] = noise(&mut *new(), step);
        Self { name, noise, lag, free: border(new, FREE, step), hand: border(new, HAND, step) }
    }

    /// The stiffest spring that is stable, free and held, and whose ripple is not felt.
    fn usable(&self) -> f64 {
        self.free.min(self.hand).min(FELT / self.noise)
    }
}

/// Accelerations of the sphere, rad/s², for which the estimates are tuned.
const SIZES: [f64; 4] = [3.0, 6.0, 10.0, 30.0];

fn all(counts: u32) -> [Vec<Found>; 3] {
    let step = STEP * 16384.0 / f64::from(counts);
    let kalman = SIZES.map(|size| {
        // The joints accelerate 5.8 times as much as the sphere.
        let acceleration = (5.8_f64 * size).round();
        let new = move || -> Box<dyn Estimate> {
            Box::new(Weights::new(RateEstimate::Kalman { acceleration }, counts))
        };
        Found::of(format!("kalman {acceleration}"), &new, step)
    });
    let levant = SIZES.map(|size| {
        let bound = 5.0 * size;
        let new = move || -> Box<dyn Estimate> { Box::new(Levant { bound, angle: 0.0, rate: 0.0 }) };
        Found::of(format!("Levant {bound}"), &new, step)
    });
    let observer = SIZES.map(|size| {
        let new = move || -> Box<dyn Estimate> { Box::new(Observer::new(size, step, INERTIA)) };
        Found::of(format!("observer {size}"), &new, step)
    });
    [kalman.to_vec(), levant.to_vec(), observer.to_vec()]
}

/// Neither of the others allows a stiffer spring than the Kalman filter of the core. The model of
/// the torque helps the free sphere, and a hand that makes it wrong takes more away.
#[test]
fn no_other_estimate_wins_against_the_kalman_filter() {
    println!("| counts | estimate | ripple at 100 N m/rad, mN m | lag, ms | free | hand | usable |");
    println!("|---|---|---|---|---|---|---|");
    for counts in [16384, 2048] {
        let best = all(counts).map(|found| {
            let best = found.into_iter().max_by(|a, b| a.usable().total_cmp(&b.usable()));
            let best = best.expect("several sizes");
            println!(
                "| {} x 4 | {} | {:.1} | {:.1} | {:.0} | {:.0} | {:.0} |",
                counts / 4,
                best.name,
                1e5 * best.noise,
                1e3 * best.lag,
                best.free,
                best.hand,
                best.usable()
            );
            best
        });
        let [kalman, levant, observer] = best;
        // Both searches have steps of 4 %.
        for other in [&levant, &observer] {
            assert!(other.usable() < 1.08 * kalman.usable(), "{other:?}, {kalman:?}");
        }
        assert!(observer.free > kalman.free && observer.hand < kalman.hand, "{observer:?}, {kalman:?}");
    }
}
