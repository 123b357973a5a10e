//! The equation of motion over short windows: one column for each unknown.
//!
//! With the rows g of G, the joint rates zd = g.w, and a bump f that is 0 at both ends of a window,
//!
//! ```text
//! I A + sum_j (J B + c C + b D)_j + c_s E + b_s F - sum_i m_i W_i - sum_j k_j T_j = 0,
//! A = ∫ f dw,  B = ∫ f g dzd,  C = ∫ f g sign(zd) dt,  D = ∫ f g zd dt,  T = ∫ f g tau dt
//! ```
//!
//! E and F are the same for the sphere, W is the torque of a unit of imbalance. The integrals over
//! dw and dzd are summed by parts, so that only angles and no rates are needed. Where a joint turns
//! round in a window, the equation is used only across its row: while it sticks, its friction has
//! no sign.

use std::f64::consts::TAU;

use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::OdometryMethod;
use hbot_core::motion::odometry;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Quat, Rig, Vec3};

use super::Sample;

/// Time of a step, s. A step takes as many samples as fit.
const STEP_S: f64 = 0.002;
/// A longer time between two samples ends a part of the motion, s.
const GAP_S: f64 = 0.01;
/// Speed of the sphere below which it could stick, rad/s.
const SLOW: f64 = 0.06;

/// Two directions are the same if less than this part of one is apart from the other.
const SAME: f64 = 1.0e-3;

/// How the equation is approximated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grain {
    /// Length of a window, s. A harmonic of a rotor that passes much faster than this is not seen.
    window_s: f64,
    /// Time between which rates are differences of angles, s.
    rate_s: f64,
}

impl Grain {
    /// The best one. Shorter times are noisier, in longer ones more joints turn round.
    pub(super) const USUAL: Self = Self { window_s: 0.12, rate_s: 0.024 };
    /// Another one, which shows how much values depend on it.
    pub(super) const OTHER: Self = Self { window_s: 0.2, rate_s: 0.04 };
}

/// One unknown of the equation of motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Term {
    Scale(usize),
    Inertia(usize),
    Coulomb(usize),
    Viscous(usize),
    /// Part of the motor's torque that its gear loses.
    Loss(usize),
    CageCoulomb,
    CageViscous,
    Imbalance(usize),
    Delay,
    /// Factor of the sine of a harmonic of a joint's encoder angle. The cosine follows.
    Sine(usize, u32),
    Cosine(usize, u32),
}

/// Inertia of a joint in the rig file, kg m².
pub(super) fn filed_inertia(rig: &Rig, joint: usize) -> f64 {
    rig.device.wheels().get(joint / 2).map_or(0.0, |wheel| {
        let spec = wheel.spec();
        if joint.is_multiple_of(2) { spec.steer_inertia } else { spec.drive_inertia }
    })
}

impl Term {
    /// Returns the value that is expected before the motion is known.
    pub(super) fn expected(self, rig: &Rig) -> f64 {
        match self {
            Self::Scale(_) => 1.0,
            Self::Inertia(j) => filed_inertia(rig, j),
            _ => 0.0,
        }
    }

    /// Returns the usual deviation from what is expected.
    pub(super) fn usual(self, rig: &Rig) -> f64 {
        let continuous = |j: usize| rig.joints[j].continuous.max(1.0e-3);
        let sphere = 0.1 * rig.limits.torque.clamp(1.0e-2, 10.0);
        match self {
            Self::Scale(_) | Self::Loss(_) => 0.1,
            // An inertia that the file leaves out is not more than a part of the sphere's.
            Self::Inertia(j) => {
                let row = largest_row(rig, j);
                (0.5 * filed_inertia(rig, j)).max(1.0e-3 * rig.device.sphere_inertia() / (row * row))
            }
            Self::Coulomb(j) => 0.2 * continuous(j),
            Self::Viscous(j) => 0.1 * continuous(j),
            Self::CageCoulomb | Self::CageViscous | Self::Imbalance(_) => sphere,
            Self::Delay => 2.0e-3,
            Self::Sine(j, _) | Self::Cosine(j, _) => 0.2 * continuous(j),
        }
    }
}

