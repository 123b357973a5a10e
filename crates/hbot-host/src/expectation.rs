//! What a rig's choice of methods costs on this machine, and what error is to be expected of it: in a fraction of a second, for
//! a program that starts.
//!
//! The rig's own controller follows 10 s of brisk motion by what its encoders would read, once with each choice, in turns: so
//! method, path, counts and rate are all in the error, and a machine that is slow for a while is slow for all. A loop so quick
//! that 10 s are more than 20,000 ticks is followed for so many of them, and its error is that of the time that they take: no
//! rule would make the error of 10 s of it, since a method's grows with the time and that of counts does not.

use std::time::Instant;

use hbot_core::inputs::{Complaints, Inputs, JointFeedback};
use hbot_core::kinematics::Posture;
use hbot_core::rig::{Methods, OdometryMethod, PathFit, Rig, RigParts, Zero};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, Quat, rotation};
use hbot_sim::motion::{LEAD, MOTIONS, TrueMotion};

/// The motion that errors are told of: brisk, ever on.
const MOTION: TrueMotion = MOTIONS[1];
/// How long it is followed, ns.
const TIME_NS: u64 = 10_000_000_000;
/// Ticks that a start may take.
const TICKS: u64 = 20_000;
/// Ticks that are timed together.
const CHUNK: usize = 200;
/// Times that are as good as one another.
const SAME: f64 = 1.05;

/// A choice of methods, what it costs here and what it errs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expectation {
    /// How orientation is integrated.
    pub odometry: OdometryMethod,
    /// The path between two readings.
    pub path: PathFit,
    /// From counts to orientation and rates, ns a tick: the median of many measurements. A scene comes on top.
    pub ns: f64,
    /// The largest error of the orientation in that motion, rad: method, path and counts together. Infinite where a joint
    /// would turn by half a turn and more in a tick, which counts cannot tell.
    pub error: f64,
    /// How long the motion was followed, s.
    pub time_s: f64,
}

impl Expectation {
    /// The methods, as rig files name them.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}, {}", self.odometry.name(), self.path.name())
    }

    /// The motion in words.
    #[must_use]
    pub fn motion(&self) -> String {
        format!("{} s of brisk motion ({} rad/s)", three_digits(self.time_s), MOTION.speed)
    }

    /// `methods` with these in place of their own.
    #[must_use]
    pub fn chosen(&self, methods: &Methods) -> Methods {
        Methods { odometry: self.odometry, path: self.path, ..*methods }
    }
}

/// A positive number to three digits, as text that does not show more of them than it needs.
fn three_digits(value: f64) -> f64 {
    let scale = 10.0_f64.powi(2 - value.log10().floor() as i32);
    (value * scale).round() / scale
}

/// What is to be expected of `rig` with its own methods, in 10 s or in 20,000 ticks, whichever is less.
#[must_use]
pub fn of(rig: &Rig) -> Expectation {
    let own = (rig.methods.odometry, rig.methods.path);
    measured(rig, &[own], TIME_NS.min(TICKS * rig.timing.period_ns))[0]
}

/// The same in 10 s for every choice of odometry and path that makes a difference, in the order of methods and paths.
#[must_use]
pub fn of_all(rig: &Rig) -> Vec<Expectation> {
    let each = |method: OdometryMethod| {
        // Euler takes the frames of the last reading, whatever the path.
        let paths = if method == OdometryMethod::Euler { &PathFit::ALL[..1] } else { &PathFit::ALL };
        paths.iter().map(move |path| (method, *path))
    };
    measured(rig, &OdometryMethod::ALL.into_iter().flat_map(each).collect::<Vec<_>>(), TIME_NS)
}

/// The cheapest methods for `rig` that err by no more than `target` (rad) in 10 s; of those that cost the same to 5 %, the most accurate.
///
/// # Errors
/// With the most accurate there is, where none is as good as that.
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

