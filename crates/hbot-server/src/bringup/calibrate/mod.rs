//! Signs, steering zeros, wheel radii and cone angles from what the joints say of each other.
//!
//! A sphere that turns without slip moves 2n joints by 3 numbers: what is left over, the slip that the encoders see, is zero only where
//! the rig is as its file says. First all signs are tried with zeros on a grid, wheel by wheel; then zeros, radii and cones are
//! fitted together by damped least squares (Levenberg and Marquardt), in which radii and cones are held to
//! what the file says as loosely as a caliper knows them.

use hbot_core::Rig;
use hbot_core::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::kinematics::Posture;

/// Zeros tried on a turn.
const GRID: usize = 36;
/// Steps used to find signs and zeros; all are used for the fit.
const COARSE: usize = 60;
/// How well a step is known, as a share of how far wheels roll in the root mean square.
const STEP: f64 = 0.01;
/// How well the file knows radii (share) and cones (rad).
const RADIUS: f64 = 0.05;
const CONE: f64 = 0.05;
/// Of each set of signs so many zeros are looked at closely, so far apart, rad.
const LOOKED_AT: usize = 6;
const APART: f64 = 0.4;
/// A zero that is off by less is called right where explanations are weighed, rad.
const RIGHT: f64 = 0.02;
/// An explanation in which less is wrong is believed unless another leaves less than this share of its residual.
const BELIEVED: f64 = 0.3;
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

impl Guess {
    /// How much of the file it calls wrong: signs, zeros, and a little for how far off a zero is, since nobody overlooks half a
    /// turn. Where wheels stand opposite each other, a steering sign and another wheel's zero off by half a turn look the same.
    fn wrong(&self, count: usize) -> f64 {
        let flips = self.flipped.iter().filter(|flipped| **flipped).count() as f64;
        let zeros = self.wheels[..count].iter().map(|wheel| {
            let off = within(wheel[0]).abs();
            if off < RIGHT { 0.0 } else { 1.0 + 0.1 * off }
        });
        flips + zeros.sum::<f64>()
    }
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
        let radians: Vec<f64> = rig.joints[..joints]
            .iter()
            .map(|j| {
                let turn = std::f64::consts::TAU / (f64::from(j.counts_per_turn) * j.gear);
                if j.reversed { -turn } else { turn }
            })
            .collect();
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

    /// Signs and rough zeros: of the first two wheels together, then of each further one beside those before it.
    fn coarse(&self) -> Guess {
        let mut found = self.as_filed();
        let first: Vec<Guess> =
            self.variants(&found, 0).flat_map(|guess| self.variants(&guess, 1).collect::<Vec<_>>()).collect();
        found = self.best(&found, first, 2);
        for wheel in 2..self.rig.device.wheels().len() {
            found = self.best(&found, self.variants(&found, wheel).collect(), wheel + 1);
        }
        found
    }

