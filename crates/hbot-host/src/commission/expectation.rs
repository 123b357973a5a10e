//! Measures in a fraction of a second what a rig's methods cost on this machine and how large their
//! error is, for a program that starts.
//!
//! The rig's own controller follows 10 s of brisk motion from the readings that its encoders would
//! give. This is done once with each choice of methods, in turns, so that a temporary slowdown of
//! the machine affects all choices. The error therefore includes method, path, counts and rates.
//!
//! At high rates 10 s are more than 20,000 ticks. Then only 20,000 ticks are followed, and the
//! error is that of this shorter time. It cannot be extrapolated to 10 s, because the error of a
//! method grows with time and that of counts does not.

use std::time::Instant;

use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::{Methods, OdometryMethod, PathFit, Rig, RigParts, Zero};
use hbot_core::inputs::{Inputs, JointReadings};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, Quat, rotation};
use hbot_sim::motion::{LEAD, MOTIONS, TrueMotion};

/// The test motion for which errors are measured: brisk, without reversals of its direction.
const MOTION: TrueMotion = MOTIONS[1];
/// Duration of the test motion, ns.
const TIME_NS: u64 = 10_000_000_000;
/// Largest number of ticks that are simulated when a program starts, so that the start is not
/// delayed for long.
const TICKS: u64 = 20_000;
/// Number of ticks whose computing time is measured in one piece.
const CHUNK: usize = 200;
/// Largest ratio of two computing times that count as equal.
const SAME: f64 = 1.05;

/// The measured computing time and error of one choice of methods for computing the sphere's
/// orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expectation {
    /// Method by which the sphere's orientation is integrated.
    pub odometry: OdometryMethod,
    /// Shape of the joints' path that is assumed between two readings.
    pub path: PathFit,
    /// Median computing time from encoder counts to orientation and rates, ns per tick. The time
    /// for a scene is not included.
    pub ns: f64,
    /// Largest error of the computed orientation in the test motion, rad, caused by method, path
    /// and encoder counts together. It is infinite if a joint turns by half a turn or more in one
    /// tick, because its counts are then ambiguous.
    pub error: f64,
    /// Duration of the test motion that was followed, s.
    pub time_s: f64,
}

impl Expectation {
    /// Returns the names of the odometry method and of the path, as rig files spell them.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}, {}", self.odometry.name(), self.path.name())
    }

    /// Returns a description of the test motion in words.
    #[must_use]
    pub fn motion(&self) -> String {
        format!("{} s of a test motion ({} rad/s)", three_digits(self.time_s), MOTION.speed)
    }

    /// Returns `methods` with the odometry method and the path of this choice.
    #[must_use]
    pub fn chosen(&self, methods: &Methods) -> Methods {
        Methods { odometry: self.odometry, path: self.path, ..*methods }
    }
}

/// Rounds a positive number to three significant digits.
fn three_digits(value: f64) -> f64 {
    let scale = 10.0_f64.powi(2 - value.log10().floor() as i32);
    (value * scale).round() / scale
}

/// Measures the computing time and the orientation error of `rig` with the methods of its rig file,
/// over 10 s or 20,000 ticks of the test motion, whichever is shorter.
#[must_use]
pub fn of(rig: &Rig) -> Expectation {
    let own = (rig.methods.odometry, rig.methods.path);
    measured(rig, &[own], TIME_NS.min(TICKS * rig.timing.period_ns))[0]
}

/// Measures the computing time and the orientation error over 10 s of the test motion, for every
/// choice of odometry method and path that makes a difference. The results are ordered by method,
/// and then by path.
#[must_use]
pub fn of_all(rig: &Rig) -> Vec<Expectation> {
    let each = |method: OdometryMethod| {
        // The Euler method uses only the last reading, so all paths give equal results.
        let paths = if method == OdometryMethod::Euler { &PathFit::ALL[..1] } else { &PathFit::ALL };
        paths.iter().map(move |path| (method, *path))
    };
    measured(rig, &OdometryMethod::ALL.into_iter().flat_map(each).collect::<Vec<_>>(), TIME_NS)
}

/// Returns the cheapest methods for `rig` whose orientation error is at most `target`, rad, in 10 s
/// of the test motion. Among methods whose cost is equal to within 5 %, it returns the most
/// accurate.
///
/// # Errors
/// If no methods meet the target, returns the most accurate ones as the error.
pub fn cheapest(rig: &Rig, target: f64) -> Result<Expectation, Expectation> {
    pick(&of_all(rig), target)
}

fn pick(all: &[Expectation], target: f64) -> Result<Expectation, Expectation> {
    let best =
        |of: &mut dyn Iterator<Item = &Expectation>| of.min_by(|a, b| a.error.total_cmp(&b.error)).copied();
    let good = || all.iter().filter(|choice| choice.error <= target);
    let least = good().map(|choice| choice.ns).fold(f64::INFINITY, f64::min);
    match best(&mut good().filter(|choice| choice.ns <= SAME * least)) {
        Some(choice) => Ok(choice),
        None => Err(best(&mut all.iter()).unwrap_or_else(|| unreachable!("there are methods"))),
    }
}

/// One choice of methods and its results, while it is measured.
struct Run {
    controller: Controller,
    /// Computed and true orientation at the first reading that is compared.
    zero: Option<[Quat; 2]>,
    error: f64,
    /// Computing time of each chunk of ticks, ns per tick.
    samples: Vec<f64>,
    /// The orientations that were computed in the most recent chunk of ticks.
    q: Vec<Quat>,
}

