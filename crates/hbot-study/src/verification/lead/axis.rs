//! One axis in a loop whose readings come late or not at all, with motors that follow with a lag.

use crate::rng::Rng;

/// When the readings of a loop arrive, and which commands do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Line {
    /// Each reading is one tick old when its torque begins to act.
    Punctual,
    /// Every tenth reading comes one tick late.
    TenthLate,
    /// An exchange is lost with this probability: its command, and the reading that answers it.
    Lost(f64),
    /// Readings are handed over together each time this many ticks have passed, as by a USB adapter
    /// with a latency timer.
    Together(u32),
}

/// One axis: its inertia, its spring, and the loop that renders the spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    /// Inertia, kg m².
    pub(super) inertia: f64,
    /// Period of the loop, s.
    pub(super) period: f64,
    /// Time constant with which the torque follows its command, s.
    pub(super) lag: f64,
    /// Ratio of the lead to the delay from a reading to its torque. 0 without a lead.
    pub(super) factor: f64,
    /// Longest lead, s.
    pub(super) longest: f64,
    /// Damping of the spring, N m s/rad.
    pub(super) damping: f64,
    pub(super) line: Line,
}

/// Number of readings that are remembered. No reading that is used is older.
const REMEMBERED: usize = 64;
/// Number of ticks in which a swing grows or dies.
const TICKS: usize = 40_000;

impl Axis {
    /// Returns the largest stiffness below which all swings die, N m/rad. Stiffnesses of a
    /// geometric series are tried, and the border is refined to a thousandth.
    pub(super) fn border(&self) -> f64 {
        let (mut low, ratio) = (0.05, 1.04);
        while low < 2.0e3 && self.growth(low * ratio) < 0.0 {
            low *= ratio;
        }
        let mut high = low * ratio;
        while high - low > 1.0e-3 * low {
            let middle = (low * high).sqrt();
            if self.growth(middle) < 0.0 { low = middle } else { high = middle }
        }
        low
    }

    /// Returns the mean growth of a swing on a spring of `stiffness` in a tick. Negative if it
    /// dies.
    pub(super) fn growth(&self, stiffness: f64) -> f64 {
        let Self { inertia: j, period: h, lag, .. } = *self;
        // The exact solution of a tick with a constant command u: J dv/dt = i, lag di/dt = u - i.
        let lag = lag.max(1.0e-9);
        let left = libm::exp(-h / lag);
        let once = lag * (1.0 - left);
        let twice = lag * (h - once);
        let (mut x, mut v, mut torque, mut command) = (1.0, 0.0, 0.0, 0.0);
        let mut readings = [(0.0, 0.0); REMEMBERED];
        let mut heard = 1;
        let mut rng = Rng(17);
        // The logarithm of the size, less that of the first.
        let mut log = -0.5 * libm::log(stiffness);
        for tick in 2..TICKS {
            let is_lost = matches!(self.line, Line::Lost(part) if rng.unit() < part);
            let newest = match self.line {
                Line::TenthLate if tick % 10 == 1 => tick - 2,
                Line::Together(ticks) => (tick - 1) / ticks as usize * ticks as usize,
                Line::Punctual | Line::TenthLate | Line::Lost(_) => heard,
            };
            readings[tick % REMEMBERED] = (x, v);
            // A lost exchange leaves the torque as it was, and brings no reading.
            if !is_lost {
                let age = (tick - newest) as f64;
                let (angle, rate) = readings[newest % REMEMBERED];
                let lead = (self.factor * ((age + 0.5) * h + lag)).min(self.longest);
                command = -stiffness * (angle + lead * rate) - self.damping * rate;
                heard = tick;
            }
            x += h * v + (twice * torque + (0.5 * h * h - twice) * command) / j;
            v += (once * torque + (h - once) * command) / j;
            torque = left * torque + (1.0 - left) * command;
            let size = libm::sqrt(stiffness * x * x + j * v * v + torque * torque + command * command);
            // All numbers of the state are divided by one, which a linear loop does not notice.
            if !(1.0e-3..1.0e3).contains(&size) || tick + 1 == TICKS {
                log += libm::log(size);
                (x, v, torque, command) = (x / size, v / size, torque / size, command / size);
                readings.iter_mut().for_each(|(a, b)| (*a, *b) = (*a / size, *b / size));
            }
        }
        log / TICKS as f64
    }
}