    /// A guess with all signs and zeros of one wheel.
    fn variants<'b>(&'b self, guess: &Guess, wheel: usize) -> impl Iterator<Item = Guess> + 'b {
        let guess = *guess;
        (0..4 * GRID).map(move |k| {
            let mut other = guess;
            (other.flipped[2 * wheel], other.flipped[2 * wheel + 1]) = (k & 1 != 0, k & 2 != 0);
            other.wheels[wheel][0] = std::f64::consts::TAU * (k / 4) as f64 / GRID as f64;
            other
        })
    }

    /// The likeliest of several guesses about the first `count` wheels. Of each set of signs the best zeros, some way apart from each
    /// other, are looked at more closely; of all that explain what was seen the one is taken in which least is wrong.
    fn best(&self, filed: &Guess, guesses: Vec<Guess>, count: usize) -> Guess {
        let Some(device) = self.device(filed, count) else { return *filed };
        let every = self.steps.len().div_ceil(COARSE);
        let mut slips = Vec::new();
        let mut cost = |guess: &Guess| {
            slips.clear();
            self.slips(guess, &device, every, &mut slips);
            slips.iter().map(|s| s * s).sum::<f64>()
        };
        let mut costed: Vec<(f64, Guess)> = guesses.into_iter().map(|guess| (cost(&guess), guess)).collect();
        costed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut closer: Vec<(f64, Guess)> = Vec::new();
        for (c, guess) in costed {
            let alike = |other: &&(f64, Guess)| other.1.flipped == guess.flipped;
            let near = |other: &(f64, Guess)| {
                (0..count).all(|i| within(other.1.wheels[i][0] - guess.wheels[i][0]).abs() < APART)
            };
            if closer.iter().filter(alike).count() < LOOKED_AT && !closer.iter().filter(alike).any(near) {
                closer.push((c, guess));
            }
        }
        for (c, guess) in &mut closer {
            let mut step = std::f64::consts::TAU / GRID as f64;
            while step > 1.0e-4 {
                step *= 0.5;
                for wheel in 0..count {
                    for way in [-step, step] {
                        let mut other = *guess;
                        other.wheels[wheel][0] += way;
                        let d = cost(&other);
                        if d < *c {
                            (*c, *guess) = (d, other);
                        }
                    }
                }
            }
        }
        let least = closer.iter().map(|(c, _)| *c).fold(f64::INFINITY, f64::min);
        closer
            .into_iter()
            .filter(|(c, _)| *c <= least / (BELIEVED * BELIEVED))
            .min_by(|a, b| a.1.wrong(count).total_cmp(&b.1.wrong(count)))
            .map_or(*filed, |(_, guess)| guess)
    }

    /// Residuals of the fit, in standard deviations: slips, and how far radii and cones are from the file.
    fn residuals(&self, guess: &Guess) -> Option<Vec<f64>> {
        let n = self.rig.device.wheels().len();
        let device = self.device(guess, n)?;
        let mut all = Vec::new();
        self.slips(guess, &device, 1, &mut all);
        all.iter_mut().for_each(|slip| *slip /= STEP);
        for (i, [_, scale, cone]) in guess.wheels[..n].iter().enumerate() {
            all.push(scale / RADIUS);
            all.push((cone - self.rig.device.wheels()[i].spec().cone) / CONE);
        }
        Some(all)
    }

    /// Fits zeros, radii and cones; gives each zero's standard deviation.
    fn refine(&self, guess: &mut Guess) -> Vec<f64> {
        const H: f64 = 1.0e-5;
        let n = self.rig.device.wheels().len();
        let size = PARAMETERS * n;
        let (mut damping, mut deviations) = (1.0e-3, vec![f64::INFINITY; n]);
        let square = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>();
        for _ in 0..60 {
            let Some(here) = self.residuals(guess) else { return deviations };
            let mut columns = Vec::with_capacity(size);
            for k in 0..size {
                let (mut up, mut down) = (*guess, *guess);
                up.wheels[k / PARAMETERS][k % PARAMETERS] += H;
                down.wheels[k / PARAMETERS][k % PARAMETERS] -= H;
                let (Some(up), Some(down)) = (self.residuals(&up), self.residuals(&down)) else {
                    return deviations;
                };
                columns.push(up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * H)).collect::<Vec<_>>());
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let normal: Vec<Vec<f64>> =
                columns.iter().map(|a| columns.iter().map(|b| dot(a, b)).collect()).collect();
            let slope: Vec<f64> = columns.iter().map(|a| -dot(a, &here)).collect();
            for (i, deviation) in deviations.iter_mut().enumerate() {
                let mut unit = vec![0.0; size];
                unit[PARAMETERS * i] = 1.0;
                *deviation =
                    solve(&normal, &unit, 0.0).map_or(f64::INFINITY, |x| x[PARAMETERS * i].max(0.0).sqrt());
            }
            let Some(step) = solve(&normal, &slope, damping) else { return deviations };
            let mut next = *guess;
            for (k, step) in step.iter().enumerate() {
                next.wheels[k / PARAMETERS][k % PARAMETERS] += step;
            }
            match self.residuals(&next) {
                Some(there) if square(&there) <= square(&here) => {
                    *guess = next;
                    damping = (damping * 0.2).max(1.0e-12);
                    if step.iter().all(|x| x.abs() < 1.0e-9) {
                        return deviations;
                    }
                }
                _ if damping > 1.0e9 => return deviations,
                _ => damping *= 5.0,
            }
        }
        deviations
    }
}

/// Solves a symmetric positive system, its diagonal made larger by a share, by elimination.
fn solve(matrix: &[Vec<f64>], right: &[f64], damping: f64) -> Option<Vec<f64>> {
    let n = right.len();
    let mut rows: Vec<Vec<f64>> = matrix
        .iter()
        .enumerate()
        .map(|(i, row)| {
            let mut row = row.clone();
            row[i] *= 1.0 + damping;
            row.push(right[i]);
            row
        })
        .collect();
    for k in 0..n {
        // Positive definite: the diagonal is a good pivot, and one that is not positive says that it was not.
        if !(rows[k][k] > 1.0e-12 * matrix[k][k].max(f64::MIN_POSITIVE)) {
            return None;
        }
        for i in k + 1..n {
            let factor = rows[i][k] / rows[k][k];
            for j in k..=n {
                rows[i][j] -= factor * rows[k][j];
            }
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (rows[k][n] - known) / rows[k][k];
    }
    Some(x)
}
