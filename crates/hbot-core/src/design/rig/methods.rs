//! The methods that a controller uses where accuracy can be traded for time.

use super::legal::{self, RigError};
use crate::design::device::Device;
use crate::real::Real;

/// The numerical method for each stage of a tick in which accuracy can be traded for computing
/// time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Methods {
    /// Method that integrates the orientation of the sphere from one reading to the next.
    pub odometry: OdometryMethod,
    /// Curve along which the joints are assumed to move between two readings.
    pub path: PathFit,
    /// Method that converts a torque on the sphere to joint torques.
    pub allocation: AllocationMethod,
    /// Source of the joint rates: the motor controllers, or an estimate from encoder counts.
    pub rate: RateEstimate,
    /// Energy limit that the passivity controller keeps. If `None`, there is no passivity
    /// controller, and the energy is only observed.
    pub passivity: Option<PassivityLimit>,
}

impl Methods {
    /// The methods that need the least computing time per tick.
    pub const FAST: Self = Self { odometry: OdometryMethod::Euler, ..Self::BALANCED };
    /// The default methods, a compromise between accuracy and computing time.
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
    /// Returns the default methods, [`BALANCED`](Self::BALANCED).
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

/// A method that integrates the sphere's orientation over one step from reading to reading (physics
/// notes, section 4). With order n, its error falls with the n-th power of the step length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(any(feature = "schema", feature = "exact"), derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(any(feature = "schema", feature = "exact"), serde(rename_all = "snake_case"))]
pub enum OdometryMethod {
    /// Euler's method: uses the contact frames at the start of the step. Order 1.
    Euler,
    /// Midpoint method: uses the contact frames at the steer angles in the middle of the step.
    /// Order 2.
    Midpoint,
    /// Magnus method: combines the rates at two Gauss points of the step and their commutator.
    /// Order 4.
    Magnus4,
}

impl OdometryMethod {
    /// All methods, in ascending order of accuracy.
    pub const ALL: [Self; 3] = [Self::Euler, Self::Midpoint, Self::Magnus4];

    /// Returns the name that rig files use for the method.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Euler => "euler",
            Self::Midpoint => "midpoint",
            Self::Magnus4 => "magnus4",
        }
    }
}

/// The curve along which the joints are assumed to move between two readings. It is a polynomial in
/// time through the last few readings (physics notes, section 4).
///
/// Only the part between the last two readings is used, and the curve passes through both of them.
/// So it never extrapolates and causes no delay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(any(feature = "schema", feature = "exact"), derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(any(feature = "schema", feature = "exact"), serde(rename_all = "snake_case"))]
pub enum PathFit {
    /// A straight line through the last two readings.
    Straight,
    /// A quadratic through the last three readings.
    Quadratic,
    /// A cubic through the last four readings.
    Cubic,
}

impl PathFit {
    /// All curves, in ascending order of the polynomial's degree.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Quadratic, Self::Cubic];

    /// Returns the name that rig files use for the curve.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Quadratic => "quadratic",
            Self::Cubic => "cubic",
        }
    }
}

/// A method that finds the joint torques for a torque on the sphere (physics notes, section 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(any(feature = "schema", feature = "exact"), derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(any(feature = "schema", feature = "exact"), serde(rename_all = "snake_case"))]
pub enum AllocationMethod {
    /// Makes as much of the wanted torque as all joints together can make.
    Exact,
    /// Takes the least-cost joint torques, and scales all of them down by one factor if a joint
    /// exceeds its limit. It is faster and keeps the direction, but the torque can be smaller than
    /// possible.
    Clipped,
}

