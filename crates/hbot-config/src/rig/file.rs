//! The tables of a rig file that describe the machine. Each table is a struct, and each key is a
//! field with its range and unit. The tables that say how the machine is run are in
//! [`settings`](super::settings).
//!
//! Ranges are wide. They exclude values that no rig can have or that break the arithmetic, not
//! values that are unwise.

use std::f64::consts::{FRAC_PI_2, PI};

use hbot_core::design::rig::{self as core, MAX_HARMONICS, legal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::compensation::{Friction, Harmonic};
use super::settings::{Api, Limits, Link, Loop, Protocol};

/// The number of counts per turn that stands in for a missing one, so that other mistakes in the
/// file can still be reported.
const MISSING_COUNTS: u32 = legal::COUNTS_PER_TURN.least as u32;

/// The contents of a rig file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigFile {
    /// Name of the rig, shown to people.
    #[serde(default = "rig_name")]
    #[schemars(length(min = 1, max = 100))]
    pub(crate) name: String,
    /// Name of the certificate that `hbot rig certify` has written about the rig. Recordings
    /// contain it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String", length(min = 1, max = 100))]
    pub(crate) certificate: Option<String>,
    /// The hollow sphere, which turns about its fixed centre.
    pub(crate) sphere: Sphere,
    /// The wheels. Each is driven, and is steered about an axis through the sphere's centre.
    #[schemars(length(min = 2, max = 8))]
    pub(crate) wheel: Vec<Wheel>,
    /// Settings of the control loop.
    #[serde(default)]
    pub(crate) r#loop: Loop,
    /// Settings of the serial line to the motor controllers.
    #[serde(default)]
    pub(crate) link: Link,
    /// Largest torque, speed, slip, energy and rates that are allowed.
    #[serde(default)]
    pub(crate) limits: Limits,
    /// Settings of the TCP service to which clients connect.
    #[serde(default)]
    pub(crate) api: Api,
}

fn rig_name() -> String {
    "Hbot".to_owned()
}

/// Size and mass of the sphere of the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sphere {
    /// Radius R of the sphere.
    #[schemars(range(min = 0.001, max = 10.0), extend("unit" = "m"))]
    pub(crate) radius: f64,
    /// Mass m of the sphere. The sphere is treated as a thin shell with the moment of inertia 2/3 m
    /// R² (R is the radius).
    #[schemars(range(min = 0.001, max = 1000.0), extend("unit" = "kg"))]
    pub(crate) mass: f64,
    /// Measured friction of the sphere in its cage, against the sphere's motion. It is fed forward
    /// (see `loop.compensation`). Absent: none is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Friction")]
    pub(crate) friction: Option<Friction>,
    /// Imbalance of the sphere: its weight times the position of its centre of mass relative to its
    /// centre, in the sphere's axes. The torque of the weight is fed forward (see
    /// `loop.compensation`).
    #[serde(default)]
    #[schemars(inner(range(min = legal::IMBALANCE.least, max = legal::IMBALANCE.most)), extend("unit" = legal::IMBALANCE.unit))]
    pub(crate) imbalance: [f64; 3],
    /// Drift of the orientation about each axis in a turn of one radian (standard deviation), by
    /// which measurements from outside are weighed. `hbot rig identify` writes it. Absent: 0.02.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::DRIFT.least, max = legal::DRIFT.most), extend("unit" = legal::DRIFT.unit))]
    pub(crate) drift: Option<f64>,
}

/// One wheel, with its steer joint and its drive joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wheel {
    /// Name of the wheel, shown to people. Each name is unique. If absent: A, B, C... in the order
    /// of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String", length(min = 1, max = 100))]
    pub(crate) name: Option<String>,
    /// Steering axis through the sphere's centre, in frame N (fixed in space). Any length except
    /// zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub(crate) axis: [f64; 3],
    /// Cone angle a: the angle at the sphere's centre between the steering axis and the contact
    /// point.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = PI, "unit" = "rad"))]
    pub(crate) cone: f64,
    /// Toe angle b: the wheel's rolling direction is turned by this angle about the contact normal.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = -FRAC_PI_2, "exclusiveMaximum" = FRAC_PI_2, "unit" = "rad"))]
    pub(crate) toe: f64,
    /// Radius r of the wheel.
    #[schemars(range(min = 0.0001, max = 10.0), extend("unit" = "m"))]
    pub(crate) radius: f64,
    /// The joint that turns the wheel about its steering axis.
    pub(crate) steer: Joint,
    /// The joint that rolls the wheel about its axle.
    pub(crate) drive: Joint,
}

