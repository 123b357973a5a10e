//! Signs and steering zeros that are wrong by any amount: the first look at a rig.
//!
//! First all signs are tried with zeros on a grid, wheel by wheel (`search`). From the best guess
//! on, zeros, radii and cones are fitted as for the whole geometry ([`mod@crate::fit`]). If this
//! leaves slip unexplained, the wiring can be wrong (`wiring`).

mod search;
mod wiring;

use hbot_core::Rig;
use hbot_core::design::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::design::kinematics::Posture;

pub use wiring::{exchanged, explains, still};

use crate::fit::{Begin, Free, fit, share_as_drawn};
use crate::motion::{Counts, Motion};
use crate::parameter::{OF_WHEEL, count};

/// Standard deviation below which a steering zero counts as determined, rad.
const KNOWN: f64 = 0.05;
/// Time between two readings that the search compares, s. It is long enough that one count is small
/// relative to the motion, and short enough that the steer angles hardly change.
const APART_S: f64 = 0.02;
/// Largest number of readings to which zeros, radii and cones are fitted. If there are more, some
/// are left out.
const MOST_READINGS: usize = 10_000;
/// Places of a wheel's unknowns in the fit.
const ZERO: usize = 2;
const CONE: usize = 3;
const RADIUS: usize = 5;

/// The result of a calibration: the values found for the wheels, and how well they explain the
/// readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The values that the calibration found for each wheel.
    pub wheels: Vec<WheelFound>,
    /// Root mean square slip of the wheels divided by their rolling distance, with the values of
    /// the rig file.
    pub before: f64,
    /// Root mean square slip of the wheels divided by their rolling distance, with the values that
    /// the calibration found, where the motion fits to them.
    pub after: f64,
    /// Fraction of the motion that does not fit to them.
    pub left_out: f64,
    /// True if the motion was sufficient to determine the steering zeros of all wheels.
    pub known: bool,
}

/// The values that a calibration found for one wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelFound {
    /// For the steer joint and the drive joint: true if the sign in the rig file is wrong.
    pub wrong_sign: [bool; 2],
    /// True steer angle of the wheel where the rig file assumes its zero, rad, from -pi to pi. It
    /// is the error of the zero in the rig file.
    pub zero: f64,
    /// Standard deviation of `zero`, rad.
    pub zero_deviation: f64,
    /// Radius of the wheel, m.
    pub radius: f64,
    /// Cone angle of the wheel, rad.
    pub cone: f64,
}

/// The motion of all joints between two consecutive readings, computed with the values of the rig
/// file.
struct Step {
    /// Steer angle of each wheel in the middle of the step, rad.
    angle: [f64; MAX_WHEELS],
    /// Turn of each joint during the step, rad.
    turn: [f64; MAX_JOINTS],
}

/// Signs and steering zeros that could explain the readings.
#[derive(Clone, Copy)]
struct Guess {
    flipped: [bool; MAX_JOINTS],
    /// True steer angle where the rig file assumes the zero, rad.
    zeros: [f64; MAX_WHEELS],
}

/// Returns the angle wrapped to the range from -pi to pi, rad.
fn within(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// What the search for signs and zeros compares.
struct Search<'a> {
    rig: &'a Rig,
    steps: Vec<Step>,
    /// Root mean square distance that the wheels roll in one step, m.
    rolled: f64,
}

