//! Finds the unknowns that explain a motion best: weighted least squares by Levenberg and
//! Marquardt, with the derivatives of [`model`](crate::model).
//!
//! Each window gives one residual for each joint. Windows in which a wheel slips, or in which a
//! gear crosses its play, fit to no geometry. They get less weight, and none at all if they are far
//! off (Tukey's biweight). The drawing is one more observation: each unknown is 0 with its usual
//! deviation as standard deviation. It decides about what the motion does not show.
//!
//! The covariance is estimated by leaving out one block of windows after another (the jackknife),
//! because the errors of neighbouring windows are related, and because the rounding of counts at a
//! slow motion is not noise.

use hbot_core::{MAX_JOINTS, Rig, Vec3};

use crate::identify::twist;
use crate::interval::ninety_five;
use crate::matrix::Square;
use crate::model::{Model, Residual};
use crate::motion::Motion;
use crate::parameter::{OF_SPHERE, OF_WHEEL, Quantity, all};

/// Largest number of improvements.
const MOST_STEPS: usize = 40;
/// The fit ends when no unknown changes by more than this fraction of its usual deviation.
const ENOUGH: f64 = 1.0e-4;
/// Distance, in standard deviations, from which on a window gets no weight.
const REJECTED: f64 = 4.7;
/// Distance, in standard deviations, from which on a window gets less weight in the first steps,
/// when the guess is still far off and most windows fit badly.
const HUBER: f64 = 1.5;
/// Number of first steps.
const FIRST: usize = 4;
/// Length of a block of windows whose errors count as related, s.
const BLOCK_S: f64 = 2.0;
/// Least number of blocks: one alone has no scatter. Those of a short motion are shorter for it.
const LEAST_BLOCKS: usize = 8;
/// The least rounding relative to that of counts that are spread evenly. Rounding errors of slow
/// joints are related, so averages can be more exact than that.
const LEAST_SCALE: f64 = 0.2;

/// Which unknowns a fit is free to choose. The others stay as drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Free {
    /// The geometry of the wheels, and the errors of the steer encoders.
    Geometry,
    /// The same, and the offset of the sphere's centre.
    GeometryAndCentre,
    /// The steering zeros alone.
    Zeros,
    /// The zeros, cones and radii.
    ZerosConesAndRadii,
}

impl Free {
    fn has(self, quantity: Quantity) -> bool {
        match self {
            Self::Geometry => !matches!(quantity, Quantity::Centre(_)),
            Self::GeometryAndCentre => true,
            Self::Zeros => quantity == Quantity::Zero,
            Self::ZerosConesAndRadii => {
                matches!(quantity, Quantity::Zero | Quantity::Cone | Quantity::Radius)
            }
        }
    }
}

/// The sums over the steps of each window.
#[derive(Debug, Clone, Default)]
struct Windows {
    residual: Vec<[f64; MAX_JOINTS]>,
    by: Vec<Vec<[f64; MAX_JOINTS]>>,
    /// Largest slip and largest rolling distance of a wheel, m.
    slip: Vec<f64>,
    rolled: Vec<f64>,
    /// Turn of the sphere in all windows, without sign, about n1, n2 and n3, rad.
    turned: Vec3,
}

/// What a fit has found.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The unknowns, in the order of [`all`].
    pub unknowns: Vec<f64>,
    /// Their covariance, by rows.
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviation of each unknown if the turn of the whole frame were known.
    pub relative: Vec<f64>,
    /// Slip divided by rolling distance, root mean square over the windows that count.
    pub share: f64,
    /// Median over all moving windows of slip divided by rolling distance.
    pub median_share: f64,
    /// Fraction of the moving windows that get no weight.
    pub left_out: f64,
    /// How much the sphere has turned about n1, n2 and n3 in all, rad.
    pub turned: Vec3,
    /// Time during which the sphere moved, s.
    pub moving_s: f64,
    /// Half the width of an interval that holds the truth in 95 % of the cases, in standard
    /// deviations: Student's quantile for the number of blocks that give the covariance.
    pub quantile: f64,
}

/// Where a fit begins, and what it expects of the steering zeros.
#[derive(Debug, Clone, Copy)]
pub struct Begin<'a> {
    /// The unknowns of another fit, or `None` for the drawing.
    pub from: Option<&'a [f64]>,
    /// Usual deviation of a steering zero, rad.
    pub zero: f64,
}

