//! The sampled loop of three axes: from a reading of the sphere's motion to the torque that acts
//! on it, and back. It says whether a stiffness and a damping are stable in it.
//!
//! The torque of a tick is computed from the motion at its reading, acts a whole number of ticks
//! later, is held for a period, and reaches the sphere by the motors' lag. The rates are late by
//! the lag of their filter. All of it is linear, so the loop is stable if no zero of
//! det(I + L(z)) is outside the unit circle. L is the loop's transfer matrix. The number of these
//! zeros is the number of turns that the determinant makes about 0 around the region outside
//! (Cauchy's argument principle), because no pole of L is in it.

use std::cell::Cell;
use std::f64::consts::PI;

use hbot_core::{Mat3, Vec3};

use super::complex::{Complex, determinant};

/// Growth of a swing that still counts as stable, 1/s: by a factor e in 20 s. Any friction takes
/// that.
const GROWTH: f64 = 0.05;
/// Slowest swing that counts, rad/s: half a turn of phase in a second. Slower motion is no shaking.
/// Nearer to the real axis, rounding would hide a determinant of directions that nothing holds.
const SLOWEST: f64 = PI;
/// Distance from the circle at which the determinant is 1, except for rounding.
const FAR: f64 = 1.0e3;
/// Largest number of points at which the determinant is computed. A usual scene needs a few
/// hundred.
const MOST_POINTS: u32 = 20_000;
/// Ratio between the angles of two points on the circle, before points are added where the
/// determinant turns quickly.
const RATIO: f64 = 1.5;
/// Largest change of the determinant between two points: of its angle (rad), and of the logarithm
/// of its size.
const STEP: f64 = 0.8;

/// A person's hand on the sphere: a spring and a damper to a place that the hand holds, and an
/// inertia that turns with the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// Name of the hand, for sentences.
    pub name: &'static str,
    /// Stiffness of the grip, N m/rad.
    pub stiffness: f64,
    /// Damping of the grip, N m s/rad.
    pub damping: f64,
    /// Inertia that the hand adds to the sphere, kg m².
    pub inertia: f64,
}

/// Nobody holds the sphere, a hand of 3 N m/rad holds it, and one of 30 N m/rad. The first hand is
/// the default hand of the simulated rig. The second grips ten times as hard; its damping grows by
/// the square root, as that of muscles does in measurements of the wrist.
pub const HOLDS: [Hold; 3] = [
    Hold { name: "the free sphere", stiffness: 0.0, damping: 0.0, inertia: 0.0 },
    Hold { name: "a hand of 3 N m/rad", stiffness: 3.0, damping: 0.05, inertia: 2.0e-3 },
    Hold { name: "a hand of 30 N m/rad", stiffness: 30.0, damping: 0.16, inertia: 2.0e-3 },
];

/// The numbers of a loop that decide what it keeps stable.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// Period, s.
    pub period: f64,
    /// Whole ticks from a reading to the torque that is computed from it.
    pub delay: u32,
    /// Time constant with which the torque follows its command, s.
    pub lag: f64,
    /// Time by which the scene is rendered ahead of its reading, s: 0 without a lead.
    pub lead: f64,
    /// Time by which the slew limit delays the torque in addition, s.
    pub slew: f64,
    /// Time constant 2/w of the filter of the motor controllers' encoders, s: a phase-locked loop
    /// with critical damping and the bandwidth w (rad/s), which filters angle and rate. 0 for none.
    pub rate_lag: f64,
    /// The numbers by which the last angles are multiplied to give the rate, 1/s; the newest angle
    /// comes first. Empty if the rates are those of the motor controllers.
    pub taps: Vec<f64>,
    /// Inertia of the sphere about three axes, kg m².
    pub inertia: Vec3,
    /// The axes of `inertia` in frame N, as columns.
    pub axes: Mat3,
}

/// A scene around one orientation, as the loop renders it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Stiffness in frame N, N m/rad.
    pub stiffness: Mat3,
    /// Damping in frame N, N m s/rad.
    pub damping: Mat3,
    /// Virtual masses in frame N (kg m²), with the time constants of their smoothing (s).
    pub masses: Vec<(Mat3, f64)>,
}

/// Largest number of states of an axis: angle, rate, torque, and the errors of the encoders' filter
/// in angle and rate.
const STATES: usize = 5;

