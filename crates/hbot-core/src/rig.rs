//! What the controller knows of the rig besides its geometry: joints, limits, timing, methods.
//!
//! hbot-config fills these from a rig file after checking every range; the core takes them as they are.

use crate::device::{Device, MAX_JOINTS};
use crate::real::{Real, TURN};

/// Everything that one controller needs to know of its rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig {
    /// Geometry and masses.
    pub device: Device,
    /// One a joint, in the order steer, drive of each wheel; entries past [`Device::joints`] are unused.
    pub joints: [Joint; MAX_JOINTS],
    /// What must not be exceeded.
    pub limits: Limits,
    /// Loop period and time-outs.
    pub timing: Timing,
    /// Which methods trade accuracy for time.
    pub methods: Methods,
}

/// One joint: its encoder and its motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// Encoder counts a turn of the encoder (lines times 4), before the gear.
    pub counts_per_turn: u32,
    /// Turns of the encoder for one turn of the joint.
    pub gear: Real,
    /// Whether the controller counts (and pushes) against the joint's positive sense.
    pub reversed: bool,
    /// How the zero of a steering angle becomes known. Unused for drive joints, whose zero means nothing.
    pub zero: Zero,
    /// The largest torque at the joint, N m; 0 where it has no motor.
    pub peak: Real,
    /// The torque that the motor holds for ever, N m.
    pub continuous: Real,
}

impl Joint {
    /// Encoder counts in one turn of the joint: those of a turn of the encoder times the gear.
    #[must_use]
    pub fn counts(&self) -> f64 {
        f64::from(self.counts_per_turn) * real_to_f64(self.gear)
    }

    /// The joint's turn for one count, rad; negative where the controller counts against the joint.
    #[must_use]
    pub fn radians_per_count(&self) -> Real {
        let turn = TURN / self.counts() as Real;
        if self.reversed { -turn } else { turn }
    }
}

// One width of the two makes the conversion a no-op.
#[allow(clippy::useless_conversion, reason = "the same line converts f32 in hbot-core-f32")]
fn real_to_f64(x: Real) -> f64 {
    f64::from(x)
}

/// How the zero of a steering angle becomes known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Zero {
    /// The wheel stands at zero when the controller powers up; taken at the first reading, and not again after a reboot.
    Assume,
    /// The encoder is absolute over a turn: its count is the angle.
    Absolute,
    /// Known once the controller has seen the encoder's index.
    Index,
    /// Known once a calibration has been taken.
    Calibrate,
}

/// What must not be exceeded. All positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest torque on the sphere, N m (its norm).
    pub torque: Real,
    /// Largest change of that torque, N m/s.
    pub torque_rate: Real,
    /// Largest angular speed of the powered sphere, rad/s; above it: fault overspeed.
    pub speed: Real,
    /// Largest slip of the powered sphere, m/s; above it: fault slip.
    pub slip: Real,
    /// How much energy may go into the hand, and how fast; more is the fault overtorque. `None`: as much as torque and speed
    /// allow.
    pub energy: Option<EnergyLimit>,
    /// The thermal time of the motors, s: a joint whose mean square of torque over it is above that of its continuous torque is
    /// the fault thermal. `None`: heat is left to the controllers.
    pub thermal_time: Option<Real>,
    /// What the contacts hold; `None` where nobody knows.
    pub traction: Option<Traction>,
    /// How far a spring's reference may be from the orientation at enable, rad.
    pub enable_max_angle: Real,
    /// How fast an outside orientation corrects the odometry, rad/s.
    pub align_rate: Real,
    /// How fast a reference moves, rad/s.
    pub reference_rate: Real,
    /// Stream messages that name a tick older than this are refused.
    pub max_age_ticks: u32,
}

/// A bound on the energy given out to the hand, as the passivity observer sees it: what is given out faster than `power` must
/// not add up to more than `burst`. Both positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyLimit {
    /// Energy above what `power` allows, J.
    pub burst: Real,
    /// What may be given out for ever, W.
    pub power: Real,
}

/// The contact's friction limit, mu N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traction {
    /// Friction coefficient.
    pub mu: Real,
    /// Normal force of each wheel, N.
    pub normal_force: Real,
}

/// Loop period and time-outs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timing {
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Age of the newest reading, ticks, above which it is the fault link_lost: a longer silence, or
    /// answers to older commands. At most 1000.
    pub timeout_ticks: u32,
}

impl Timing {
    /// The period in seconds.
    #[inline]
    #[must_use]
    pub fn period_s(&self) -> Real {
        self.period_ns as Real * 1.0e-9
    }
}

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

/// How orientation is integrated over one step of the joints (physics notes, section 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_turns_the_joint_by_a_share_of_the_gear_in_its_own_sense() {
        let mut joint = Joint {
            counts_per_turn: 1000,
            gear: 4.0,
            reversed: false,
            zero: Zero::Assume,
            peak: 1.0,
            continuous: 1.0,
        };
        // 4000 counts are a turn.
        assert_eq!(joint.counts(), 4000.0);
        assert!((joint.radians_per_count() - 1.570_796_3e-3).abs() < 1.0e-9);
        joint.reversed = true;
        assert!((joint.radians_per_count() + 1.570_796_3e-3).abs() < 1.0e-9);
    }
}
