//! The ranges of all numbers of a rig.
//!
//! They are wide. They exclude values that no rig can have or that arithmetic cannot handle, such
//! as slips of the pen (a torque rate of 1e-300 N m/s), but not unwise values. Rig files have the
//! same ranges, except for a narrower one for the period.

use core::fmt;

use crate::real::{PI, Real};

/// Permitted range of the encoder resolution: counts per turn of the encoder.
pub const COUNTS_PER_TURN: Range = Range::from(4.0, 1_073_741_824.0, "");
/// Permitted range of the gear ratio: turns of the encoder for one turn of the joint.
pub const GEAR: Range = Range::from(0.001, 10_000.0, "");
/// Permitted range of the encoder counts per turn of a joint. Fewer counts do not give a useful
/// angle. More counts do not fit the 32-bit counter that motor controllers report.
pub const COUNTS: Range = Range::from(4.0, 2_147_483_648.0, "counts");
/// Permitted range of the largest torque of a joint, N m. It is 0 for a joint without a motor. The
/// continuous torque of a motor must be above 0 and at most its largest torque.
pub const PEAK: Range = Range::from(0.0, 1000.0, "N m");

/// Permitted range of the limit on the torque on the sphere, N m.
pub const TORQUE: Range = Range::above(1.0e-4, 1000.0, "N m");
/// Permitted range of the limit on the change of the torque on the sphere, N m/s.
pub const TORQUE_RATE: Range = Range::above(1.0e-3, 1_000_000.0, "N m/s");
/// Permitted range of the limit on the angular speed of the sphere, rad/s.
pub const SPEED: Range = Range::above(1.0e-3, 1000.0, "rad/s");
/// Permitted range of the limit on the slip of a wheel, m/s.
pub const SLIP: Range = Range::above(1.0e-6, 100.0, "m/s");
/// Permitted range of the thermal time constant of the motors, s.
pub const THERMAL_TIME: Range = Range::above(1.0e-3, 100_000.0, "s");
/// Permitted range of the energy that the rig may give to the hand in a burst, J.
pub const BURST: Range = Range::above(1.0e-6, 1000.0, "J");
/// Permitted range of the power that the rig may give to the hand continuously, W.
pub const POWER: Range = Range::above(1.0e-6, 1000.0, "W");
/// Permitted range of the friction coefficient of a contact between wheel and sphere.
pub const FRICTION: Range = Range::above(1.0e-3, 10.0, "");
/// Permitted range of the normal force of a contact between wheel and sphere, N.
pub const NORMAL_FORCE: Range = Range::above(1.0e-3, 10_000.0, "N");
/// Permitted range of the largest angle between a reference and the sphere's orientation at which
/// the rig can be enabled, rad. The upper bound is pi, because no two orientations are further
/// apart.
pub const ENABLE_MAX_ANGLE: Range = Range::above(1.0e-6, PI, "rad");
/// Permitted range of the rate at which an independent measurement corrects the orientation, rad/s.
pub const ALIGN_RATE: Range = Range::above(1.0e-6, 100.0, "rad/s");
/// Permitted range of the limit on the rate at which references move, rad/s.
pub const REFERENCE_RATE: Range = Range::above(1.0e-6, 1000.0, "rad/s");
/// Permitted range of the limit on the age of a streamed message, ticks.
pub const MAX_AGE_TICKS: Range = Range::from(1.0, 1_000_000.0, "");

/// Permitted range of the time between ticks, ns.
pub const PERIOD_NS: Range = Range::from(1000.0, 1_000_000_000.0, "ns");
/// Permitted range of the limit on the age of the newest reading, ticks.
pub const TIMEOUT_TICKS: Range = Range::from(1.0, 1000.0, "");

/// Permitted range of the cut-off frequency of the low-pass filter for joint rates, Hz.
pub const CUTOFF_HZ: Range = Range::from(0.1, 10_000.0, "Hz");
/// Permitted range of the tolerance of the adaptive-window rate estimate, in encoder counts. The
/// tolerance is the largest distance between a reading and the chord whose slope is the rate.
pub const TOLERANCE_COUNTS: Range = Range::from(1.0, 1000.0, "");
/// Permitted range of the longest duration of the adaptive-window rate estimate, ticks.
pub const LONGEST_TICKS: Range = Range::from(2.0, super::LONGEST_WINDOW as Real, "");
/// Permitted range of the joint acceleration that the Kalman filter expects, rad/s².
pub const ACCELERATION: Range = Range::from(0.1, 100_000.0, "rad/s²");

