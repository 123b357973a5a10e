//! Which methods a controller uses where accuracy can be traded for time.

use super::legal::{self, RigError};
use crate::device::Device;
use crate::real::Real;

/// The stages that can trade accuracy for time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Methods {
    /// How orientation is integrated from one reading to the next.
    pub odometry: OdometryMethod,
    /// What way the joints are taken to have gone between two readings.
    pub path: PathFit,
    /// How a torque on the sphere becomes joint torques.
    pub allocation: AllocationMethod,
    /// Where joint rates come from.
    pub rate: RateEstimate,
    /// Whether energy given out is held within what came in; `None`: it is only observed.
    pub passivity: Option<PassivityLimit>,
}

impl Methods {
    /// The least time a tick.
    pub const FAST: Self = Self { odometry: OdometryMethod::Euler, ..Self::BALANCED };
    /// The default.
    pub const BALANCED: Self = Self {
        odometry: OdometryMethod::Midpoint,
        path: PathFit::Straight,
        allocation: AllocationMethod::Exact,
        rate: RateEstimate::Controller,
        passivity: None,
    };
    /// The least error.
    pub const EXACT: Self =
        Self { odometry: OdometryMethod::Magnus4, path: PathFit::Cubic, ..Self::BALANCED };
}

impl Default for Methods {
    /// [`BALANCED`](Self::BALANCED).
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

/// How orientation is integrated over one step of the joints (physics notes, section 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum OdometryMethod {
    /// Contact frames at the step's start: order 1.
    Euler,
    /// Contact frames at the mid steering angles: order 2.
    Midpoint,
    /// Two Gauss points and their commutator: order 4.
    Magnus4,
}

impl OdometryMethod {
    /// Every method, by rising order.
    pub const ALL: [Self; 3] = [Self::Euler, Self::Midpoint, Self::Magnus4];

    /// Its name in rig files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Euler => "euler",
            Self::Midpoint => "midpoint",
            Self::Magnus4 => "magnus4",
        }
    }
}

/// The way of the joints between two readings: a polynomial in time through the last ones (physics notes, section 4).
///
/// It is evaluated over the last interval, which lies inside the readings that it goes through: nothing is
/// extrapolated, and nothing comes a tick late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum PathFit {
    /// Through the last two readings.
    Straight,
    /// Through the last three.
    Quadratic,
    /// Through the last four.
    Cubic,
}

impl PathFit {
    /// Every fit, by rising order.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Quadratic, Self::Cubic];

    /// Its name in rig files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Quadratic => "quadratic",
            Self::Cubic => "cubic",
        }
    }
}

/// How a torque on the sphere becomes joint torques (physics notes, section 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum AllocationMethod {
    /// As much of the torque as the joints can make together.
    Exact,
    /// The joint torques of least cost, scaled as a whole where one is over its limit: perhaps less torque, never another
    /// direction.
    Clipped,
}

/// Where joint rates come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RateEstimate {
    /// As the motor controllers report them.
    Controller,
    /// The difference of the last two readings over the time between them.
    Difference,
    /// That difference through a low pass of first order.
    LowPass {
        /// Where it has fallen to 1/sqrt 2, Hz.
        cutoff_hz: Real,
    },
    /// Per joint, the longest chord back from the last reading that passes within a tolerance of every reading between
    /// (Janabi-Sharifi et al. 2000).
    AdaptiveWindow {
        /// How far a reading may be off the chord, counts. 1 lets every steady motion pass: flooring moves each of the
        /// three readings concerned by less than a count in one direction.
        tolerance_counts: u32,
        /// How far back the chord may reach, ticks; at most [`LONGEST_WINDOW`].
        longest_ticks: u32,
    },
    /// A Kalman filter of angle, rate and acceleration with the counts' rounding as the noise of its readings (physics
    /// notes, section 9).
    Kalman {
        /// Root mean square of a joint's acceleration, rad/s².
        acceleration: Real,
    },
}

/// The furthest that the adaptive window reaches back, ticks.
pub const LONGEST_WINDOW: u32 = 64;

/// What the passivity controller keeps to (physics notes, section 9).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassivityLimit {
    /// Energy that may be given out beyond what came in, J.
    pub allowance: Real,
    /// The most that is remembered of energy that came in, J: what springs hold when they are wound, or they could not give it
    /// back. What was taken in beyond it was dissipated and does not count.
    pub store: Real,
    /// The most damping that is added, N m s/rad.
    pub damping: Real,
}

impl PassivityLimit {
    /// What suits `device` in a loop of `period_s` seconds.
    ///
    /// 1 mJ may be given out; half a joule is remembered (0.9 N m at 1 N m/rad hold 0.4 J). The damping is I_s / (4 h), with which
    /// the sphere's rate, read a tick late, goes to zero the quickest way without turning back (w' = w - 1/4 w_before has a double
    /// root); h is taken as 1 ms where the loop is quicker, or the noise of rates would be heard.
    #[must_use]
    pub fn of(device: &Device, period_s: Real) -> Self {
        let damping = 0.25 * device.sphere_inertia() / period_s.max(1.0e-3);
        Self { allowance: 1.0e-3, store: 0.5, damping }
    }
}
