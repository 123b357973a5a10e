//! The ranges of all numbers of a rig.
//!
//! They are wide: they keep out what no rig can be and what arithmetic cannot bear, not what is unwise. Rig files have these
//! ranges too, and a narrower one for the period.

use core::fmt;

use crate::real::{PI, Real};

/// Encoder counts a turn of the encoder.
pub const COUNTS_PER_TURN: Range = Range::from(4.0, 1_073_741_824.0, "");
/// Turns of the encoder for one turn of the joint.
pub const GEAR: Range = Range::from(0.001, 10_000.0, "");
/// Counts of one turn of a joint: fewer tell no angle, more do not fit the 32-bit counter that controllers report.
pub const COUNTS: Range = Range::from(4.0, 2_147_483_648.0, "counts");
/// The largest torque at a joint; 0 where it has no motor. The continuous torque of a motor is above 0 and at most this.
pub const PEAK: Range = Range::from(0.0, 1000.0, "N m");

/// Largest torque on the sphere.
pub const TORQUE: Range = Range::above(0.0, 1000.0, "N m");
/// Largest change of that torque.
pub const TORQUE_RATE: Range = Range::above(0.0, 1_000_000.0, "N m/s");
/// Largest angular speed.
pub const SPEED: Range = Range::above(0.0, 1000.0, "rad/s");
/// Largest slip.
pub const SLIP: Range = Range::above(0.0, 100.0, "m/s");
/// Thermal time of the motors.
pub const THERMAL_TIME: Range = Range::above(0.0, 100_000.0, "s");
/// Energy of a burst.
pub const BURST: Range = Range::above(0.0, 1000.0, "J");
/// Power that may be given out for ever.
pub const POWER: Range = Range::above(0.0, 1000.0, "W");
/// Friction coefficient of a contact.
pub const FRICTION: Range = Range::above(0.0, 10.0, "");
/// Normal force of a contact.
pub const NORMAL_FORCE: Range = Range::above(0.0, 10_000.0, "N");
/// How far a reference may be at enable; no two orientations are further apart than pi.
pub const ENABLE_MAX_ANGLE: Range = Range::above(0.0, PI, "rad");
/// How fast an outside orientation corrects the odometry.
pub const ALIGN_RATE: Range = Range::above(0.0, 100.0, "rad/s");
/// How fast a reference moves.
pub const REFERENCE_RATE: Range = Range::above(0.0, 1000.0, "rad/s");
/// Age of stream messages.
pub const MAX_AGE_TICKS: Range = Range::from(1.0, 1_000_000.0, "");

/// Time between ticks.
pub const PERIOD_NS: Range = Range::from(1000.0, 1_000_000_000.0, "ns");
/// Age of the newest reading.
pub const TIMEOUT_TICKS: Range = Range::from(1.0, 1000.0, "");

/// Corner of the low pass for rates.
pub const CUTOFF_HZ: Range = Range::from(0.1, 10_000.0, "Hz");
/// How far a reading may be off the chord of the adaptive window.
pub const TOLERANCE_COUNTS: Range = Range::from(1.0, 1000.0, "");
/// How far back that window reaches.
pub const LONGEST_TICKS: Range = Range::from(2.0, super::LONGEST_WINDOW as Real, "");
/// Acceleration that the Kalman filter expects.
pub const ACCELERATION: Range = Range::from(0.1, 100_000.0, "rad/s²");

/// Energy that the passivity controller lets out beyond what came in.
pub const ALLOWANCE: Range = Range::from(0.0, 1000.0, "J");
/// Energy that it remembers.
pub const STORE: Range = Range::from(0.0, 1000.0, "J");
/// Damping that it adds at most.
pub const DAMPING: Range = Range::above(0.0, 100.0, "N m s/rad");

/// The range of a number, with its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Its lower bound.
    pub least: Real,
    /// The largest number in it.
    pub most: Real,
    /// Whether `least` itself is outside.
    pub above_least: bool,
    /// The unit, as people write it; empty for a pure number or a count of ticks.
    pub unit: &'static str,
}

impl Range {
    pub(super) const fn from(least: Real, most: Real, unit: &'static str) -> Self {
        Self { least, most, above_least: false, unit }
    }

    pub(super) const fn above(least: Real, most: Real, unit: &'static str) -> Self {
        Self { least, most, above_least: true, unit }
    }

    /// Whether `value` is in it. NaN is in no range.
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

/// A number that no legal rig has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigError {
    /// The joint that it belongs to, if any, counted from 0 in the order steer, drive of each wheel.
    pub joint: Option<usize>,
    /// The field of [`RigParts`](super::RigParts), such as `limits.torque`, or of that joint, such as `gear`. `counts` are those
    /// of one turn of the joint, `counts_per_turn` times `gear`.
    pub field: &'static str,
    /// What it is.
    pub value: Real,
    /// What it may be.
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
