//! The ranges of all numbers of a rig.
//!
//! They are wide. They exclude values that no rig can have or that arithmetic cannot handle, but
//! not unwise values. Rig files have the same ranges, except for a narrower one for the period.

use core::fmt;

use crate::real::{PI, Real};

/// Range of the encoder resolution, in counts per turn of the encoder.
pub const COUNTS_PER_TURN: Range = Range::from(4.0, 1_073_741_824.0, "");
/// Range of the gear: turns of the encoder for one turn of the joint.
pub const GEAR: Range = Range::from(0.001, 10_000.0, "");
/// Range of the counts per turn of a joint. Fewer do not give an angle; more do not fit the 32-bit
/// counter that motor controllers report.
pub const COUNTS: Range = Range::from(4.0, 2_147_483_648.0, "counts");
/// Range of the largest torque at a joint, N m; 0 if the joint has no motor. The continuous torque
/// of a motor must be above 0 and at most this torque.
pub const PEAK: Range = Range::from(0.0, 1000.0, "N m");

/// Range of the largest torque on the sphere, N m.
pub const TORQUE: Range = Range::above(0.0, 1000.0, "N m");
/// Range of the largest change of the torque on the sphere, N m/s.
pub const TORQUE_RATE: Range = Range::above(0.0, 1_000_000.0, "N m/s");
/// Range of the largest angular speed of the sphere, rad/s.
pub const SPEED: Range = Range::above(0.0, 1000.0, "rad/s");
/// Range of the largest slip of a wheel, m/s.
pub const SLIP: Range = Range::above(0.0, 100.0, "m/s");
/// Range of the thermal time of the motors, s.
pub const THERMAL_TIME: Range = Range::above(0.0, 100_000.0, "s");
/// Range of the energy of a burst, J.
pub const BURST: Range = Range::above(0.0, 1000.0, "J");
/// Range of the power that may be given out forever, W.
pub const POWER: Range = Range::above(0.0, 1000.0, "W");
/// Range of the friction coefficient of a contact.
pub const FRICTION: Range = Range::above(0.0, 10.0, "");
/// Range of the normal force of a contact, N.
pub const NORMAL_FORCE: Range = Range::above(0.0, 10_000.0, "N");
/// Range of the largest permitted angle between a reference and the orientation at enable, rad. No
/// two orientations are further apart than pi.
pub const ENABLE_MAX_ANGLE: Range = Range::above(0.0, PI, "rad");
/// Range of the rate at which an outside measurement corrects the orientation, rad/s.
pub const ALIGN_RATE: Range = Range::above(0.0, 100.0, "rad/s");
/// Range of the largest rate at which a reference moves, rad/s.
pub const REFERENCE_RATE: Range = Range::above(0.0, 1000.0, "rad/s");
/// Range of the largest age of stream messages, ticks.
pub const MAX_AGE_TICKS: Range = Range::from(1.0, 1_000_000.0, "");

/// Range of the time between ticks, ns.
pub const PERIOD_NS: Range = Range::from(1000.0, 1_000_000_000.0, "ns");
/// Range of the largest age of the newest reading, ticks.
pub const TIMEOUT_TICKS: Range = Range::from(1.0, 1000.0, "");

/// Range of the cut-off frequency of the low-pass filter for rates, Hz.
pub const CUTOFF_HZ: Range = Range::from(0.1, 10_000.0, "Hz");
/// Range of the tolerance of the adaptive window: the distance of a reading from the chord, counts.
pub const TOLERANCE_COUNTS: Range = Range::from(1.0, 1000.0, "");
/// Range of the longest duration of the adaptive window, ticks.
pub const LONGEST_TICKS: Range = Range::from(2.0, super::LONGEST_WINDOW as Real, "");
/// Range of the acceleration that the Kalman filter expects, rad/s².
pub const ACCELERATION: Range = Range::from(0.1, 100_000.0, "rad/s²");

/// Range of the energy that the passivity controller lets out beyond what came in, J.
pub const ALLOWANCE: Range = Range::from(0.0, 1000.0, "J");
/// Range of the energy that the passivity controller remembers, J.
pub const STORE: Range = Range::from(0.0, 1000.0, "J");
/// Range of the largest damping that the passivity controller adds, N m s/rad.
pub const DAMPING: Range = Range::above(0.0, 100.0, "N m s/rad");

/// The range of a number, with its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Lower bound. It is within the range unless `above_least` is true.
    pub least: Real,
    /// Largest value within the range.
    pub most: Real,
    /// True if `least` itself is not within the range.
    pub above_least: bool,
    /// The unit as text; empty for a pure number or a count of ticks.
    pub unit: &'static str,
}

impl Range {
    pub(super) const fn from(least: Real, most: Real, unit: &'static str) -> Self {
        Self { least, most, above_least: false, unit }
    }

    pub(super) const fn above(least: Real, most: Real, unit: &'static str) -> Self {
        Self { least, most, above_least: true, unit }
    }

    /// Returns true if `value` is within the range. NaN never is.
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

/// A number of a rig that is out of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigError {
    /// Index of the joint that the number belongs to, if any. Joints count from 0 in the order
    /// steer, drive of each wheel.
    pub joint: Option<usize>,
    /// Name of the field of [`RigParts`](super::RigParts), such as `limits.torque`, or of the
    /// joint, such as `gear`. `counts` means those of one turn of the joint: `counts_per_turn`
    /// times `gear`.
    pub field: &'static str,
    /// The value of the number.
    pub value: Real,
    /// The range that the number must be in.
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