/// A choice at work.
struct Run {
    controller: Controller,
    /// Orientation and true orientation at the reading from which errors count.
    zero: Option<[Quat; 2]>,
    error: f64,
    /// ns a tick.
    samples: Vec<f64>,
    /// The orientations of the last chunk.
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

/// `N`: four for q, and the joints.
fn follow<const N: usize>(
    rig: &Rig,
    choices: &[(OdometryMethod, PathFit)],
    time_ns: u64,
) -> Vec<Expectation> {
    // Where the wheels stand is not in question, only how far they turn.
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

/// What the controllers of `rig` answer in that tick.
fn reading<const N: usize>(rig: &Rig, tick: usize, h: f64, y: &[f64; N]) -> Inputs {
    let n = rig.device.joints();
    let th: Vec<f64> = (0..n / 2).map(|i| y[4 + 2 * i]).collect();
    let mut rates = Posture::new(&rig.device, &th).inverse(MOTION.omega(tick as f64 * h));
    let mut counts = [0; MAX_JOINTS];
    for j in 0..n {
        let joint = &rig.joints[j];
        // They wrap as the controllers' do.
        counts[j] = (y[4 + j] / joint.radians_per_count()).round() as i64 as i32;
        rates[j] = if joint.reversed { -rates[j] } else { rates[j] };
    }
    let feedback = JointFeedback {
        sequence: tick as u32,
        counts,
        rates,
        index_seen: 0,
        complaints: Complaints::default(),
    };
    Inputs { feedback: Some(feedback), ..Inputs::quiet(tick as u64) }
}

impl Run {
    fn new(rig: Rig, (odometry, path): (OdometryMethod, PathFit)) -> Self {
        // A rig is legal with any of them.
        let chosen = rig.with(|parts| (parts.methods.odometry, parts.methods.path) = (odometry, path));
        let controller = Controller::new(chosen.unwrap_or(rig));
        Self { controller, zero: None, error: 0.0, samples: Vec::new(), q: Vec::with_capacity(CHUNK) }
    }

    /// The ticks of a chunk, timed.
    fn take(&mut self, readings: &[Inputs]) {
        let scene = CompiledScene::empty();
        self.q.clear();
        let start = Instant::now();
        for inputs in readings {
            self.q.push(self.controller.tick(&scene, inputs).state.q);
        }
        self.samples.push(start.elapsed().as_secs_f64() * 1.0e9 / readings.len() as f64);
    }

    /// Holds the orientations against the true ones. They count from the first reading that has as many before it as a path
    /// needs.
    fn judge<const N: usize>(&mut self, done: usize, truth: &[[f64; N]]) {
        for (k, (q, y)) in self.q.iter().zip(truth).enumerate() {
            let truth = Quat::from_xyzw(y[1], y[2], y[3], y[0]);
            if done + k < LEAD {
                continue;
            }
            let [q0, truth0] = *self.zero.get_or_insert([*q, truth]);
            // Turns in N: what came before the zero is to their right.
            let off = rotation::angle_between(*q * q0.conjugate(), truth * truth0.conjugate());
            self.error = self.error.max(off);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(odometry: OdometryMethod, ns: f64, error: f64) -> Expectation {
        Expectation { odometry, path: PathFit::Straight, ns, error, time_s: 10.0 }
    }

    #[test]
    fn the_cheapest_that_is_good_enough() {
        let euler = choice(OdometryMethod::Euler, 100.0, 1e-2);
        let midpoint = choice(OdometryMethod::Midpoint, 104.0, 1e-4);
        let magnus = choice(OdometryMethod::Magnus4, 200.0, 1e-8);
        let all = [euler, midpoint, magnus];
        // As cheap as Euler to 5 %, and better.
        assert_eq!(pick(&all, 1e-1), Ok(midpoint));
        assert_eq!(pick(&all, 1e-6), Ok(magnus));
        assert_eq!(pick(&all, 1e-12), Err(magnus));
        assert_eq!(pick(&[euler, magnus], 1e-1), Ok(euler));
    }

    fn prototype(alter: impl FnOnce(&mut RigParts)) -> Rig {
        hbot_config::RigConfig::prototype().rig.with(alter).unwrap()
    }

    /// With encoders ten thousand times as fine, what is left are the method and the path: each in its place.
    #[test]
    fn fine_encoders_leave_the_methods_error() {
        let error = |odometry, path| {
            let rig = prototype(|parts| {
                // Counts are 32 bits: half a turn a tick is still told.
                parts
                    .joints
                    .iter_mut()
                    .for_each(|joint| (joint.gear, joint.counts_per_turn) = (1.0, 1 << 30));
                (parts.methods.odometry, parts.methods.path) = (odometry, path);
            });
            of(&rig).error
        };
        let euler = error(OdometryMethod::Euler, PathFit::Straight);
        let midpoint = error(OdometryMethod::Midpoint, PathFit::Straight);
        let quadratic = error(OdometryMethod::Magnus4, PathFit::Quadratic);
        let cubic = error(OdometryMethod::Magnus4, PathFit::Cubic);
        assert!(euler > 100.0 * midpoint && midpoint > 10.0 * quadratic && quadratic > 3.0 * cubic);
    }

    #[test]
    fn a_loop_too_slow_for_the_motion_is_told() {
        // Steering turns with 20 rad/s and more.
        let rig = prototype(|parts| parts.timing.period_ns = 400_000_000);
        assert_eq!(of(&rig).error, f64::INFINITY);
    }

    /// However quick the loop, a server that starts follows so many ticks, and says the time that they are; whoever asks for a
    /// target is told of 10 s.
    #[test]
    fn a_quick_loop_is_followed_for_a_shorter_time() {
        let at = |hz: u64| of(&prototype(|parts| parts.timing.period_ns = 1_000_000_000 / hz));
        for (hz, time_s, words) in
            [(1000, 10.0, "10 s"), (2000, 10.0, "10 s"), (8000, 2.5, "2.5 s"), (20_000, 1.0, "1 s")]
        {
            let expected = at(hz);
            assert_eq!(expected.time_s, time_s, "{hz} Hz");
            assert_eq!(expected.motion(), format!("{words} of brisk motion (3 rad/s)"));
            assert!(expected.error > 0.0 && expected.error < 1.0e-3, "{hz} Hz: {expected:?}");
        }
        let rig = prototype(|parts| parts.timing.period_ns = 250_000);
        let whole = measured(&rig, &[(rig.methods.odometry, rig.methods.path)], TIME_NS)[0];
        // The largest of a part is not above the largest of the whole, which begins with it.
        assert!(of(&rig).time_s == 5.0 && of(&rig).error <= whole.error);
    }
}