/// A matrix of an axis. An axis with fewer states uses its first rows and columns.
type Square = [[f64; STATES + 1]; STATES + 1];

/// Transfer functions of one axis, from the torque that a tick commands to the angle and the
/// filtered rate at readings: two numerators and the denominator, polynomials of z in falling
/// order.
struct Axis {
    angle: Vec<f64>,
    rate: Vec<f64>,
    denominator: Vec<f64>,
}

impl Sampled {
    /// Returns whether the loop keeps `scene` stable while `hold` holds the sphere.
    ///
    /// A place from which the sphere rolls away, such as the ridge between two notches, is no
    /// instability of the loop. It counts as stable if nothing swings there.
    #[must_use]
    pub fn is_stable(&self, scene: &Scene, hold: &Hold) -> bool {
        let (turns, left) = self.turns(scene, hold);
        // A determinant that could not be followed speaks for no scene.
        left > 0 && turns > -0.5 * PI
    }

    /// Returns the angle by which the determinant turns around the half of the region outside the
    /// unit circle in which swings are, rad, and how many points were left to compute.
    fn turns(&self, scene: &Scene, hold: &Hold) -> (f64, u32) {
        let closed = Closed::new(self, scene, hold);
        let radius = 1.0 + GROWTH * self.period;
        let slowest = (SLOWEST * self.period).min(0.05);
        let left = Cell::new(MOST_POINTS);
        let count = |z| {
            left.set(left.get().saturating_sub(1));
            closed.at(z)
        };
        // From far out along the ray of the slowest swing to the circle, and along the circle to
        // the negative real axis. Each pair of zeros outside turns the determinant back by a turn.
        let ray = |beyond: f64| count(Complex::polar(radius + beyond, slowest));
        let distances = std::iter::successors(Some(FAR), |beyond| Some(beyond / RATIO));
        let distances = distances.take_while(|beyond| *beyond > 0.1 * slowest).chain([0.0]);
        let circle = |angle: f64| count(Complex::polar(radius, angle));
        let angles = std::iter::successors(Some(slowest), |angle| {
            (*angle < PI).then(|| (angle * RATIO).min(angle + 0.4).min(PI))
        });
        let turns = turned_along(&ray, distances, &left) + turned_along(&circle, angles, &left);
        (turns, left.get())
    }

    /// Returns the stiffness K (N m/rad) and the damping B (N m s/rad) with which a free sphere
    /// with the inertia `inertia` (kg m²) swings about one axis by `phi` rad per tick, and its
    /// swing neither grows nor decays.
    ///
    /// Then 1 + K (X + t W) + B W = 0 at z = exp(i phi), with the transfer functions X to the angle
    /// and W to the rate, and the lead t. Its real and imaginary parts are two linear equations.
    #[must_use]
    pub fn on_border(&self, inertia: f64, phi: f64) -> [f64; 2] {
        let axis = Axis::new(self, inertia, &HOLDS[0]);
        let z = Complex::polar(1.0, phi);
        let [angle, rate] = self.responses(&axis, z);
        let stiffness = angle + rate * self.lead;
        let cross = |p: Complex, q: Complex| p.re * q.im - p.im * q.re;
        let one = Complex::real(1.0);
        let scale = -1.0 / cross(stiffness, rate);
        [scale * cross(one, rate), scale * cross(stiffness, one)]
    }

    /// Returns the transfer functions of an axis from the torque that a tick computes to the angle
    /// and the rate that a later tick gets, at `z`.
    fn responses(&self, axis: &Axis, z: Complex) -> [Complex; 2] {
        let back = z.inverse();
        let delay = (0..self.delay).fold(Complex::real(1.0), |product, _| product * back);
        // The slew limit's delay is no whole number of ticks.
        let ticks = self.slew / self.period;
        let slew = Complex::polar(z.size().powf(-ticks), -z.angle() * ticks);
        let over = polynomial(&axis.denominator, z).inverse() * delay * slew;
        let angle = polynomial(&axis.angle, z) * over;
        let rate = if self.taps.is_empty() {
            polynomial(&axis.rate, z) * over
        } else {
            angle * self.taps.iter().rev().fold(Complex::real(0.0), |sum, tap| sum * back + *tap)
        };
        [angle, rate]
    }

    /// Returns the time constant of the whole loop: the mean time from a reading to the effect of
    /// the torque that is computed from it, s.
    #[must_use]
    pub fn lateness(&self) -> f64 {
        self.period * (0.5 + f64::from(self.delay)) + self.lag
    }
}

