//! Signs, steering zeros, wheel radii and cone angles from what the joints say of each other.
//!
//! A sphere that turns without slip moves 2n joints by 3 numbers: what is left over, the slip that the encoders see, is zero only where
//! the rig is as its file says. First all signs are tried with zeros on a grid, wheel by wheel (`search`); then zeros, radii and cones
//! are fitted together (`fit`). What that cannot explain may be wired otherwise (`wiring`).

mod fit;
mod search;
mod wiring;

use hbot_core::Rig;
use hbot_core::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::kinematics::Posture;

pub use wiring::{exchanged, explains, still};

/// Zeros known worse than this are not known, rad.
const KNOWN: f64 = 0.05;
/// Of one wheel: zero, logarithm of the radius, cone.
const PARAMETERS: usize = 3;

/// The counts of all joints at one moment, in the order of the rig, in the controllers' own sense.
pub type Counts = [i32; MAX_JOINTS];

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// One a wheel.
    pub wheels: Vec<WheelFound>,
    /// Slip over rolling as the file has the rig, root mean square.
    pub before: f64,
    /// The same as found.
    pub after: f64,
    /// The zeros are told by the motion well enough to be believed.
    pub known: bool,
}

/// What was found of one wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelFound {
    /// The file's sign of steer and drive is wrong.
    pub wrong_sign: [bool; 2],
    /// The steering angle where the file has it zero, rad, -pi to pi.
    pub zero: f64,
    /// How well that is known (one standard deviation), rad.
    pub zero_deviation: f64,
    /// Wheel radius, m.
    pub radius: f64,
    /// Cone angle, rad.
    pub cone: f64,
}

/// One step of all joints, as the file has them.
struct Step {
    /// Steering angles in the middle of it, rad.
    angle: [f64; MAX_WHEELS],
    /// Turns, rad.
    turn: [f64; MAX_JOINTS],
}

/// One explanation of what was seen.
#[derive(Clone, Copy)]
struct Guess {
    flipped: [bool; MAX_JOINTS],
    wheels: [[f64; PARAMETERS]; MAX_WHEELS],
}

/// An angle as one from -pi to pi.
fn within(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

struct Fit<'a> {
    rig: &'a Rig,
    steps: Vec<Step>,
    /// Root mean square of how far the wheels roll in a step, m.
    rolled: f64,
}

/// Finds what explains the counts best. `None` where nothing has moved.
#[must_use]
pub fn calibrate(rig: &Rig, counts: &[Counts]) -> Option<Calibration> {
    let fit = Fit::new(rig, counts)?;
    let file = fit.as_filed();
    let before = fit.share(&file);
    let mut guess = fit.coarse();
    let deviations = fit.refine(&mut guess);
    let n = rig.device.wheels().len();
    let wheels: Vec<WheelFound> = (0..n)
        .map(|i| {
            let [zero, scale, cone] = guess.wheels[i];
            WheelFound {
                wrong_sign: [guess.flipped[2 * i], guess.flipped[2 * i + 1]],
                zero: within(zero),
                zero_deviation: deviations[i],
                radius: rig.device.wheels()[i].spec().radius * scale.exp(),
                cone,
            }
        })
        .collect();
    let known = wheels.iter().all(|wheel| wheel.zero_deviation < KNOWN);
    Some(Calibration { wheels, before, after: fit.share(&guess), known })
}

impl<'a> Fit<'a> {
    fn new(rig: &'a Rig, counts: &[Counts]) -> Option<Self> {
        let joints = rig.device.joints();
        let radians: Vec<f64> = rig.joints[..joints].iter().map(|joint| joint.radians_per_count()).collect();
        let steps: Vec<Step> = counts
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
        // A count of each drive joint a step would be as much.
        (rolled > 1.0e-6).then_some(Self { rig, steps, rolled })
    }

    fn as_filed(&self) -> Guess {
        let mut guess = Guess { flipped: [false; MAX_JOINTS], wheels: [[0.0; PARAMETERS]; MAX_WHEELS] };
        for (wheel, filed) in guess.wheels.iter_mut().zip(self.rig.device.wheels()) {
            *wheel = [0.0, 0.0, filed.spec().cone];
        }
        guess
    }

    /// The device of a guess, of its first `count` wheels; `None` where there is none such.
    fn device(&self, guess: &Guess, count: usize) -> Option<Device> {
        let filed = &self.rig.device;
        let specs: Vec<_> = filed.wheels()[..count]
            .iter()
            .zip(&guess.wheels)
            .map(|(wheel, [_, scale, cone])| {
                let mut spec = *wheel.spec();
                (spec.radius, spec.cone) = (spec.radius * scale.exp(), *cone);
                spec
            })
            .collect();
        Device::new(filed.sphere_radius(), filed.sphere_mass(), &specs).ok()
    }

    /// The slip of the first `count` wheels in every `every`th step, as shares of what wheels roll.
    fn slips(&self, guess: &Guess, device: &Device, every: usize, out: &mut Vec<f64>) {
        let count = device.wheels().len();
        for step in self.steps.iter().step_by(every.max(1)) {
            let (mut angle, mut turn) = ([0.0; MAX_WHEELS], [0.0; MAX_JOINTS]);
            for i in 0..count {
                let sign = |j: usize| if guess.flipped[j] { -1.0 } else { 1.0 };
                angle[i] = sign(2 * i) * step.angle[i] + guess.wheels[i][0];
                turn[2 * i] = sign(2 * i) * step.turn[2 * i];
                turn[2 * i + 1] = sign(2 * i + 1) * step.turn[2 * i + 1];
            }
            let forward = Posture::new(device, &angle[..count]).forward(device, &turn);
            out.extend(forward.slip[..count].iter().flatten().map(|slip| slip / self.rolled));
        }
    }

    /// Root mean square of slip over rolling.
    fn share(&self, guess: &Guess) -> f64 {
        let Some(device) = self.device(guess, self.rig.device.wheels().len()) else { return f64::INFINITY };
        let mut slips = Vec::new();
        self.slips(guess, &device, 1, &mut slips);
        (slips.iter().map(|s| s * s).sum::<f64>() / self.steps.len() as f64).sqrt()
    }
}
