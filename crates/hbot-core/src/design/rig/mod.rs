//! The properties of the rig that the control law needs: geometry, joints, limits, timing and
//! methods.
//!
//! A [`Rig`] can only be made by [`Rig::new`], which checks that every number is within its range.
//! Its parts are public and plain. They are given as [`RigParts`], which has defaults for
//! everything except the device:
//!
//! ```
//! use hbot_core::design::rig::{Joint, RigParts, Zero};
//! use hbot_core::{Device, Rig, Vec3, WheelSpec};
//!
//! let wheel = |side| WheelSpec {
//!     axis: Vec3::new(side, 0.0, -1.0),
//!     cone: 0.1745,
//!     radius: 0.0155,
//!     ..WheelSpec::default()
//! };
//! let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)])?;
//!
//! // Encoders of 16384 counts per turn. Motors of 0.93 N m steer; motors of 0.14 N m, after a
//! // gear of 17, drive.
//! let steer = Joint { zero: Zero::Index, ..Joint::new(16384, 0.93) };
//! let drive = Joint { gear: 17.0, ..Joint::new(16384, 0.14) };
//! let rig = Rig::new(RigParts::new(device).with_joints(steer, drive))?;
//! assert_eq!(rig.limits.torque, 0.9);
//!
//! let gentle = rig.with(|parts| parts.limits.torque = 0.2)?;
//! assert_eq!(gentle.limits.torque, 0.2);
//! let error = rig.with(|parts| parts.limits.torque = -0.2).unwrap_err();
//! assert_eq!(error.to_string(), "limits.torque is -0.2: must be > 0.0001 and <= 1000 N m");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod compensation;
pub mod legal;
mod limits;
mod methods;

pub use self::compensation::{Compensation, Friction, Harmonic, Imperfect, MAX_HARMONICS};
pub use self::legal::{Range, RigError};
pub use self::limits::{EnergyLimit, Limits, Traction};
pub use self::methods::{
    AllocationMethod, LONGEST_WINDOW, LeadTime, Methods, OdometryMethod, PassivityLimit, PathFit,
    RateEstimate,
};

use core::ops::Deref;

use crate::design::device::{Device, MAX_JOINTS};
use crate::real::{Real, TURN};

/// A rig whose numbers have all been checked: geometry, joints, limits, timing and methods. It
/// dereferences to its [`RigParts`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Rig(RigParts);

impl Rig {
    /// Creates a rig from its parts, after checking that every number is within its range (see
    /// [`legal`]).
    ///
    /// # Errors
    /// Returns the first number that is out of its range, in the order of [`RigParts::mistakes`].
    pub fn new(parts: RigParts) -> Result<Self, RigError> {
        match parts.mistakes().next() {
            Some(error) => Err(error),
            None => Ok(Self(parts)),
        }
    }

    /// Returns a copy of this rig, changed by `alter`. This rig itself does not change.
    ///
    /// # Errors
    /// Fails if a number of the changed rig is out of its range, as in [`new`](Self::new).
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

/// The properties of a rig, which need not be valid. [`Rig::new`] checks them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct RigParts {
    /// Geometry and mass of the sphere, and geometry and inertia of the wheels.
    pub device: Device,
    /// The joints, in the order steer, drive of each wheel. Entries beyond [`Device::joints`] are
    /// unused.
    pub joints: [Joint; MAX_JOINTS],
    /// Limits that the control law must not exceed.
    pub limits: Limits,
    /// Period of the loop, and the time after which missing readings are a fault.
    pub timing: Timing,
    /// Choice of numerical methods, which trades accuracy for computing time.
    pub methods: Methods,
    /// Largest time constant with which the torque of a joint follows a command, s.
    #[cfg_attr(feature = "exact", serde(skip))]
    pub torque_lag: Real,
    /// How far ahead of its reading a scene is rendered. If `None`, it is rendered at the measured
    /// pose.
    #[cfg_attr(feature = "exact", serde(skip))]
    pub lead: Option<LeadTime>,
    /// Imperfections of the rig that are fed forward. If `None`, none is.
    #[cfg_attr(feature = "exact", serde(skip))]
    pub compensation: Option<Compensation>,
    /// What the orientation drifts in each axis in a turn of one radian (standard deviation), rad.
    /// It grows with the square root of the turn, and is the weight of the rig's own orientation
    /// against measurements from outside. If `None`, the geometry counts as that of a drawing.
    #[cfg_attr(feature = "exact", serde(skip))]
    pub drift: Option<Real>,
}

impl RigParts {
    /// Returns the parts of a rig with the geometry `device` and default values for everything
    /// else. The default joints have no motors.
    #[must_use]
    pub fn new(device: Device) -> Self {
        Self {
            device,
            joints: [Joint::default(); MAX_JOINTS],
            limits: Limits::default(),
            timing: Timing::default(),
            methods: Methods::default(),
            torque_lag: 0.0,
            lead: None,
            compensation: None,
            drift: None,
        }
    }

    /// Returns these parts with the joint `steer` as the steer joint, and `drive` as the drive
    /// joint, of every wheel.
    #[must_use]
    pub fn with_joints(mut self, steer: Joint, drive: Joint) -> Self {
        self.joints = core::array::from_fn(|joint| if joint % 2 == 0 { steer } else { drive });
        self
    }