/// Returns the angle by which the determinant `at` turns along `places`, rad. Stops to add places
/// when no points are `left`.
fn turned_along(at: &impl Fn(f64) -> Complex, places: impl Iterator<Item = f64>, left: &Cell<u32>) -> f64 {
    let mut sum = 0.0;
    let mut last = None;
    for place in places {
        let next = (place, at(place));
        sum += last.map_or(0.0, |last| turned(at, last, next, left));
        last = Some(next);
    }
    sum
}

/// Returns the angle by which the determinant turns from one place to another, rad. Adds places
/// between them where it changes quickly.
///
/// Between a place and the middle it may change by [`STEP`] in angle and in the logarithm of its
/// size. The size matters where several axes have equal zeros: their turns add up to whole ones,
/// which the angle alone does not show.
fn turned(at: &impl Fn(f64) -> Complex, from: (f64, Complex), to: (f64, Complex), left: &Cell<u32>) -> f64 {
    let place = 0.5 * (from.0 + to.0);
    let middle = (place, at(place));
    let change = |a: Complex, b: Complex| {
        let ratio = b * a.inverse();
        (ratio.angle(), ratio.size().ln())
    };
    let (first, second) = (change(from.1, middle.1), change(middle.1, to.1));
    let most = [first.0, first.1, second.0, second.1].into_iter().map(f64::abs).fold(0.0, f64::max);
    if most < STEP || left.get() == 0 {
        return first.0 + second.0;
    }
    turned(at, from, middle, left) + turned(at, middle, to, left)
}

/// The closed loop: everything that det(I + L(z)) needs.
struct Closed<'a> {
    sampled: &'a Sampled,
    axes: [Axis; 3],
    free: bool,
    stiffness: Mat3,
    damping: Mat3,
    masses: Vec<(Mat3, f64)>,
}

impl<'a> Closed<'a> {
    fn new(sampled: &'a Sampled, scene: &Scene, hold: &Hold) -> Self {
        let turned = |m: &Mat3| sampled.axes.transpose() * *m * sampled.axes;
        let stiffness = turned(&scene.stiffness);
        let part = |smoothing: f64| sampled.period / (smoothing + sampled.period);
        Self {
            sampled,
            axes: [0, 1, 2].map(|k| Axis::new(sampled, sampled.inertia[k], hold)),
            free: hold.stiffness == 0.0,
            stiffness,
            damping: turned(&scene.damping) + stiffness * sampled.lead,
            masses: scene.masses.iter().map(|(m, smoothing)| (turned(m), part(*smoothing))).collect(),
        }
    }

    /// Returns det(I + L(z)).
    fn at(&self, z: Complex) -> Complex {
        let back = z.inverse();
        let one = Complex::real(1.0);
        let difference = (one - back) * (1.0 / self.sampled.period);
        // A virtual mass resists the change of the rate since the last tick, smoothed.
        let masses: Vec<(&Mat3, Complex)> = self
            .masses
            .iter()
            .map(|(m, part)| (m, difference * *part * (one - back * (1.0 - part)).inverse()))
            .collect();
        // Where nothing holds the sphere the determinant has two poles at 1 for each axis. Without
        // them it changes less near 1. What takes their place is inside the circle.
        let level = if self.free { (one - back) * (one - back) } else { one };
        let mut m = [[Complex::real(0.0); 3]; 3];
        for (j, axis) in self.axes.iter().enumerate() {
            let [angle, rate] = self.sampled.responses(axis, z);
            for (i, row) in m.iter_mut().enumerate() {
                let mut entry = angle * self.stiffness.col(j)[i] + rate * self.damping.col(j)[i];
                for (mass, response) in &masses {
                    entry = entry + rate * *response * mass.col(j)[i];
                }
                row[j] = (if i == j { entry + 1.0 } else { entry }) * level;
            }
        }
        determinant(&m)
    }
}

fn polynomial(coefficients: &[f64], z: Complex) -> Complex {
    coefficients.iter().fold(Complex::real(0.0), |sum, c| sum * z + *c)
}

