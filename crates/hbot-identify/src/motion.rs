//! The motion of the joints in a recording, cut into short windows that overlap.
//!
//! A window weighs its steps by a smooth bump (a Hann window), which is zero at both ends. So the
//! rounding of the counts at the ends of a window has no effect, and that of all readings between
//! averages out. A window is long relative to a count and short relative to the time in which the
//! hand changes its mind.

use std::f64::consts::TAU;

use hbot_core::{MAX_JOINTS, Rig};

/// The encoder counts of all joints at one moment, in the order of the rig and with the sign of
/// their motor controllers. They include the zero offsets of the rig file.
pub type Counts = [i32; MAX_JOINTS];

/// Time of a step, s: over it, the joints move along a line.
const STEP_S: f64 = 0.001;
/// Length of a window, s.
const WINDOW_S: f64 = 0.25;
/// A window counts as moving if a drive joint turns by at least this angle in it, rad.
const MOVING: f64 = 0.05;

/// The motion of all joints, in parts that are each without a gap.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Number of joints.
    pub(crate) joints: usize,
    /// Joint angles of each part, rad: those of all joints for one moment after another.
    parts: Vec<Vec<f64>>,
    /// The weights of the steps of a window.
    pub(crate) bump: Vec<f64>,
    /// Time of a step, s.
    pub(crate) step_s: f64,
    /// Standard deviation of the rounding of one reading of each joint, rad.
    pub(crate) rounding: [f64; MAX_JOINTS],
}

/// One step of the motion.
#[derive(Debug, Clone, Copy)]
pub struct Step<'a> {
    /// Joint angles at the beginning and at the end of the step, rad.
    pub ends: [&'a [f64]; 2],
}

impl Motion {
    /// Creates the motion of the joints of `rig`. Each part of `parts` has readings that follow
    /// each other at intervals of `period_s`.
    #[must_use]
    pub fn new(rig: &Rig, parts: &[Vec<Counts>], period_s: f64) -> Self {
        let joints = rig.device.joints();
        let every = (STEP_S / period_s).round().max(1.0) as usize;
        let step_s = every as f64 * period_s;
        // An even number, so that windows overlap by half.
        let steps = 2 * (0.5 * WINDOW_S / step_s).round().max(2.0) as usize;
        let bump = (0..steps).map(|k| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / steps as f64).cos()).collect();
        let angle = |part: &Vec<Counts>| {
            let mut whole = part.first().map_or([0_i64; MAX_JOINTS], |first| first.map(i64::from));
            let mut last = part.first().copied().unwrap_or_default();
            let mut angles = Vec::with_capacity(joints * (part.len() / every + 1));
            for now in part.iter().step_by(every) {
                for j in 0..joints {
                    // Counts wrap at 32 bits, angles do not.
                    whole[j] += i64::from(now[j].wrapping_sub(last[j]));
                    angles.push(whole[j] as f64 * rig.joints[j].radians_per_count());
                }
                last = *now;
            }
            angles
        };
        let mut rounding = [0.0; MAX_JOINTS];
        for (j, rounding) in rounding.iter_mut().enumerate().take(joints) {
            *rounding = rig.joints[j].radians_per_count().abs() / 12.0_f64.sqrt();
        }
        Self { joints, parts: parts.iter().map(angle).collect(), bump, step_s, rounding }
    }

    /// Calls `each` for every step with the number of its part and its number in the part.
    pub(crate) fn each_step(&self, mut each: impl FnMut(usize, usize, Step<'_>)) {
        for (p, part) in self.parts.iter().enumerate() {
            for k in 0..self.steps_of(part) {
                let at = |k: usize| &part[k * self.joints..(k + 1) * self.joints];
                each(p, k, Step { ends: [at(k), at(k + 1)] });
            }
        }
    }

    fn steps_of(&self, part: &[f64]) -> usize {
        (part.len() / self.joints).saturating_sub(1)
    }

    /// Returns the number of steps from one window to the next.
    pub(crate) fn hop(&self) -> usize {
        self.bump.len() / 2
    }

    /// Returns the number of the first window of each part, and the number of all windows at the
    /// end.
    pub(crate) fn windows(&self) -> Vec<usize> {
        let mut starts = vec![0];
        for part in &self.parts {
            let windows = (self.steps_of(part) / self.hop()).saturating_sub(1);
            starts.push(starts[starts.len() - 1] + windows);
        }
        starts
    }

    /// Returns for each window whether the sphere moves in it.
    pub(crate) fn moving(&self) -> Vec<bool> {
        let starts = self.windows();
        let mut rolled = vec![0.0; starts[starts.len() - 1]];
        self.each_step(|p, k, step| {
            let drives = (1..self.joints).step_by(2);
            let most = drives.map(|j| (step.ends[1][j] - step.ends[0][j]).abs()).fold(0.0, f64::max);
            for (window, _) in self.places(&starts, p, k) {
                rolled[window] += most;
            }
        });
        rolled.into_iter().map(|angle| angle >= MOVING).collect()
    }

    /// Returns the windows that contain step `k` of part `p`, at most two, each with the number of
    /// the step in it. `starts` is the result of [`windows`](Self::windows).
    pub(crate) fn places(
        &self,
        starts: &[usize],
        p: usize,
        k: usize,
    ) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (hop, first, end) = (self.hop(), starts[p], starts[p + 1]);
        let half = k / hop;
        let own = (first + half < end).then_some((first + half, k % hop));
        let before = half
            .checked_sub(1)
            .filter(|before| first + before < end)
            .map(|before| (first + before, k % hop + hop));
        own.into_iter().chain(before)
    }

    /// Returns the numbers of the joints whose counts have hardly changed.
    pub(crate) fn still(&self) -> Vec<usize> {
        let moved = |j: usize| {
            let of = |part: &Vec<f64>| {
                let angles = || part.iter().skip(j).step_by(self.joints).copied();
                angles().fold(f64::MIN, f64::max) - angles().fold(f64::MAX, f64::min)
            };
            // Two counts: an encoder at rest can jitter by one.
            let least = 2.5 * 12.0_f64.sqrt() * self.rounding[j];
            self.parts.iter().any(|part| !part.is_empty() && of(part) > least)
        };
        (0..self.joints).filter(|j| !moved(*j)).collect()
    }
}