/// Fits the unknowns of `free` to the motion `motion` of `rig`, a rig as drawn. Calls `progress`
/// before each improvement with its number and the largest number that there can be.
///
/// Returns `None` if the sphere does not move, or if the guess becomes impossible.
pub fn fit(
    rig: &Rig,
    motion: &Motion,
    free: Free,
    begin: Begin<'_>,
    progress: &mut dyn FnMut(usize, usize),
) -> Option<Fitted> {
    let Begin { from, zero } = begin;
    let quantities: Vec<(Option<usize>, Quantity)> = all(rig.device.wheels().len()).collect();
    let n = quantities.len();
    let chosen: Vec<usize> = (0..n).filter(|k| free.has(quantities[*k].1)).collect();
    let usual = |quantity: &Quantity| if *quantity == Quantity::Zero { zero } else { quantity.usual() };
    let usual: Vec<f64> = quantities.iter().map(|(_, it)| usual(it)).collect();
    let moving = motion.moving();
    let count = moving.iter().filter(|moving| **moving).count();
    if count == 0 {
        return None;
    }
    let drawn = drawn(rig, &usual, &chosen);
    let mut fitting = Fitting { rig, motion, moving, usual, chosen, drawn, unknowns: vec![0.0; n] };
    if let Some(from) = from {
        fitting.unknowns.copy_from_slice(from);
    }
    // From the result of another fit on, most windows fit well.
    let first = if from.is_some() { 0 } else { FIRST };
    let mut windows = fitting.windows(&fitting.unknowns, true);
    let (mut damping, mut step) = (1.0e-6, 0);
    while step < MOST_STEPS {
        progress(step, MOST_STEPS);
        let scale = fitting.scale(&windows);
        let weights = fitting.weights(&windows, scale, step < first);
        let (normal, slope) = fitting.normal(&windows, &weights, scale);
        let here = fitting.cost(&windows, &weights, scale, &fitting.unknowns);
        let mut better = None;
        while better.is_none() && damping < 1.0e6 {
            let mut damped = normal.clone();
            (0..slope.len()).for_each(|k| damped.add(k, k, damping * normal.at(k, k)));
            let change = damped.factor()?.solve(&slope);
            let mut next = fitting.unknowns.clone();
            fitting.chosen.iter().zip(&change).for_each(|(k, change)| next[*k] -= change);
            let then = fitting.windows(&next, true);
            if fitting.cost(&then, &weights, scale, &next) <= here * (1.0 + 1.0e-9) {
                let most = fitting.chosen.iter().zip(&change).map(|(k, c)| c.abs() / fitting.usual[*k]);
                better = Some((next, then, most.fold(0.0, f64::max)));
                damping = (damping * 0.1).max(1.0e-9);
            } else {
                damping = (damping * 10.0).max(1.0e-4);
            }
        }
        let Some((next, then, most)) = better else { break };
        (fitting.unknowns, windows) = (next, then);
        step += 1;
        if most < ENOUGH && step > first {
            break;
        }
    }
    fitting.finish(free, &windows)
}

/// Returns what the drawing says of the free unknowns `chosen`, as rows of unit standard deviation.
/// Each unknown is near 0 by its usual deviation, except the zero: the zero of a rig file is near
/// that of the drawing, and a tilt of the axis turns the frame from which it is measured.
fn drawn(rig: &Rig, usual: &[f64], chosen: &[usize]) -> Vec<Vec<f64>> {
    const H: f64 = 1.0e-6;
    let place = |k: usize| chosen.iter().position(|other| *other == k);
    let mut rows = Vec::new();
    for (at, k) in chosen.iter().enumerate() {
        let mut row = vec![0.0; chosen.len()];
        row[at] = 1.0 / usual[*k];
        let (wheel, of) = (k / OF_WHEEL, k % OF_WHEEL);
        let is_zero = Quantity::OF_WHEEL[of] == Quantity::Zero && wheel < rig.device.wheels().len();
        for tilt in (0..2).filter(|_| is_zero) {
            if let Some(at) = place(OF_WHEEL * wheel + tilt) {
                let mut unknowns = [0.0; OF_WHEEL];
                unknowns[tilt] = H;
                row[at] = twist(&rig.device, wheel, &unknowns) / H / usual[*k];
            }
        }
        rows.push(row);
    }
    rows
}