fn measured(rig: &Rig, choices: &[(OdometryMethod, PathFit)], time_ns: u64) -> Vec<Expectation> {
    match rig.device.wheels().len() {
        2 => follow::<8>(rig, choices, time_ns),
        3 => follow::<10>(rig, choices, time_ns),
        4 => follow::<12>(rig, choices, time_ns),
        5 => follow::<14>(rig, choices, time_ns),
        6 => follow::<16>(rig, choices, time_ns),
        7 => follow::<18>(rig, choices, time_ns),
        _ => follow::<20>(rig, choices, time_ns),
    }
}

/// Computes the orientation in the test motion with each of `choices`, and measures time and error.
/// `N` is the number of joints plus four, for the four numbers of the orientation.
fn follow<const N: usize>(
    rig: &Rig,
    choices: &[(OdometryMethod, PathFit)],
    time_ns: u64,
) -> Vec<Expectation> {
    // Zeros are assumed to be known: only the turns of the wheels matter here.
    let assume = |parts: &mut RigParts| parts.joints.iter_mut().for_each(|joint| joint.zero = Zero::Assume);
    let rig = rig.with(assume).unwrap_or(*rig);
    let mut runs: Vec<Run> = choices.iter().map(|choice| Run::new(rig, *choice)).collect();
    let period = rig.timing.period_ns;
    let h = period as f64 * 1.0e-9;
    let ticks = time_ns.div_ceil(period) as usize + LEAD;
    let mut course = MOTION.course::<N>(&rig.device, 0.0, h);
    let mut last: Option<[f64; N]> = None;
    let mut done = 0;
    while done < ticks {
        let chunk: Vec<[f64; N]> = course.by_ref().take(CHUNK.min(ticks - done)).collect();
        for y in &chunk {
            let told = last.is_none_or(|last| (4..N).all(|j| (y[j] - last[j]).abs() < core::f64::consts::PI));
            if !told {
                return expectations(choices, time_ns, runs.iter().map(|run| (run, f64::INFINITY)));
            }
            last = Some(*y);
        }
        let readings: Vec<Inputs> =
            chunk.iter().enumerate().map(|(k, y)| reading(&rig, done + k, h, y)).collect();
        for run in &mut runs {
            run.take(&readings);
            run.judge(done, &chunk);
        }
        done += chunk.len();
    }
    expectations(choices, time_ns, runs.iter().map(|run| (run, run.error)))
}

fn expectations<'a>(
    choices: &[(OdometryMethod, PathFit)],
    time_ns: u64,
    runs: impl Iterator<Item = (&'a Run, f64)>,
) -> Vec<Expectation> {
    let each = |((odometry, path), (run, error)): (&(OdometryMethod, PathFit), (&Run, f64))| {
        let mut samples = run.samples.clone();
        samples.sort_by(f64::total_cmp);
        let ns = samples.get(samples.len() / 2).copied().unwrap_or(f64::NAN);
        Expectation { odometry: *odometry, path: *path, ns, error, time_s: time_ns as f64 * 1.0e-9 }
    };
    choices.iter().zip(runs).map(each).collect()
}

/// Returns the inputs of the control law in tick `tick`, with the readings that the motor
/// controllers of `rig` would send. `h` is the period, s, and `y` holds the true orientation and
/// joint angles.
fn reading<const N: usize>(rig: &Rig, tick: usize, h: f64, y: &[f64; N]) -> Inputs {
    let n = rig.device.joints();
    let th: Vec<f64> = (0..n / 2).map(|i| y[4 + 2 * i]).collect();
    let mut rates = Posture::new(&rig.device, &th).inverse(MOTION.omega(tick as f64 * h));
    let mut counts = [0; MAX_JOINTS];
    for j in 0..n {
        let joint = &rig.joints[j];
        // Counts wrap at 32 bits, as those of the controllers do.
        counts[j] = (y[4 + j] / joint.radians_per_count()).round() as i64 as i32;
        rates[j] = if joint.reversed { -rates[j] } else { rates[j] };
    }
    let feedback = JointReadings::new(tick as u32, counts, rates);
    Inputs { feedback: Some(feedback), ..Inputs::quiet(tick as u64) }
}

impl Run {
    fn new(rig: Rig, (odometry, path): (OdometryMethod, PathFit)) -> Self {
        // This cannot fail: every rig is legal with every choice of methods.
        let chosen = rig.with(|parts| (parts.methods.odometry, parts.methods.path) = (odometry, path));
        let controller = Controller::new(chosen.unwrap_or(rig));
        Self { controller, zero: None, error: 0.0, samples: Vec::new(), q: Vec::with_capacity(CHUNK) }
    }

    /// Runs the control law on the readings of one chunk of ticks, and measures the computing time
    /// per tick.
    fn take(&mut self, readings: &[Inputs]) {
        let scene = CompiledScene::empty();
        self.q.clear();
        let start = Instant::now();
        for inputs in readings {
            self.q.push(self.controller.tick(&scene, inputs).state.q);
        }
        self.samples.push(start.elapsed().as_secs_f64() * 1.0e9 / readings.len() as f64);
    }

    /// Compares the orientations computed in one chunk of ticks with the true ones, and keeps the
    /// largest error. The comparison starts at the first reading that has as many readings before
    /// it as a path needs.
    fn judge<const N: usize>(&mut self, done: usize, truth: &[[f64; N]]) {
        for (k, (q, y)) in self.q.iter().zip(truth).enumerate() {
            let truth = Quat::from_xyzw(y[1], y[2], y[3], y[0]);
            if done + k < LEAD {
                continue;
            }
            let [q0, truth0] = *self.zero.get_or_insert([*q, truth]);
            // Both are turns in frame N since the start of the comparison: earlier turns are on the
            // right and cancel.
            let off = rotation::angle_between(*q * q0.conjugate(), truth * truth0.conjugate());
            self.error = self.error.max(off);
        }
    }
}

#[cfg(test)]
mod tests;
