//! What the controller knows of the rig besides its geometry: joints, limits, timing, methods.
//!
//! hbot-config fills these from a rig file after checking every range; the core takes them as they are.

use crate::device::{Device, MAX_JOINTS};
use crate::real::Real;

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
    /// Ticks without feedback until fault link_lost.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Methods {
    /// How orientation is integrated from one reading to the next.
    pub odometry: OdometryMethod,
    /// Where joint rates come from.
    pub rate: RateEstimate,
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

/// Where joint rates come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RateEstimate {
    /// As the motor controllers report them.
    Controller,
    /// The difference of the last two readings over the time between them.
    Difference,
}