/// A fit that runs.
struct Fitting<'a> {
    rig: &'a Rig,
    motion: &'a Motion,
    moving: Vec<bool>,
    usual: Vec<f64>,
    /// The unknowns that are free.
    chosen: Vec<usize>,
    /// What the drawing says: each of these rows times the free unknowns has the mean 0 and the
    /// standard deviation 1.
    drawn: Vec<Vec<f64>>,
    unknowns: Vec<f64>,
}

impl Fitting<'_> {
    /// Adds up the steps of all windows for a guess.
    fn windows(&self, unknowns: &[f64], derivatives: bool) -> Windows {
        let (motion, starts) = (self.motion, self.motion.windows());
        let count = self.moving.len();
        let model = Model::new(self.rig, unknowns, &motion.rounding);
        // What the rounding of one reading, spread over the bump, does to a window.
        let edge = |k: usize| motion.bump.get(k).copied().unwrap_or(0.0);
        let gain = (0..=motion.bump.len())
            .map(|k| (edge(k) - if k > 0 { edge(k - 1) } else { 0.0 }).powi(2))
            .sum::<f64>()
            .sqrt();
        let known = if derivatives { unknowns.len() } else { 0 };
        let mut out = Residual::new(known);
        let mut all = Windows {
            residual: vec![[0.0; MAX_JOINTS]; count],
            by: vec![vec![[0.0; MAX_JOINTS]; known]; count],
            slip: vec![0.0; count],
            rolled: vec![0.0; count],
            turned: Vec3::ZERO,
        };
        let wheels = self.rig.device.wheels().len();
        let mut slip = vec![[[0.0; 2]; hbot_core::MAX_WHEELS]; count];
        let mut turned = vec![Vec3::ZERO; count];
        let joints = motion.joints;
        motion.each_step(|p, k, step| {
            model.residual(step, &mut out);
            for (window, place) in motion.places(&starts, p, k) {
                let weight = motion.bump[place];
                turned[window] += out.turn * weight;
                let share = weight / gain;
                for (sum, value) in all.residual[window][..joints].iter_mut().zip(&out.value) {
                    *sum += share * value;
                }
                for (sum, by) in all.by[window].iter_mut().zip(&out.by) {
                    for (sum, by) in sum[..joints].iter_mut().zip(by) {
                        *sum += share * by;
                    }
                }
                for (sum, slip) in slip[window].iter_mut().zip(&out.slip).take(wheels) {
                    *sum = [sum[0] + weight * slip[0], sum[1] + weight * slip[1]];
                }
                let rolled = out.rolled[..wheels].iter().copied().fold(0.0, f64::max);
                all.rolled[window] += weight * rolled;
            }
        });
        // The bumps add up to 1, so the turns of all windows add up to the turn of the motion.
        all.turned = turned.iter().fold(Vec3::ZERO, |sum, turn| sum + turn.abs());
        for (sum, slip) in all.slip.iter_mut().zip(&slip) {
            *sum = slip[..wheels].iter().map(|[u, v]| u.hypot(*v)).fold(0.0, f64::max);
        }
        all
    }

    /// Number of residuals of a window that are independent.
    fn freedom(&self) -> f64 {
        (self.motion.joints - 3) as f64
    }

    fn square(residual: &[f64; MAX_JOINTS]) -> f64 {
        residual.iter().map(|x| x * x).sum()
    }

    /// Returns the typical residual of a moving window, relative to evenly spread rounding errors.
    fn scale(&self, windows: &Windows) -> f64 {
        let moving = windows.residual.iter().zip(&self.moving).filter(|(_, moving)| **moving);
        let squares: Vec<f64> = moving.map(|(residual, _)| Self::square(residual)).collect();
        let nu = self.freedom();
        // The median of a chi-squared variable (Wilson and Hilferty 1931).
        let usual = nu * (1.0 - 2.0 / (9.0 * nu)).powi(3);
        (median(squares) / usual).sqrt().max(LEAST_SCALE)
    }

    /// Returns the weight of each window.
    fn weights(&self, windows: &Windows, scale: f64, first: bool) -> Vec<f64> {
        let far = |residual: &[f64; MAX_JOINTS]| (Self::square(residual) / self.freedom()).sqrt() / scale;
        windows
            .residual
            .iter()
            .map(|residual| {
                let far = far(residual);
                if first {
                    (HUBER / far).min(1.0)
                } else if far < REJECTED {
                    (1.0 - (far / REJECTED).powi(2)).powi(2)
                } else {
                    0.0
                }
            })
            .collect()
    }

    /// Returns a row times the free ones of `unknowns`.
    fn times(&self, row: &[f64], unknowns: &[f64]) -> f64 {
        row.iter().zip(&self.chosen).map(|(row, k)| row * unknowns[*k]).sum()
    }

    fn cost(&self, windows: &Windows, weights: &[f64], scale: f64, unknowns: &[f64]) -> f64 {
        let seen: f64 = windows.residual.iter().zip(weights).map(|(r, w)| w * Self::square(r)).sum();
        let drawn: f64 = self.drawn.iter().map(|row| self.times(row, unknowns).powi(2)).sum();
        seen / (scale * scale) + drawn
    }

    /// Returns the matrix of the normal equations, and half the gradient of the cost, of the free
    /// unknowns.
    fn normal(&self, windows: &Windows, weights: &[f64], scale: f64) -> (Square, Vec<f64>) {
        let mut normal = Square::zero(self.chosen.len());
        let mut slope = vec![0.0; self.chosen.len()];
        let joints = self.motion.joints;
        let mut row = vec![0.0; self.chosen.len()];
        for (w, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            let factor = weight / (scale * scale);
            for j in 0..joints {
                self.chosen.iter().zip(&mut row).for_each(|(k, row)| *row = windows.by[w][*k][j]);
                normal.add_outer(&row, factor);
                let residual = factor * windows.residual[w][j];
                slope.iter_mut().zip(&row).for_each(|(slope, row)| *slope += row * residual);
            }
        }
        for row in &self.drawn {
            normal.add_outer(row, 1.0);
            let off = self.times(row, &self.unknowns);
            slope.iter_mut().zip(row).for_each(|(slope, row)| *slope += row * off);
        }
        (normal, slope)
    }

    /// Returns the covariance of the unknowns by leaving out one block of windows after another
    /// (the jackknife), and that of what was drawn. In contrast to the scatter of the gradients, it
    /// knows that a block pulls the unknowns towards itself (MacKinnon and White 1985). Returns the
    /// number of blocks too.
    fn covariance(
        &self,
        windows: &Windows,
        weights: &[f64],
        scale: f64,
        normal: &Square,
    ) -> Option<(Square, f64)> {
        let size = self.chosen.len();
        let usual = (BLOCK_S / (self.motion.step_s * self.motion.hop() as f64)).round() as usize;
        let moving = self.moving.iter().filter(|moving| **moving).count();
        let length = usual.min(moving / LEAST_BLOCKS).max(1);
        let mut blocks = 0.0;
        let mut scatter = Square::zero(size);
        let mut row = vec![0.0; size];
        for first in (0..weights.len()).step_by(length) {
            let mut gradient = vec![0.0; size];
            let mut without = normal.clone();
            let block = first..(first + length).min(weights.len());
            blocks += f64::from(u8::from(block.clone().any(|w| weights[w] > 0.0 && self.moving[w])));
            for w in block.filter(|w| weights[*w] > 0.0) {
                let factor = weights[w] / (scale * scale);
                for j in 0..self.motion.joints {
                    self.chosen.iter().zip(&mut row).for_each(|(k, row)| *row = windows.by[w][*k][j]);
                    without.add_outer(&row, -factor);
                    let residual = factor * windows.residual[w][j];
                    gradient.iter_mut().zip(&row).for_each(|(sum, row)| *sum += row * residual);
                }
            }
            // What is left contains the drawing, so it is positive definite.
            scatter.add_outer(&without.factor()?.solve(&gradient), 1.0);
        }
        let inverse = normal.factor()?.inverse();
        let mut drawn = Square::zero(size);
        self.drawn.iter().for_each(|row| drawn.add_outer(row, 1.0));
        let mut covariance = inverse.product(&drawn).product(&inverse);
        let share = (blocks - 1.0_f64).max(0.0) / f64::max(blocks, 1.0);
        for i in 0..size {
            for j in 0..size {
                covariance.add(i, j, share * scatter.at(i, j));
            }
        }
        Some((covariance, blocks))
    }

    fn finish(self, free: Free, windows: &Windows) -> Option<Fitted> {
        let scale = self.scale(windows);
        let weights = self.weights(windows, scale, false);
        let (normal, _) = self.normal(windows, &weights, scale);
        let (covariance, blocks) = self.covariance(windows, &weights, scale, &normal)?;
        // The turns of the whole frame count as known. Zeros alone do not turn it.
        let mut pinned = normal.clone();
        if free.has(Quantity::Tilt(0)) {
            for turn in self.turns_of_the_frame() {
                pinned.add_outer(&turn, 1.0e8 * crate::parameter::ANGLE.powi(-2));
            }
        }
        let relative = pinned.factor()?.inverse();
        let n = self.unknowns.len();
        let place = |k: usize| self.chosen.iter().position(|other| *other == k);
        let of = |matrix: &Square, a: usize, b: usize| match (place(a), place(b)) {
            (Some(i), Some(j)) => matrix.at(i, j),
            _ => 0.0,
        };
        let moving = || weights.iter().enumerate().filter(|(w, _)| self.moving[*w]);
        let count = moving().count();
        let counted = || moving().filter(|(_, weight)| **weight > 0.0);
        let sum = |of: &[f64]| counted().map(|(w, _)| of[w] * of[w]).sum::<f64>();
        let shares = moving().map(|(w, _)| windows.slip[w] / windows.rolled[w].max(1.0e-12)).collect();
        Some(Fitted {
            covariance: (0..n).map(|a| (0..n).map(|b| of(&covariance, a, b)).collect()).collect(),
            relative: (0..n).map(|a| of(&relative, a, a).max(0.0).sqrt()).collect(),
            share: (sum(&windows.slip) / sum(&windows.rolled).max(f64::MIN_POSITIVE)).sqrt(),
            median_share: median(shares),
            left_out: 1.0 - counted().count() as f64 / count as f64,
            turned: windows.turned,
            moving_s: count as f64 * self.motion.step_s * self.motion.hop() as f64,
            quantile: ninety_five(blocks - 1.0),
            unknowns: self.unknowns,
        })
    }

    /// Returns the three directions of the free unknowns in which the whole frame turns.
    fn turns_of_the_frame(&self) -> Vec<Vec<f64>> {
        let device = &self.rig.device;
        let mut turns = Vec::new();
        for axis in Vec3::AXES {
            let mut all = Vec::with_capacity(self.unknowns.len());
            for i in 0..device.wheels().len() {
                let turn = crate::model::frame_at_zero(device, i).transpose() * axis;
                all.extend([turn.x, turn.y, turn.z, 0.0, 0.0, 0.0, 0.0, 0.0]);
            }
            all.extend([0.0; OF_SPHERE]);
            let turn: Vec<f64> = self.chosen.iter().map(|k| all[*k]).collect();
            let length = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
            turns.push(turn.iter().map(|x| x / length.max(1.0e-12)).collect());
        }
        turns
    }
}

/// Returns the median of `values`, 0 if there are none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Returns slip divided by rolling distance with the geometry of `rig` as drawn, root mean square
/// over the windows in which the sphere moves.
#[must_use]
pub fn share_as_drawn(rig: &Rig, motion: &Motion) -> f64 {
    let n = crate::parameter::count(rig.device.wheels().len());
    let (chosen, moving) = (Vec::new(), motion.moving());
    let (usual, drawn, unknowns) = (Vec::new(), Vec::new(), vec![0.0; n]);
    let fitting = Fitting { rig, motion, moving, usual, chosen, drawn, unknowns };
    let windows = fitting.windows(&fitting.unknowns, false);
    let moving = || (0..fitting.moving.len()).filter(|w| fitting.moving[*w]);
    let sum = |of: &[f64]| moving().map(|w| of[w] * of[w]).sum::<f64>();
    (sum(&windows.slip) / sum(&windows.rolled).max(f64::MIN_POSITIVE)).sqrt()
}