/// Returns the length of the longer row of G that a joint can have.
fn largest_row(rig: &Rig, joint: usize) -> f64 {
    let posture = Posture::new(&rig.device, &[0.0; MAX_WHEELS][..rig.device.wheels().len()]);
    posture.rows()[joint].length()
}

/// A moment between two steps.
struct Node {
    time_s: f64,
    angles: [f64; MAX_JOINTS],
    rows: [Vec3; MAX_JOINTS],
    q: Quat,
}

/// A step between two nodes.
struct Step {
    /// Mean torque, N m.
    torque: [f64; MAX_JOINTS],
    /// Turn of the sphere in frame N, rad.
    turn: Vec3,
    /// Smoothed joint rates and angular velocity of the sphere, rad/s.
    rates: [f64; MAX_JOINTS],
    omega: Vec3,
}

/// A part of the motion without a gap.
struct Part {
    nodes: Vec<Node>,
    steps: Vec<Step>,
    windows: Vec<Window>,
}

/// A window of a part.
struct Window {
    /// The first step.
    first: usize,
    /// The bump at start, middle and end of each step.
    bumps: Vec<[f64; 3]>,
    length_s: f64,
    /// Unit vectors without which the equation is used. See [`Part::unknown`].
    unknown: Vec<Vec3>,
}

/// The equation over all windows. Each window has three rows.
pub(super) struct Rows<'a> {
    pub(super) rig: &'a Rig,
    grain: Grain,
    parts: Vec<Part>,
    pub(super) terms: Vec<Term>,
    /// The columns of the unknowns, in the order of `terms`.
    pub(super) columns: Vec<Vec<f64>>,
    /// What the sum of the columns times the unknowns is to be.
    pub(super) wanted: Vec<f64>,
    /// Torque on the sphere, root mean square, N m.
    pub(super) torque: f64,
}

impl<'a> Rows<'a> {
    pub(super) fn new(rig: &'a Rig, from: Quat, samples: &[Sample], grain: Grain) -> Self {
        let parts: Vec<Part> = samples
            .chunk_by(|a, b| b.time_s - a.time_s <= GAP_S)
            .scan(from, |q, part| {
                let part = Part::new(rig, part, *q, grain);
                *q = part.nodes.last().map_or(*q, |node| node.q);
                Some(part)
            })
            .collect();
        let joints = rig.device.joints();
        let driven = |j: &usize| rig.joints[*j].peak > 0.0;
        let terms: Vec<Term> = (0..joints)
            .filter(driven)
            .map(Term::Scale)
            .chain((0..joints).flat_map(|j| [Term::Inertia(j), Term::Coulomb(j), Term::Viscous(j)]))
            .chain((0..joints).filter(|j| driven(j) && rig.joints[*j].gear != 1.0).map(Term::Loss))
            .chain([Term::CageCoulomb, Term::CageViscous])
            .chain((0..3).map(Term::Imbalance))
            .chain([Term::Delay])
            .collect();
        let mut rows = Self {
            rig,
            grain,
            parts,
            terms: Vec::new(),
            columns: Vec::new(),
            wanted: Vec::new(),
            torque: 0.0,
        };
        rows.columns = terms.iter().map(|term| rows.column(*term)).collect();
        rows.terms = terms;
        rows.wanted = rows.known();
        let all = (0..joints).filter(driven).map(|j| rows.column(Term::Scale(j)));
        let sum = all.fold(vec![0.0; rows.wanted.len()], |mut sum, column| {
            sum.iter_mut().zip(&column).for_each(|(sum, x)| *sum += x);
            sum
        });
        let windows = (sum.len() / 3).max(1) as f64;
        rows.torque = (sum.iter().map(|x| x * x).sum::<f64>() / windows).sqrt();
        rows
    }

    /// Returns the time of all windows, s.
    pub(super) fn used_s(&self) -> f64 {
        0.5 * self.grain.window_s * self.parts.iter().map(|part| part.windows.len() as f64).sum::<f64>()
    }

    /// Adds the columns of a harmonic.
    pub(super) fn add_cogging(&mut self, joint: usize, per_turn: u32) {
        for term in [Term::Sine(joint, per_turn), Term::Cosine(joint, per_turn)] {
            self.columns.push(self.column(term));
            self.terms.push(term);
        }
    }

