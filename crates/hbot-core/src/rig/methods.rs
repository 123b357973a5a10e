//! The methods that a controller uses where accuracy can be traded for time.

use super::legal::{self, RigError};
use crate::device::Device;
use crate::real::Real;

/// The choice of a method for each stage that can trade accuracy for time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Methods {
    /// Method that integrates the orientation from one reading to the next.
    pub odometry: OdometryMethod,
    /// Curve that is assumed for the joints between two readings.
    pub path: PathFit,
    /// Method that converts a torque on the sphere to joint torques.
    pub allocation: AllocationMethod,
    /// Source of the joint rates.
    pub rate: RateEstimate,
    /// Limit for the passivity controller, which keeps the energy given out within what came in.
    /// `None`: the energy is only observed.
    pub passivity: Option<PassivityLimit>,
}

impl Methods {
    /// The methods with the shortest time per tick.
    pub const FAST: Self = Self { odometry: OdometryMethod::Euler, ..Self::BALANCED };
    /// The default methods.
    pub const BALANCED: Self = Self {
        odometry: OdometryMethod::Midpoint,
        path: PathFit::Straight,
        allocation: AllocationMethod::Exact,
        rate: RateEstimate::Controller,
        passivity: None,
    };
    /// The methods with the smallest error.
    pub const EXACT: Self =
        Self { odometry: OdometryMethod::Magnus4, path: PathFit::Cubic, ..Self::BALANCED };
}

impl Default for Methods {
    /// Returns [`BALANCED`](Self::BALANCED).
    fn default() -> Self {
        Self::BALANCED
    }
}

impl Methods {
    pub(super) fn checks(&self) -> [Option<RigError>; 5] {
        let [first, second] = match self.rate {
            RateEstimate::Controller | RateEstimate::Difference => [None, None],
            RateEstimate::LowPass { cutoff_hz } => {
                [legal::CUTOFF_HZ.check("methods.rate.cutoff_hz", cutoff_hz), None]
            }
            RateEstimate::AdaptiveWindow { tolerance_counts, longest_ticks } => [
                legal::TOLERANCE_COUNTS.check("methods.rate.tolerance_counts", tolerance_counts as Real),
                legal::LONGEST_TICKS.check("methods.rate.longest_ticks", longest_ticks as Real),
            ],
            RateEstimate::Kalman { acceleration } => {
                [legal::ACCELERATION.check("methods.rate.acceleration", acceleration), None]
            }
        };
        let [allowance, store, damping] = self.passivity.map_or([None; 3], |limit| {
            [
                legal::ALLOWANCE.check("methods.passivity.allowance", limit.allowance),
                legal::STORE.check("methods.passivity.store", limit.store),
                legal::DAMPING.check("methods.passivity.damping", limit.damping),
            ]
        });
        [first, second, allowance, store, damping]
    }
}

/// A method that integrates the orientation over one step of the joints (physics notes, section 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum OdometryMethod {
    /// Contact frames at the start of the step: order 1.
    Euler,
    /// Contact frames at the steer angles in mid-step: order 2.
    Midpoint,
    /// Two Gauss points and their commutator: order 4.
    Magnus4,
}

impl OdometryMethod {
    /// All methods, by rising order.
    pub const ALL: [Self; 3] = [Self::Euler, Self::Midpoint, Self::Magnus4];

    /// Returns the method's name in rig files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Euler => "euler",
            Self::Midpoint => "midpoint",
            Self::Magnus4 => "magnus4",
        }
    }
}

/// The curve that is assumed for the joints between two readings: a polynomial in time through the
/// last readings (physics notes, section 4).
///
/// It is evaluated over the last interval, which is between readings that it passes through. So
/// nothing is extrapolated, and nothing is a tick late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum PathFit {
    /// A straight line through the last two readings.
    Straight,
    /// A quadratic through the last three readings.
    Quadratic,
    /// A cubic through the last four readings.
    Cubic,
}

impl PathFit {
    /// All fits, by rising order.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Quadratic, Self::Cubic];

    /// Returns the fit's name in rig files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Quadratic => "quadratic",
            Self::Cubic => "cubic",
        }
    }
}

/// A method that converts a torque on the sphere to joint torques (physics notes, section 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum AllocationMethod {
    /// Makes as much of the torque as the joints can make together.
    Exact,
    /// Takes the joint torques of least cost and scales all of them down if one exceeds its limit.
    /// It can give less torque, but never another direction.
    Clipped,
}

/// The source of the joint rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RateEstimate {
    /// The rates that the motor controllers report.
    Controller,
    /// The difference of the last two readings, divided by the time between them.
    Difference,
    /// The difference of the last two readings after a first-order low-pass filter.
    LowPass {
        /// Cut-off frequency, at which the gain is 1/sqrt 2, Hz.
        cutoff_hz: Real,
    },
    /// For each joint, the longest chord back from the last reading that passes within a tolerance
    /// of every reading in between (Janabi-Sharifi et al. 2000).
    AdaptiveWindow {
        /// Largest distance of a reading from the chord, counts. With 1, every steady motion
        /// passes: rounding down moves each of the three readings by less than a count, in the same
        /// direction.
        tolerance_counts: u32,
        /// Longest duration of the chord, ticks; at most [`LONGEST_WINDOW`].
        longest_ticks: u32,
    },
    /// A Kalman filter of angle, rate and acceleration. The rounding of the counts is the noise of
    /// its readings (physics notes, section 9).
    Kalman {
        /// Root mean square of a joint's acceleration, rad/s².
        acceleration: Real,
    },
}

/// Longest possible duration of the adaptive window, ticks.
pub const LONGEST_WINDOW: u32 = 64;

/// The limit that the passivity controller keeps (physics notes, section 9).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassivityLimit {
    /// Energy that may be given out beyond what came in, J.
    pub allowance: Real,
    /// Largest amount of absorbed energy that is remembered, J. It must cover the energy that
    /// springs store when they are wound, or they could not return it. Energy absorbed beyond this
    /// was dissipated and does not count.
    pub store: Real,
    /// Largest damping that is added, N m s/rad.
    pub damping: Real,
}

impl PassivityLimit {
    /// Returns suitable values for `device` in a loop of `period_s` seconds.
    ///
    /// 1 mJ may be given out and 0.5 J is remembered (a spring of 1 N m/rad with a torque of 0.9 N
    /// m stores 0.4 J). The damping is I_s / (4 h), with the sphere's inertia I_s and the period h.
    /// With it the sphere's rate, which is read a tick late, goes to zero as fast as possible
    /// without reversing (w' = w - 1/4 w_before has a double root). For loops faster than 1 kHz, h
    /// is taken as 1 ms, because the noise of the rates would become audible.
    #[must_use]
    pub fn of(device: &Device, period_s: Real) -> Self {
        let damping = 0.25 * device.sphere_inertia() / period_s.max(1.0e-3);
        Self { allowance: 1.0e-3, store: 0.5, damping }
    }
}