/// Finds the signs, steering zeros, wheel radii and cone angles that explain the encoder counts
/// best. `counts` has a reading for each period of the rig. Returns `None` if the drive joints have
/// not moved.
#[must_use]
pub fn calibrate(rig: &Rig, counts: &[Counts]) -> Option<Calibration> {
    let guess = Search::new(rig, counts)?.coarse();
    // If the rig file is wrong, the fit takes its largest number of improvements.
    let every = counts.len().div_ceil(MOST_READINGS);
    let motion = |counts: Vec<Counts>| {
        let counts = counts.into_iter().step_by(every).collect();
        Motion::new(rig, &[counts], every as f64 * rig.timing.period_s())
    };
    let n = rig.device.wheels().len();
    let mut from = vec![0.0; count(n)];
    (0..n).for_each(|i| from[OF_WHEEL * i + ZERO] = within(guess.zeros[i]));
    let signed =
        |now: &Counts| std::array::from_fn(|j| if guess.flipped[j] { now[j].wrapping_neg() } else { now[j] });
    let begin = Begin { from: Some(&from), zero: std::f64::consts::PI };
    let turned = motion(counts.iter().map(signed).collect());
    let fitted = fit(rig, &turned, Free::ZerosConesAndRadii, begin, &mut |_, _| ())?;
    let wheels: Vec<WheelFound> = (0..n)
        .map(|i| {
            let of = &fitted.unknowns[OF_WHEEL * i..OF_WHEEL * (i + 1)];
            let (zero, drawn) = (OF_WHEEL * i + ZERO, rig.device.wheels()[i].spec());
            WheelFound {
                wrong_sign: [guess.flipped[2 * i], guess.flipped[2 * i + 1]],
                zero: within(of[ZERO]),
                zero_deviation: fitted.covariance[zero][zero].max(0.0).sqrt().max(fitted.relative[zero]),
                radius: drawn.radius * of[RADIUS].exp(),
                cone: drawn.cone + of[CONE],
            }
        })
        .collect();
    let known = wheels.iter().all(|wheel| wheel.zero_deviation < KNOWN);
    let before = share_as_drawn(rig, &motion(counts.to_vec()));
    Some(Calibration { wheels, before, after: fitted.share, left_out: fitted.left_out, known })
}

impl<'a> Search<'a> {
    fn new(rig: &'a Rig, counts: &[Counts]) -> Option<Self> {
        let joints = rig.device.joints();
        let radians: Vec<f64> = rig.joints[..joints].iter().map(|joint| joint.radians_per_count()).collect();
        let every = (APART_S / rig.timing.period_s()).round().max(1.0) as usize;
        let apart: Vec<&Counts> = counts.iter().step_by(every).collect();
        let steps: Vec<Step> = apart
            .windows(2)
            .map(|pair| {
                let mut step = Step { angle: [0.0; MAX_WHEELS], turn: [0.0; MAX_JOINTS] };
                for j in 0..joints {
                    let moved = pair[1][j].wrapping_sub(pair[0][j]);
                    step.turn[j] = f64::from(moved) * radians[j];
                    if j % 2 == 0 {
                        step.angle[j / 2] = (f64::from(pair[0][j]) + 0.5 * f64::from(moved)) * radians[j];
                    }
                }
                step
            })
            .collect();
        let wheels = rig.device.wheels();
        let rolled: f64 = steps
            .iter()
            .flat_map(|step| wheels.iter().enumerate().map(|(i, w)| w.spec().radius * step.turn[2 * i + 1]))
            .map(|x| x * x)
            .sum();
        let rolled = (rolled / steps.len().max(1) as f64).sqrt();
        // This is about one count of each drive joint per step.
        (rolled > 1.0e-6).then_some(Self { rig, steps, rolled })
    }

    /// Returns the rig's geometry, reduced to the first `count` wheels.
    fn device(&self, count: usize) -> Option<Device> {
        let filed = &self.rig.device;
        let specs: Vec<_> = filed.wheels()[..count].iter().map(|wheel| *wheel.spec()).collect();
        Device::new(filed.sphere_radius(), filed.sphere_mass(), &specs).ok()
    }

    /// Returns the sum of the squares of the slips that `guess` leaves at the wheels of `device`,
    /// divided by the square of the rolling distance. Only every `every`th step is used.
    fn cost(&self, guess: &Guess, device: &Device, every: usize) -> f64 {
        let count = device.wheels().len();
        let mut sum = 0.0;
        for step in self.steps.iter().step_by(every.max(1)) {
            let (mut angle, mut turn) = ([0.0; MAX_WHEELS], [0.0; MAX_JOINTS]);
            for i in 0..count {
                let sign = |j: usize| if guess.flipped[j] { -1.0 } else { 1.0 };
                angle[i] = sign(2 * i) * step.angle[i] + guess.zeros[i];
                turn[2 * i] = sign(2 * i) * step.turn[2 * i];
                turn[2 * i + 1] = sign(2 * i + 1) * step.turn[2 * i + 1];
            }
            let forward = Posture::new(device, &angle[..count]).forward(device, &turn);
            sum +=
                forward.slip[..count].iter().flatten().map(|slip| (slip / self.rolled).powi(2)).sum::<f64>();
        }
        sum
    }

    /// Returns the cost of `guess` for all wheels and steps.
    fn whole_cost(&self, guess: &Guess) -> f64 {
        self.cost(guess, &self.rig.device, 1)
    }
}