impl Axis {
    /// Creates the transfer functions of an axis with the inertia `inertia` (kg m²) in `hold`.
    fn new(sampled: &Sampled, inertia: f64, hold: &Hold) -> Self {
        let (h, j) = (sampled.period, inertia + hold.inertia);
        // The state is angle, rate, torque and the filter's two. The input, behind the last state,
        // is the commanded torque, which is constant over a tick. A lag far below the period is
        // none.
        let lag = sampled.lag.max(1.0e-3 * h);
        let is_filtered = sampled.rate_lag > 1.0e-3 * h;
        let n = if is_filtered { STATES } else { 3 };
        let mut slope: Square = [[0.0; STATES + 1]; STATES + 1];
        let acceleration = [-hold.stiffness / j * h, -hold.damping / j * h, h / j];
        slope[0][1] = h;
        slope[1][..3].copy_from_slice(&acceleration);
        (slope[2][2], slope[2][n]) = (-h / lag, h / lag);
        if is_filtered {
            // The filter's angle X and rate V follow x: X' = V + 2 w (x - X), V' = w² (x - X). So
            // the errors e = x - X and d = x' - V have e' = d - 2 w e and d' = x'' - w² e.
            let w = 2.0 / sampled.rate_lag;
            (slope[3][3], slope[3][4]) = (-2.0 * w * h, h);
            slope[4][..3].copy_from_slice(&acceleration);
            slope[4][3] = -w * w * h;
        }
        let step = exponential(&slope, n + 1);
        let input: Vec<f64> = (0..n).map(|i| step[i][n]).collect();
        // Faddeev and LeVerrier: the adjugate of z - step and its determinant, power by power.
        let (mut angle, mut rate, mut denominator) = (Vec::new(), Vec::new(), vec![1.0]);
        let mut adjugate = identity(n);
        for k in 1..=n {
            let times = |row: usize| adjugate[row][..n].iter().zip(&input).map(|(a, b)| a * b).sum::<f64>();
            let error = |row| if is_filtered { times(row) } else { 0.0 };
            angle.push(times(0) - error(3));
            rate.push(times(1) - error(4));
            let next = product(&step, &adjugate, n);
            let trace: f64 = (0..n).map(|i| next[i][i]).sum();
            let c = -trace / k as f64;
            denominator.push(c);
            adjugate = next;
            (0..n).for_each(|i| adjugate[i][i] += c);
        }
        Self { angle, rate, denominator }
    }
}

fn identity(n: usize) -> Square {
    let mut m = [[0.0; STATES + 1]; STATES + 1];
    (0..n).for_each(|i| m[i][i] = 1.0);
    m
}

/// Returns the product of the first `n` rows and columns of two matrices.
fn product(a: &Square, b: &Square, n: usize) -> Square {
    let mut m = [[0.0; STATES + 1]; STATES + 1];
    for (i, row) in m.iter_mut().enumerate().take(n) {
        for (k, entry) in row.iter_mut().enumerate().take(n) {
            *entry = (0..n).map(|l| a[i][l] * b[l][k]).sum();
        }
    }
    m
}