    /// Returns an error for every number that is out of its range: first for the joints, then for
    /// limits, timing and methods.
    pub fn mistakes(&self) -> impl Iterator<Item = RigError> + '_ {
        let joints = self.joints[..self.device.joints()].iter().enumerate().flat_map(|(i, joint)| {
            joint.mistakes().map(move |mistake| RigError { joint: Some(i), ..mistake })
        });
        joints
            .chain(self.limits.checks().into_iter().flatten())
            .chain(self.timing.checks().into_iter().flatten())
            .chain(self.methods.checks().into_iter().flatten())
            .chain(legal::TORQUE_LAG.check("torque_lag", self.torque_lag))
            .chain(self.lead.iter().flat_map(LeadTime::checks).flatten())
            .chain(self.compensation.iter().flat_map(|known| known.mistakes(self.device.joints())))
            .chain(self.drift.and_then(|drift| legal::DRIFT.check("drift", drift)))
    }
}

/// One joint of a wheel: its encoder, gear and motor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Joint {
    /// Encoder counts per turn of the encoder, which is on the motor side of the gear. It is four
    /// times the number of lines.
    pub counts_per_turn: u32,
    /// Gear ratio: turns of the encoder for one turn of the joint.
    pub gear: Real,
    /// True if the motor controller's positive direction, of counts and of torque, is opposite to
    /// the joint's.
    pub reversed: bool,
    /// How the zero of a steer joint is found. Unused for drive joints, which need no zero.
    pub zero: Zero,
    /// Largest torque of the joint, N m. 0 if the joint has no motor.
    pub peak: Real,
    /// Torque that the motor can hold continuously without overheating, N m; at most `peak`. Unused
    /// if the joint has no motor.
    pub continuous: Real,
}

impl Default for Joint {
    /// Returns a joint with an encoder of 4096 lines (16384 counts per turn), without a gear and
    /// without a motor. Its zero is found by a calibration.
    fn default() -> Self {
        Self::new(16384, 0.0)
    }
}

impl Joint {
    /// Creates a joint without a gear. Its encoder has `counts_per_turn` counts per turn. Its motor
    /// has the largest torque `peak` (N m), which it can also hold continuously. The zero is found
    /// by a calibration.
    #[must_use]
    pub const fn new(counts_per_turn: u32, peak: Real) -> Self {
        Self { counts_per_turn, gear: 1.0, reversed: false, zero: Zero::Calibrate, peak, continuous: peak }
    }

    /// Returns an error for every number of the joint that is out of its range. These errors do not
    /// say which joint it is; those of [`RigParts::mistakes`] do.
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

    /// Returns the encoder counts per turn of the joint: counts per turn of the encoder times the
    /// gear ratio.
    #[must_use]
    pub fn counts(&self) -> f64 {
        f64::from(self.counts_per_turn) * real_to_f64(self.gear)
    }

    /// Returns the angle that the joint turns per encoder count, rad. Negative if the encoder
    /// counts up when the joint turns backwards.
    #[must_use]
    pub fn radians_per_count(&self) -> Real {
        let turn = TURN / self.counts() as Real;
        if self.reversed { -turn } else { turn }
    }

    /// Returns the whole number of encoder counts that is nearest to the joint angle `angle`, rad,
    /// with the sign of the motor controller.
    #[must_use]
    pub fn whole_counts(&self, angle: Real) -> Real {
        libm::round(real_to_f64(angle / self.radians_per_count())) as Real
    }
}

// In one of the two widths of reals the conversion does nothing.
#[allow(clippy::useless_conversion, reason = "the same line converts f32 in hbot-core-f32")]
fn real_to_f64(x: Real) -> f64 {
    f64::from(x)
}

/// How the zero of a steer joint is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(any(feature = "schema", feature = "exact"), derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(any(feature = "schema", feature = "exact"), serde(rename_all = "snake_case"))]
pub enum Zero {
    /// The wheel is assumed to be at zero when the motor controller powers up. The zero is no
    /// longer known after the motor controller reboots.
    Assume,
    /// The encoder is absolute over a turn: its count gives the angle directly.
    Absolute,
    /// The zero is known after the encoder has passed its index mark.
    Index,
    /// The zero is known after a calibration.
    Calibrate,
}

/// The period of the loop, and the time after which missing readings are a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Timing {
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Largest age of the newest reading, in ticks. Above it, the fault `link_lost` occurs. The age
    /// grows if no reading comes, or if readings answer old commands. At most 1000, because the
    /// passivity observer stores the torques of 1024 ticks.
    pub timeout_ticks: u32,
}

impl Default for Timing {
    /// Returns the default timing: a period of 1 ms (1 kHz) and a fault if the newest reading is
    /// older than 20 ticks.
    fn default() -> Self {
        Self { period_ns: 1_000_000, timeout_ticks: 20 }
    }
}

impl Timing {
    /// Returns the shortest watchdog time of a motor controller that is permitted, ms. It is two
    /// periods, so that the torque does not drop out if a command is a whole period late.
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

    /// Returns the period of the loop, s.
    #[inline]
    #[must_use]
    pub fn period_s(&self) -> Real {
        self.period_ns as Real * 1.0e-9
    }
}

#[cfg(test)]
mod tests;