    /// Returns the torque of inertia that is known: that of the sphere, and that which couples
    /// steer and drive.
    fn known(&self) -> Vec<f64> {
        let device = &self.rig.device;
        let couplings: Vec<f64> = device
            .wheels()
            .iter()
            .map(|wheel| wheel.spec().axial_inertia * wheel.axis_along_axle())
            .collect();
        let sphere = device.sphere_inertia();
        self.integrate(|part, k, bump| {
            let dt = part.dt(k);
            let mut sum = -part.steps[k].turn * ((bump[2] - bump[0]) * sphere / dt);
            for (i, coupling) in couplings.iter().enumerate().filter(|(_, it)| **it != 0.0) {
                for (a, b) in [(2 * i, 2 * i + 1), (2 * i + 1, 2 * i)] {
                    sum += part.of_inertia(k, bump, a, b) * *coupling;
                }
            }
            sum
        })
    }

    /// Returns the column of an unknown. Torques of motors and of weight have a positive sign.
    pub(super) fn column(&self, term: Term) -> Vec<f64> {
        self.integrate(|part, k, bump| {
            let (step, dt) = (&part.steps[k], part.dt(k));
            let middle =
                |j: usize| (part.nodes[k].rows[j] + part.nodes[k + 1].rows[j]) * (0.5 * bump[1] * dt);
            match term {
                Term::Scale(j) => middle(j) * step.torque[j],
                Term::Inertia(j) => -part.of_inertia(k, bump, j, j),
                Term::Coulomb(j) => middle(j) * -sign(step.rates[j]),
                Term::Viscous(j) => middle(j) * -step.rates[j],
                Term::Loss(j) => middle(j) * -(step.torque[j].abs() * sign(step.rates[j])),
                Term::CageCoulomb => {
                    // In every window the sphere is faster than [`SLOW`].
                    step.omega * (-bump[1] * dt / step.omega.length().max(SLOW))
                }
                Term::CageViscous => step.omega * (-bump[1] * dt),
                Term::Imbalance(axis) => {
                    let pull = |node: &Node| (node.q * Vec3::AXES[axis]).cross(Vec3::NEG_Z);
                    (pull(&part.nodes[k]) + pull(&part.nodes[k + 1])) * (0.5 * bump[1] * dt)
                }
                // The torque of a moment earlier: the sum over tau dt by parts.
                Term::Delay => {
                    let rise = |j: usize| {
                        (part.nodes[k + 1].rows[j] * bump[2] - part.nodes[k].rows[j] * bump[0])
                            * step.torque[j]
                    };
                    (0..self.rig.device.joints()).map(rise).fold(Vec3::ZERO, |sum, x| sum + x)
                }
                Term::Sine(j, n) | Term::Cosine(j, n) => {
                    let per_rad = f64::from(n) * self.rig.joints[j].gear;
                    let angle = 0.5 * (part.nodes[k].angles[j] + part.nodes[k + 1].angles[j]) * per_rad;
                    let wave = if matches!(term, Term::Sine(..)) { angle.sin() } else { angle.cos() };
                    middle(j) * wave
                }
            }
        })
    }

    /// Returns what `of` gives, summed over the steps of each window and divided by the time of the
    /// bump. `of` gets the part, the number of the step, and the bump at its start, middle and end.
    fn integrate(&self, of: impl Fn(&Part, usize, [f64; 3]) -> Vec3) -> Vec<f64> {
        let mut all = Vec::new();
        for part in &self.parts {
            for window in &part.windows {
                let steps = (window.first..).zip(&window.bumps);
                let mut sum = steps.fold(Vec3::ZERO, |sum, (k, bump)| sum + of(part, k, *bump));
                sum = window.unknown.iter().fold(sum, |sum, direction| without(sum, *direction));
                all.extend((sum / window.length_s).to_array());
            }
        }
        all
    }

    /// Returns the number of joints.
    pub(super) fn joints(&self) -> usize {
        self.rig.device.joints()
    }
}

/// Returns the sign of a rate that is the difference of two counts, or 0.
fn sign(rate: f64) -> f64 {
    if rate == 0.0 { 0.0 } else { rate.signum() }
}