/// Returns the exponential of the first `n` rows and columns of a matrix, by its series after
/// halvings.
fn exponential(m: &Square, n: usize) -> Square {
    let size = m.iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let halvings = (size / 0.25).log2().ceil().max(0.0) as i32;
    let small = m.map(|row| row.map(|x| x * 0.5_f64.powi(halvings)));
    let mut sum = identity(n);
    let mut term = sum;
    // 0.25^14/14! is below rounding.
    for k in 1..=14 {
        term = product(&term, &small, n).map(|row| row.map(|x| x / f64::from(k)));
        for (row, more) in sum.iter_mut().zip(term) {
            row.iter_mut().zip(more).for_each(|(x, y)| *x += y);
        }
    }
    (0..halvings).fold(sum, |m, _| product(&m, &m, n))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions that nothing holds, in any frame, beside a stiff one: their determinant is lost
    /// in rounding near the real axis. A search there would not end.
    #[test]
    fn directions_that_nothing_holds_cost_no_time() {
        let turn = Mat3::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7);
        for period in [2.0e-3, 2.5e-4, 5.0e-5] {
            let sampled = Sampled { period, ..rig(5.0e-4, 0.0) };
            for stiffness in [1.0e-3, 1.0, 1.0e3, 1.0e6] {
                let held = turn * Mat3::from_diagonal(Vec3::X * stiffness) * turn.transpose();
                let scene = Scene { stiffness: held, damping: held * 0.01, masses: Vec::new() };
                let points = MOST_POINTS - sampled.turns(&scene, &HOLDS[0]).1;
                assert!(points < 1000, "{period} {stiffness}: {points} points");
                // 0.01 s of damping per stiffness is more than the delay takes away.
                if stiffness < 2.0 {
                    assert!(sampled.is_stable(&scene, &HOLDS[0]), "{period} {stiffness}");
                }
            }
        }
    }

    const J: f64 = 3.4e-3;

    fn rig(lag: f64, lead: f64) -> Sampled {
        Sampled {
            period: 1.0e-3,
            delay: 1,
            lag,
            lead,
            slew: 0.0,
            rate_lag: 0.0,
            taps: Vec::new(),
            inertia: Vec3::splat(J),
            axes: Mat3::IDENTITY,
        }
    }

    fn spring(k: f64, b: f64) -> Scene {
        Scene { stiffness: Mat3::IDENTITY * k, damping: Mat3::IDENTITY * b, masses: Vec::new() }
    }

    /// Returns the first unstable stiffness with the damping `b`, N m/rad, to 1e-4 of it.
    fn border(rig: &Sampled, b: f64, hold: &Hold) -> f64 {
        let mut k = 0.01;
        while rig.is_stable(&spring(k * 1.1, b), hold) {
            k *= 1.1;
            assert!(k < 1.0e5);
        }
        let (mut low, mut high) = (k, k * 1.1);
        while high - low > 1.0e-4 * low {
            let middle = 0.5 * (low + high);
            if rig.is_stable(&spring(middle, b), hold) { low = middle } else { high = middle }
        }
        low
    }

    /// The table of first unstable springs that was computed independently: lag 0.5 ms, damping
    /// 0.01 N m s/rad, with no lead and with leads of a part of the loop's time constant. Its
    /// numbers have three digits at most, and its growth is 0.
    #[test]
    fn a_lead_moves_the_border_as_computed_independently() {
        let lateness = rig(5.0e-4, 0.0).lateness();
        for (part, want) in [(0.0, 5.0), (0.8, 24.0), (1.0, 110.0), (1.1, 238.0), (1.2, 343.0)] {
            let found = border(&rig(5.0e-4, part * lateness), 0.01, &HOLDS[0]);
            assert!((found / want - 1.0).abs() < 0.04, "{part}: {found}, not {want}");
        }
    }

    /// Returns whether a unit inertia on a spring comes to rest. The period is 1, the torque is
    /// commanded one tick late, and the motor follows it with the time constant `lag`. Each tick is
    /// integrated in steps that are far shorter than the lag.
    fn rests(lag: f64, stiffness: f64, damping: f64) -> bool {
        let steps = if lag > 0.0 { (40.0 / lag).clamp(40.0, 400.0) } else { 1.0 };
        let (h, mut x, mut v) = (1.0 / steps, 1.0_f64, 0.0_f64);
        let (mut command, mut torque) = (0.0, 0.0);
        for _ in 0..20_000 {
            let next = -stiffness * x - damping * v;
            for _ in 0..steps as u32 {
                // The trapezoidal rule.
                let after = if lag > 0.0 {
                    (torque * (lag - 0.5 * h) + h * command) / (lag + 0.5 * h)
                } else {
                    torque = command;
                    command
                };
                let mean = 0.5 * (torque + after);
                (x, v, torque) = (x + h * (v + 0.5 * h * mean), v + h * mean, after);
            }
            command = next;
            if !(x.abs() < 1.0e3) {
                return false;
            }
        }
        x.abs() < 1.0e-3
    }

    #[test]
    fn the_swings_on_the_border_separate_what_rests_from_what_does_not() {
        for lag in [0.0, 0.25, 0.5, 2.0] {
            for phi in [0.1, 0.2] {
                let unit = Sampled { period: 1.0, ..rig(lag, 0.0) };
                let [stiffness, damping] = unit.on_border(1.0, phi);
                // Nearer to the border a swing decays too slowly to wait for.
                assert!(rests(lag, 0.9 * stiffness, damping), "{lag} {phi}");
                assert!(!rests(lag, 1.1 * stiffness, damping), "{lag} {phi}");
            }
        }
    }

    /// Two axes with the same border have their zeros at one place, where the angle of the
    /// determinant turns by whole turns.
    #[test]
    fn equal_axes_are_as_stable_as_one() {
        let j = Vec3::new(J, 1.3 * J, 2.0 * J);
        let one = border(&Sampled { inertia: j, ..rig(5.0e-4, 0.0) }, 0.02, &HOLDS[0]);
        for inertia in [Vec3::splat(J), Vec3::new(J, J, 2.0 * J)] {
            let equal = border(&Sampled { inertia, ..rig(5.0e-4, 0.0) }, 0.02, &HOLDS[0]);
            // The heavier axes have their border a little higher.
            assert!((equal / one - 1.0).abs() < 0.02, "{inertia}: {equal}, {one}");
        }
    }

    #[test]
    fn a_matrix_in_any_frame_is_as_stable_as_in_its_axes() {
        let stiffness = Mat3::from_diagonal(Vec3::new(12.0, 3.0, 1.0));
        let damping = Mat3::from_diagonal(Vec3::new(0.02, 0.01, 0.01));
        let turn = Mat3::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7);
        for scale in [0.7, 0.9, 1.1, 1.5] {
            let plain = Scene { stiffness: stiffness * scale, damping, masses: Vec::new() };
            let turned = Scene {
                stiffness: turn * plain.stiffness * turn.transpose(),
                damping: turn * damping * turn.transpose(),
                masses: Vec::new(),
            };
            let stable = |scene: &Scene| rig(5.0e-4, 0.0).is_stable(scene, &HOLDS[0]);
            assert_eq!(stable(&plain), stable(&turned), "{scale}");
            assert_eq!(stable(&plain), scale < 0.86, "{scale}: 0.02 N m s/rad over 2 ms is 10 N m/rad");
        }
    }

    #[test]
    fn damping_alone_is_stable_up_to_j_over_h() {
        let loop_ = rig(0.0, 0.0);
        let most = J / loop_.period;
        for (part, stable) in [(0.5, true), (0.97, true), (1.03, false), (40.0, false)] {
            for directions in [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE] {
                let damping = Mat3::from_diagonal(directions * (part * most));
                let scene = Scene { stiffness: Mat3::ZERO, damping, masses: Vec::new() };
                assert_eq!(loop_.is_stable(&scene, &HOLDS[0]), stable, "{damping}");
            }
        }
    }

    #[test]
    fn a_place_from_which_the_sphere_rolls_away_does_not_shake() {
        for directions in [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE] {
            let ridge = Scene { stiffness: Mat3::from_diagonal(directions * -5.0), ..spring(0.0, 0.02) };
            assert!(rig(5.0e-4, 0.0).is_stable(&ridge, &HOLDS[0]), "{directions}");
        }
        let saddle =
            Scene { stiffness: Mat3::from_diagonal(Vec3::new(-5.0, 40.0, 0.0)), ..spring(0.0, 0.02) };
        assert!(!rig(5.0e-4, 0.0).is_stable(&saddle, &HOLDS[0]), "about n2 it shakes");
    }

    /// The borders of the whole loop with filters of 200, 400 and 1000 Hz (2/w with w = 2 pi
    /// f/2.48) at a lag of 0.8 ms, of a one-axis model that was written independently.
    #[test]
    fn filters_of_the_encoders_lower_the_border() {
        for (filter_hz, wants) in [(200.0, [8.02, 46.46]), (400.0, [8.45, 66.19]), (1000.0, [8.60, 77.71])] {
            let rate_lag = 2.0 / (std::f64::consts::TAU * filter_hz / 2.48);
            let rig = Sampled { rate_lag, inertia: Vec3::splat(3.396e-3), ..rig(8.0e-4, 0.0) };
            for (damping, want) in [0.02, 0.2].into_iter().zip(wants) {
                let found = border(&rig, damping, &HOLDS[0]);
                assert!((found / want - 1.0).abs() < 0.02, "{filter_hz} Hz, {damping}: {found}, not {want}");
            }
        }
    }

    /// The difference of two readings is the mean rate over the tick before the newest, so it is
    /// half a tick late.
    #[test]
    fn rates_from_angles_are_late() {
        let difference = Sampled { taps: vec![1.0e3, -1.0e3], ..rig(5.0e-4, 0.0) };
        let exact = border(&rig(5.0e-4, 0.0), 0.05, &HOLDS[0]);
        let late = border(&difference, 0.05, &HOLDS[0]);
        // To first order a rate that is late by t adds B t to the inertia, so the border does not
        // move. To the next order it falls.
        assert!(late < exact && late > 0.9 * exact, "{late} {exact}");
    }
}