/// One joint: a motor axis with its encoder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Joint {
    /// Index of the joint's port in the list `link.port`, counted from 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 7))]
    pub(crate) port: u32,
    /// Which motor controller has this joint. Protocol `hbot`: the position of the joint on its
    /// line, from 0 to 15. The joints of a port must use each position once. If absent: the order
    /// of the file, steer before drive. Protocol `moteus`: the controller's id on the bus, 1 to
    /// 127, required; 127 only if it is alone on its port. Protocol `odrive`: the controller's id
    /// on the bus, 0 to 63, required.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = 0, max = 127))]
    pub(crate) controller: Option<u32>,
    /// Encoder counts in one turn of the encoder (lines times 4), before the gear. Required with
    /// protocol `hbot`. Must be absent with the other protocols, which report turns: the driver
    /// counts 131072 per turn with `moteus` and 2097152 with `odrive`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = legal::COUNTS_PER_TURN.least as u32, max = legal::COUNTS_PER_TURN.most as u32))]
    pub(crate) counts_per_turn: Option<u32>,
    /// Number of turns of the encoder in one turn of the joint.
    #[serde(default = "one")]
    #[schemars(range(min = legal::GEAR.least, max = legal::GEAR.most))]
    pub(crate) gear: f64,
    /// 1 if the motor controller's positive direction is that of the joint, -1 if it is opposite.
    #[serde(default = "forwards")]
    #[schemars(extend("enum" = [1, -1]))]
    pub(crate) sign: i8,
    /// How the zero of a steering angle becomes known. On a drive joint: `rig identify` writes its
    /// cogging only with `absolute` or `index`. `index` is possible with protocol `hbot` only.
    #[serde(default = "unknown")]
    pub(crate) zero: core::Zero,
    /// Angle of the joint when its encoder reads zero, as measured by `hbot rig calibrate`. Has no
    /// effect on a drive joint.
    #[serde(default)]
    #[schemars(range(min = -6.3, max = 6.3), extend("unit" = "rad"))]
    pub(crate) zero_offset: f64,
    /// Moment of inertia of everything that turns with the joint, about the joint's axis. The
    /// rotor's inertia is multiplied by the square of its gear ratio.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "kg m²"))]
    pub(crate) inertia: f64,
    /// Largest joint torque, after the gear. Required if the joint has a motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::PEAK.most), extend("exclusiveMinimum" = legal::PEAK.least, "unit" = legal::PEAK.unit))]
    pub(crate) peak: Option<f64>,
    /// Joint torque that the motor can hold without time limit, at most `peak`. Required if the
    /// joint has a motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::PEAK.most), extend("exclusiveMinimum" = legal::PEAK.least, "unit" = legal::PEAK.unit))]
    pub(crate) continuous: Option<f64>,
    /// Time constant with which the joint torque follows a command. It depends on the current loop
    /// of the motor controller: a bandwidth of f Hz makes it 1/(2 pi f). If absent: 0.0005 with
    /// protocol `hbot`, 0.0008 (200 Hz) with `moteus`, 0.001 (1000 rad/s) with `odrive`. The
    /// stiffness that the rig can render depends on it. Has no effect if the joint has no motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub(crate) torque_lag: Option<f64>,
    /// Delay of the rate that the motor controller reports behind the true rate of the joint, which
    /// a filter in the controller causes. moteus: 4.96 / (2 pi f) with the setting
    /// `motor_position.sources.N.pll_filter_hz` of f Hz. ODrive: 2/b with an encoder bandwidth of b
    /// rad/s. If absent: 0 with protocol `hbot`, 0.0039 (200 Hz) with `moteus`, 0.002 (1000 rad/s)
    /// with `odrive`. The damping that the rig can render depends on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub(crate) rate_lag: Option<f64>,
    /// Torque that the motor makes for each N m that its controller is commanded to make. Commands
    /// are divided by it. Has no effect if the joint has no motor.
    #[serde(default = "one")]
    #[schemars(range(min = legal::TORQUE_SCALE.least, max = legal::TORQUE_SCALE.most))]
    pub(crate) torque_scale: f64,
    /// Part of the motor's torque that its gear loses while it turns under load. It is fed forward
    /// like friction. Has no effect if the joint has no motor.
    #[serde(default)]
    #[schemars(range(min = legal::GEAR_LOSS.least, max = legal::GEAR_LOSS.most))]
    pub(crate) gear_loss: f64,
    /// Measured friction of the joint with its motor and gear. It is fed forward (see
    /// `loop.compensation`). Absent: none is. Has no effect if the joint has no motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Friction")]
    pub(crate) friction: Option<Friction>,
    /// Cogging of the motor: a torque that repeats with the angle of the encoder. Its harmonics are
    /// fed forward (see `loop.compensation`). The encoder must have the same zero after each
    /// power-up, and `gear` must be whole. Has no effect if the joint has no motor.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = MAX_HARMONICS))]
    pub(crate) cogging: Vec<Harmonic>,
    /// Whether the joint has a motor. A joint without a motor has only an encoder.
    #[serde(default = "yes")]
    pub(crate) motor: bool,
}

impl Joint {
    /// The joint without its motor, on a controller that speaks `protocol`.
    pub(crate) fn encoder(&self, protocol: Protocol) -> core::Joint {
        // A count that is missing has its own message; this one is legal.
        let counts = protocol.counts_per_turn().or(self.counts_per_turn).unwrap_or(MISSING_COUNTS);
        core::Joint {
            gear: self.gear,
            reversed: self.sign < 0,
            zero: self.zero,
            ..core::Joint::new(counts, 0.0)
        }
    }
}

fn one() -> f64 {
    1.0
}

fn forwards() -> i8 {
    1
}

fn unknown() -> core::Zero {
    core::Zero::Calibrate
}

fn yes() -> bool {
    true
}