/// Returns `vector` without its part along the unit vector `direction`.
fn without(vector: Vec3, direction: Vec3) -> Vec3 {
    vector - direction * direction.dot(vector)
}

impl Part {
    fn new(rig: &Rig, samples: &[Sample], q: Quat, grain: Grain) -> Self {
        let (joints, wheels) = (rig.device.joints(), rig.device.wheels().len());
        let mut part = Self { nodes: Vec::new(), steps: Vec::new(), windows: Vec::new() };
        let (mut whole, mut last) = (samples[0].counts.map(i64::from), samples[0].counts);
        let mut q = q;
        let mut impulse = [0.0; MAX_JOINTS];
        for (k, sample) in samples.iter().enumerate() {
            for j in 0..joints {
                whole[j] += i64::from(sample.counts[j].wrapping_sub(last[j]));
            }
            last = sample.counts;
            let begun = part.nodes.last().map_or(f64::NEG_INFINITY, |node| node.time_s);
            if sample.time_s - begun > 0.99 * STEP_S {
                let angles: [f64; MAX_JOINTS] = std::array::from_fn(|j| {
                    if j < joints { whole[j] as f64 * rig.joints[j].radians_per_count() } else { 0.0 }
                });
                let steer: [f64; MAX_WHEELS] = std::array::from_fn(|i| angles[2 * i]);
                if let Some(before) = part.nodes.last() {
                    let th: [f64; MAX_WHEELS] = std::array::from_fn(|i| before.angles[2 * i]);
                    let delta: [f64; MAX_JOINTS] = std::array::from_fn(|j| angles[j] - before.angles[j]);
                    let method = OdometryMethod::Midpoint;
                    let turn = odometry::turn(&rig.device, method, &th[..wheels], &delta[..joints]);
                    q = odometry::advance(q, turn);
                    let dt = sample.time_s - before.time_s;
                    let torque = impulse.map(|impulse| impulse / dt);
                    part.steps.push(Step { torque, turn, rates: [0.0; MAX_JOINTS], omega: Vec3::ZERO });
                }
                let posture = Posture::new(&rig.device, &steer[..wheels]);
                let mut rows = [Vec3::ZERO; MAX_JOINTS];
                rows[..joints].copy_from_slice(posture.rows());
                part.nodes.push(Node { time_s: sample.time_s, angles, rows, q });
                impulse = [0.0; MAX_JOINTS];
            }
            if let Some(next) = samples.get(k + 1) {
                let dt = next.time_s - sample.time_s;
                for j in 0..joints {
                    impulse[j] += dt * sample.torque[j];
                }
            }
        }
        part.smooth(grain.rate_s);
        part.cut(grain.window_s);
        part
    }

    /// Computes the smoothed rates of all steps, over `rate_s`.
    fn smooth(&mut self, rate_s: f64) {
        let mut turned = vec![Vec3::ZERO];
        for step in &self.steps {
            turned.push(turned[turned.len() - 1] + step.turn);
        }
        let each = (0.5 * rate_s / STEP_S).round().max(1.0) as usize;
        let count = self.steps.len();
        for (k, step) in self.steps.iter_mut().enumerate() {
            let (a, b) = ((k + 1).saturating_sub(each), (k + each).min(count));
            let time = self.nodes[b].time_s - self.nodes[a].time_s;
            step.rates = std::array::from_fn(|j| (self.nodes[b].angles[j] - self.nodes[a].angles[j]) / time);
            step.omega = (turned[b] - turned[a]) / time;
        }
    }

    /// Cuts the part into windows that overlap by half, and leaves out those in which the sphere
    /// could stick.
    fn cut(&mut self, window_s: f64) {
        let Some(last) = self.nodes.last() else { return };
        let mut start_s = self.nodes[0].time_s;
        while start_s + window_s <= last.time_s {
            let first = self.nodes.partition_point(|node| node.time_s < start_s);
            let end =
                self.nodes.partition_point(|node| node.time_s < start_s + window_s).min(self.steps.len());
            if end > first + 8 && self.steps[first..end].iter().all(|step| step.omega.length() > SLOW) {
                let unknown = self.unknown(first, end);
                if unknown.len() < 3 {
                    let start = self.nodes[first].time_s;
                    let length_s = self.nodes[end].time_s - start;
                    let bump = |time: f64| 1.0 - (TAU * (time - start) / length_s).cos();
                    let bumps = self.nodes[first..=end].windows(2).map(|nodes| {
                        let [a, b] = [nodes[0].time_s, nodes[1].time_s];
                        [bump(a), bump(0.5 * (a + b)), bump(b)]
                    });
                    let bumps = bumps.collect();
                    self.windows.push(Window { first, bumps, length_s, unknown });
                }
            }
            start_s += 0.5 * window_s;
        }
    }