/// Permitted range of the energy that the passivity controller lets the rig give out beyond what it
/// has absorbed, J.
pub const ALLOWANCE: Range = Range::from(0.0, 1000.0, "J");
/// Permitted range of the absorbed energy that the passivity controller can store as credit, J.
pub const STORE: Range = Range::from(0.0, 1000.0, "J");
/// Permitted range of the largest damping that the passivity controller adds, N m s/rad.
pub const DAMPING: Range = Range::above(1.0e-6, 100.0, "N m s/rad");

/// Permitted range of the time constant with which the torque of a joint follows a command, s.
pub const TORQUE_LAG: Range = Range::from(0.0, 0.1, "s");
/// Permitted range of the ratio of the lead to the delay from a reading to its torque.
pub const LEAD_FACTOR: Range = Range::above(0.0, 2.0, "");
/// Permitted range of the longest lead, s.
pub const LEAD_LONGEST: Range = Range::above(0.0, 0.1, "s");

/// Permitted range of a Coulomb friction, N m.
pub const COULOMB: Range = Range::from(0.0, 10.0, "N m");
/// Permitted range of a viscous friction, N m s/rad.
pub const VISCOUS: Range = Range::from(0.0, 10.0, "N m s/rad");
/// Permitted range of the torque that a motor makes for each N m of its command.
pub const TORQUE_SCALE: Range = Range::from(0.5, 2.0, "");
/// Permitted range of the part of its torque that a gear loses.
pub const GEAR_LOSS: Range = Range::from(0.0, 0.5, "");
/// Permitted range of the amplitude of a harmonic of the cogging, N m at the joint.
pub const COGGING: Range = Range::from(0.0, 10.0, "N m");
/// Permitted range of the phase of a harmonic of the cogging, rad.
pub const PHASE: Range = Range::from(-7.0, 7.0, "rad");
/// Permitted range of the number of periods of a harmonic in a turn of the encoder.
pub const PER_TURN: Range = Range::from(1.0, 1000.0, "");
/// Permitted range of each component of the sphere's imbalance, N m.
pub const IMBALANCE: Range = Range::from(-10.0, 10.0, "N m");
/// Permitted range of the fraction of the friction that is fed forward.
pub const COMPENSATED: Range = Range::from(0.0, 0.9, "");
/// Permitted range of the rate below which the fed friction fades out, rad/s.
pub const SMOOTHING: Range = Range::from(1.0e-4, 10.0, "rad/s");

/// Permitted range of the drift of the orientation in a turn of one radian, rad.
pub const DRIFT: Range = Range::from(1.0e-5, 0.1, "rad");

/// The permitted range of a number, with its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Lower bound of the range. The bound itself is permitted unless `above_least` is true.
    pub least: Real,
    /// Largest permitted value.
    pub most: Real,
    /// True if the value must be above `least`, not equal to it.
    pub above_least: bool,
    /// Unit of the number as text. Empty for a number without a unit or a count of ticks.
    pub unit: &'static str,
}

impl Range {
    pub(super) const fn from(least: Real, most: Real, unit: &'static str) -> Self {
        Self { least, most, above_least: false, unit }
    }

    pub(super) const fn above(least: Real, most: Real, unit: &'static str) -> Self {
        Self { least, most, above_least: true, unit }
    }

    /// Returns true if `value` is within the range. NaN is in no range.
    #[must_use]
    pub fn contains(&self, value: Real) -> bool {
        value <= self.most && if self.above_least { value > self.least } else { value >= self.least }
    }

    pub(super) fn check(self, field: &'static str, value: Real) -> Option<RigError> {
        (!self.contains(value)).then_some(RigError { joint: None, field, value, range: self })
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { least, most, .. } = self;
        if self.above_least {
            write!(f, "> {least} and <= {most}")?;
        } else {
            write!(f, "{least} to {most}")?;
        }
        if self.unit.is_empty() { Ok(()) } else { write!(f, " {}", self.unit) }
    }
}

/// Error for a number in the description of a rig that is outside of its permitted range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigError {
    /// Index of the joint to which the number belongs, or `None` if it belongs to no joint. Joints
    /// are counted from 0 in the order steer, drive of each wheel.
    pub joint: Option<usize>,
    /// Name of the field that is wrong: a field of [`RigParts`](super::RigParts), such as
    /// `limits.torque`, or of a joint, such as `gear`. The name `counts` stands for the product of
    /// `counts_per_turn` and `gear`, which also has a permitted range.
    pub field: &'static str,
    /// The value that was given.
    pub value: Real,
    /// The range in which the value must be.
    pub range: Range,
}

impl fmt::Display for RigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(joint) = self.joint {
            let which = if joint.is_multiple_of(2) { "steer" } else { "drive" };
            write!(f, "wheel {}, {which}: ", joint / 2 + 1)?;
        }
        write!(f, "{} is {}: must be {}", self.field, self.value, self.range)
    }
}

impl core::error::Error for RigError {}
