//! What the controller knows of the rig besides its geometry: joints, limits, timing, methods.
//!
//! Parse, don't validate: a [`Rig`] that exists has every number within its range. Its parts are public and plain; state
//! them as [`RigParts`], which has defaults for all but the device:
//!
//! ```
//! use hbot_core::rig::{Joint, RigParts, Zero};
//! use hbot_core::{Device, Rig, Vec3, WheelSpec};
//!
//! let wheel = |side| WheelSpec { axis: Vec3::new(side, 0.0, -1.0), cone: 0.1745, radius: 0.0155, ..WheelSpec::default() };
//! let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)])?;
//!
//! // Encoders of 16384 counts a turn; motors of 0.93 N m that steer, and of 0.14 N m behind a gear that drive.
//! let steer = Joint { zero: Zero::Index, ..Joint::new(16384, 0.93) };
//! let drive = Joint { gear: 17.0, ..Joint::new(16384, 0.14) };
//! let rig = Rig::new(RigParts::new(device).with_joints(steer, drive))?;
//! assert_eq!(rig.limits.torque, 0.9);
//!
//! let gentle = rig.with(|parts| parts.limits.torque = 0.2)?;
//! assert_eq!(gentle.limits.torque, 0.2);
//! let error = rig.with(|parts| parts.limits.torque = -0.2).unwrap_err();
//! assert_eq!(error.to_string(), "limits.torque is -0.2: must be > 0 and <= 1000 N m");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod legal;
mod limits;
mod methods;

pub use self::legal::{Range, RigError};
pub use self::limits::{EnergyLimit, Limits, Traction};
pub use self::methods::{
    AllocationMethod, LONGEST_WINDOW, Methods, OdometryMethod, PassivityLimit, PathFit, RateEstimate,
};

use core::ops::Deref;

use crate::device::{Device, MAX_JOINTS};
use crate::real::{Real, TURN};

/// A legal rig: everything that one controller needs to know of it. Reads as its [`RigParts`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig(RigParts);

impl Rig {
    /// A rig of these parts, if every number is within its range (those of [`legal`]).
    ///
    /// # Errors
    /// The first number that is out of its range, in the order of [`RigParts::mistakes`].
    pub fn new(parts: RigParts) -> Result<Self, RigError> {
        match parts.mistakes().next() {
            Some(error) => Err(error),
            None => Ok(Self(parts)),
        }
    }

    /// This rig as `alter` changes it.
    ///
    /// # Errors
    /// As [`new`](Self::new); this rig stays as it is.
    pub fn with(&self, alter: impl FnOnce(&mut RigParts)) -> Result<Self, RigError> {
        let mut parts = self.0;
        alter(&mut parts);
        Self::new(parts)
    }
}

impl Deref for Rig {
    type Target = RigParts;

    #[inline]
    fn deref(&self) -> &RigParts {
        &self.0
    }
}

/// What a [`Rig`] is made of, legal or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigParts {
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

impl RigParts {
    /// `device` with defaults for all else. Its joints have no motors until they are stated.
    #[must_use]
    pub fn new(device: Device) -> Self {
        Self {
            device,
            joints: [Joint::default(); MAX_JOINTS],
            limits: Limits::default(),
            timing: Timing::default(),
            methods: Methods::default(),
        }
    }

    /// The same with these two joints at every wheel.
    #[must_use]
    pub fn with_joints(mut self, steer: Joint, drive: Joint) -> Self {
        self.joints = core::array::from_fn(|joint| if joint % 2 == 0 { steer } else { drive });
        self
    }

    /// Every number that is out of its range: those of the joints first, then limits, timing and methods.
    pub fn mistakes(&self) -> impl Iterator<Item = RigError> + '_ {
        let joints = self.joints[..self.device.joints()].iter().enumerate().flat_map(|(i, joint)| {
            joint.mistakes().map(move |mistake| RigError { joint: Some(i), ..mistake })
        });
        joints
            .chain(self.limits.checks().into_iter().flatten())
            .chain(self.timing.checks().into_iter().flatten())
            .chain(self.methods.checks().into_iter().flatten())
    }
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
    /// The torque that the motor holds for ever, N m, at most `peak`. Without meaning where it has no motor.
    pub continuous: Real,
}

impl Default for Joint {
    /// An encoder of 4096 lines (16384 counts a turn) without a gear, whose zero a calibration finds; no motor.
    fn default() -> Self {
        Self::new(16384, 0.0)
    }
}

impl Joint {
    /// An encoder of `counts_per_turn` and a motor of the torque `peak` (N m), which it also holds for ever, without a gear; a
    /// calibration finds the zero.
    #[must_use]
    pub const fn new(counts_per_turn: u32, peak: Real) -> Self {
        Self { counts_per_turn, gear: 1.0, reversed: false, zero: Zero::Calibrate, peak, continuous: peak }
    }

    /// Every number that is out of its range. The errors name no joint; those of [`RigParts::mistakes`] do.
    pub fn mistakes(&self) -> impl Iterator<Item = RigError> + use<> {
        let continuous = Range::above(0.0, self.peak, legal::PEAK.unit);
        [
            legal::COUNTS_PER_TURN.check("counts_per_turn", self.counts_per_turn as Real),
            legal::GEAR.check("gear", self.gear),
            legal::COUNTS.check("counts", self.counts() as Real),
            legal::PEAK.check("peak", self.peak),
            if self.peak > 0.0 { continuous.check("continuous", self.continuous) } else { None },
        ]
        .into_iter()
        .flatten()
    }

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
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
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

/// Loop period and time-outs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timing {
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Age of the newest reading, ticks, above which it is the fault link_lost: a longer silence, or
    /// answers to older commands. At most 1000, as the passivity observer remembers the torques of 1024 ticks.
    pub timeout_ticks: u32,
}

impl Default for Timing {
    /// 1 kHz; a reading may be 20 ticks old.
    fn default() -> Self {
        Self { period_ns: 1_000_000, timeout_ticks: 20 }
    }
}

impl Timing {
    /// The shortest time, ms, for which a controller may hold a command that no other follows: a command must still hold
    /// when the next one is a whole period late.
    #[must_use]
    pub const fn least_watchdog_ms(&self) -> u64 {
        (2 * self.period_ns).div_ceil(1_000_000)
    }

    pub(super) fn checks(&self) -> [Option<RigError>; 2] {
        [
            legal::PERIOD_NS.check("timing.period_ns", self.period_ns as Real),
            legal::TIMEOUT_TICKS.check("timing.timeout_ticks", self.timeout_ticks as Real),
        ]
    }

    /// The period in seconds.
    #[inline]
    #[must_use]
    pub fn period_s(&self) -> Real {
        self.period_ns as Real * 1.0e-9
    }
}

#[cfg(test)]
mod tests;
