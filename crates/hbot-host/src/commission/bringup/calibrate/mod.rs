//! Finds signs, steering zeros, wheel radii and cone angles by comparing the joints with each
//! other.
//!
//! If the sphere turns without slip, its three speeds determine the rates of all 2n joints. The
//! encoders then show zero slip only if the rig is as its file states. First all signs are tried
//! with zeros on a grid, wheel by wheel (`search`). Then zeros, radii and cones are fitted together
//! (`fit`). If this leaves slip unexplained, the wiring can be wrong (`wiring`).

mod fit;
mod search;
mod wiring;

use hbot_core::Rig;
use hbot_core::design::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::design::kinematics::Posture;

pub use wiring::{exchanged, explains, still};

/// Standard deviation below which a steering zero counts as determined, rad.
const KNOWN: f64 = 0.05;
/// Number of fitted parameters per wheel: steering zero, logarithm of the radius divided by that of
/// the rig file, and cone angle.
const PARAMETERS: usize = 3;

/// The encoder counts of all joints at one moment, in the order of the rig and with the sign of
/// their motor controllers.
pub type Counts = [i32; MAX_JOINTS];

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
    /// the calibration found.
    pub after: f64,
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

/// One possible set of signs and wheel parameters that could explain the readings.
#[derive(Clone, Copy)]
struct Guess {
    flipped: [bool; MAX_JOINTS],
    wheels: [[f64; PARAMETERS]; MAX_WHEELS],
}

/// Returns the angle wrapped to the range from -pi to pi, rad.
fn within(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

struct Fit<'a> {
    rig: &'a Rig,
    steps: Vec<Step>,
    /// Root mean square distance that the wheels roll in one step, m.
    rolled: f64,
}

/// Finds the signs, steering zeros, wheel radii and cone angles that explain the encoder counts
/// best. Returns `None` if the drive joints have not moved.
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
        // This is about one count of each drive joint per step.
        (rolled > 1.0e-6).then_some(Self { rig, steps, rolled })
    }

    fn as_filed(&self) -> Guess {
        let mut guess = Guess { flipped: [false; MAX_JOINTS], wheels: [[0.0; PARAMETERS]; MAX_WHEELS] };
        for (wheel, filed) in guess.wheels.iter_mut().zip(self.rig.device.wheels()) {
            *wheel = [0.0, 0.0, filed.spec().cone];
        }
        guess
    }

    /// Returns the rig's geometry with the radii and cone angles of `guess`, reduced to the first
    /// `count` wheels. Returns `None` if these values are not a valid geometry.
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

    /// Appends to `out` the slip that `guess` leaves at each wheel of `device`, divided by the
    /// rolling distance. Only every `every`th step is used.
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

    /// Returns the root mean square slip that `guess` leaves, divided by the rolling distance. It
    /// is infinite if the guess is not a valid geometry.
    fn share(&self, guess: &Guess) -> f64 {
        let Some(device) = self.device(guess, self.rig.device.wheels().len()) else { return f64::INFINITY };
        let mut slips = Vec::new();
        self.slips(guess, &device, 1, &mut slips);
        (slips.iter().map(|s| s * s).sum::<f64>() / self.steps.len() as f64).sqrt()
    }
}