/// The source of the joint rates: the motor controllers, or a method that estimates them from
/// encoder counts.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum RateEstimate {
    /// The rates that the motor controllers report.
    Controller,
    /// The rate is the difference of the last two readings, divided by the time between them.
    Difference,
    /// The rate is the same difference as in [`Difference`](Self::Difference), after a first-order
    /// low-pass filter.
    LowPass {
        /// Cut-off frequency of the filter, Hz. At this frequency the gain is 1/sqrt 2.
        cutoff_hz: Real,
    },
    /// The rate is the slope of a chord: a straight line from an earlier reading to the last one.
    /// Each joint uses the longest chord that is within a tolerance of every reading in between
    /// (Janabi-Sharifi et al. 2000).
    AdaptiveWindow {
        /// Largest distance of a reading from the chord, in encoder counts. With 1, a chord can
        /// follow every steady motion: rounding moves the reading and both ends of the chord by
        /// less than a count, in the same direction.
        tolerance_counts: u32,
        /// Longest duration of the chord, in ticks; at most [`LONGEST_WINDOW`].
        longest_ticks: u32,
    },
    /// A Kalman filter estimates angle, rate and acceleration of each joint. It treats the rounding
    /// to encoder counts as noise (physics notes, section 9).
    Kalman {
        /// Expected size (root mean square) of a joint's acceleration, rad/s².
        acceleration: Real,
    },
}

/// Longest duration of the chord in [`RateEstimate::AdaptiveWindow`] that a rig can select, ticks.
/// It bounds memory and computing time.
pub const LONGEST_WINDOW: u32 = 64;

/// The energy limit that the passivity controller keeps, and how strongly it may act (physics
/// notes, section 9).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct PassivityLimit {
    /// Energy that the rig may give to the hand beyond what it has absorbed, J.
    pub allowance: Real,
    /// Largest amount of absorbed energy that counts as credit for later, J. It must cover the
    /// energy that springs store when the hand winds them, or they could not return it. Energy
    /// absorbed beyond this amount counts as dissipated.
    pub store: Real,
    /// Largest damping that the passivity controller adds, N m s/rad.
    pub damping: Real,
    /// True if all energy given to the hand counts. If false, only the energy counts that delay and
    /// sampling create, so that a scene may move the sphere on purpose.
    #[cfg_attr(feature = "exact", serde(skip))]
    pub strict: bool,
}

impl PassivityLimit {
    /// Returns suitable values for `device` in a loop with a period of `period_s` seconds.
    ///
    /// The allowance is 1 mJ, and the store 5 mJ. The damping is I_s / (4 h), with the sphere's
    /// inertia I_s and the period h, as far as that is legal. With this damping the sphere's rate,
    /// which is read a tick late, goes to zero as fast as possible without reversing (w' = w - 1/4
    /// w_before has a double root). For loops faster than 1 kHz, h is taken as 1 ms, because more
    /// damping would make the noise of the rates audible.
    #[must_use]
    pub fn of(device: &Device, period_s: Real) -> Self {
        let damping = 0.25 * device.sphere_inertia() / period_s.max(1.0e-3);
        let damping = damping.clamp(2.0 * legal::DAMPING.least, legal::DAMPING.most);
        Self { allowance: 1.0e-3, store: 5.0e-3, damping, strict: false }
    }

    /// Returns values with which all energy counts, for `device` in a loop with a period of
    /// `period_s` seconds. The store is 0.5 J, because a spring of 1 N m/rad with a torque of 0.9 N
    /// m stores 0.4 J.
    #[must_use]
    pub fn strict(device: &Device, period_s: Real) -> Self {
        Self { store: 0.5, strict: true, ..Self::of(device, period_s) }
    }
}

/// How far ahead of its reading a scene is rendered, so that the delay from a reading to its torque
/// takes no damping away. The lead is `factor` times this delay: the age of the reading, half a
/// period of the loop, and the lag of the torque.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct LeadTime {
    /// Ratio of the lead to the delay.
    pub factor: Real,
    /// Longest lead, s.
    pub longest: Real,
}

impl Default for LeadTime {
    /// Returns 1.1 times the delay, and at most 10 ms.
    fn default() -> Self {
        Self { factor: 1.1, longest: 0.01 }
    }
}

impl LeadTime {
    pub(super) fn checks(&self) -> [Option<RigError>; 2] {
        [
            legal::LEAD_FACTOR.check("lead.factor", self.factor),
            legal::LEAD_LONGEST.check("lead.longest", self.longest),
        ]
    }
}