    /// Returns the directions in which dry friction can push between the steps `first` and `end`
    /// without a sign that is known: the rows of joints that turn round there. A joint that sticks
    /// is pushed against by its motor, so what is unknown would make the motor seem weaker.
    fn unknown(&self, first: usize, end: usize) -> Vec<Vec3> {
        let mut unknown: Vec<Vec3> = Vec::new();
        for j in 0..MAX_JOINTS {
            let begun = sign(self.steps[first].rates[j]);
            let Some(turned) = (first..end).find(|k| sign(self.steps[*k].rates[j]) * begun <= 0.0) else {
                continue;
            };
            let row = self.nodes[turned].rows[j];
            let rest = unknown.iter().fold(row, |rest, direction| without(rest, *direction));
            if rest.length() > SAME * row.length() {
                unknown.push(rest / rest.length());
            }
        }
        unknown
    }

    fn dt(&self, k: usize) -> f64 {
        self.nodes[k + 1].time_s - self.nodes[k].time_s
    }

    /// Returns the share of step `k` in the integral of f g dzd, with the row g of joint `a` and
    /// the rate zd of joint `b`.
    fn of_inertia(&self, k: usize, bump: [f64; 3], a: usize, b: usize) -> Vec3 {
        let rate = (self.nodes[k + 1].angles[b] - self.nodes[k].angles[b]) / self.dt(k);
        (self.nodes[k].rows[a] * bump[0] - self.nodes[k + 1].rows[a] * bump[2]) * rate
    }
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;
    use hbot_sim::wander::Wander;

    use super::*;

    /// What friction does while a joint turns round changes nothing: here it is left out.
    #[test]
    fn friction_of_a_joint_that_turns_round_does_not_count() {
        const H: f64 = 1.0e-3;
        let rig = RigConfig::prototype().rig;
        let hand = Wander::new(1, Vec3::splat(0.8));
        let moments: Vec<_> = hand.course(&rig.device, H).take(20_000).collect();
        let sample = |(k, angles): (usize, &[f64; MAX_JOINTS])| Sample {
            time_s: k as f64 * H,
            counts: std::array::from_fn(|j| {
                if j < 4 { (angles[j] / rig.joints[j].radians_per_count()).floor() as i32 } else { 0 }
            }),
            torque: [0.0; MAX_JOINTS],
        };
        let samples: Vec<_> = moments.iter().map(|moment| &moment.angles).enumerate().map(sample).collect();
        let rows = Rows::new(&rig, Quat::IDENTITY, &samples, Grain::USUAL);
        for j in 0..4 {
            let exact = rows.integrate(|part, k, bump| {
                let [a, b] = [k, k + 1].map(|node| &part.nodes[node]);
                let angle = |node: &Node| moments[(node.time_s / H).round() as usize].angles[j];
                let rate = (angle(b) - angle(a)) / part.dt(k);
                let sign = if rate.abs() < 0.02 { 0.0 } else { rate.signum() };
                (a.rows[j] + b.rows[j]) * (-0.5 * bump[1] * part.dt(k) * sign)
            });
            let ours = rows.column(Term::Coulomb(j));
            let size = |column: &[f64]| column.iter().map(|x| x * x).sum::<f64>().sqrt();
            let apart: Vec<f64> = ours.iter().zip(&exact).map(|(a, b)| a - b).collect();
            let part = size(&apart) / size(&ours);
            assert!(part < 5.0e-3, "joint {j}: {part}");
        }
        assert!(rows.used_s() > 0.5 * H * samples.len() as f64, "{} s", rows.used_s());
    }
}
