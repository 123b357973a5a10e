//! The rig file as it is written, and of it what the device is: one struct a table, one field a key, with its range and
//! unit. How the device is run stands in [`settings`](super::settings).
//!
//! Ranges are wide: they keep out what no rig can be and what arithmetic cannot bear, not what is unwise.

use std::f64::consts::{FRAC_PI_2, PI};

use hbot_core::rig::{self as core, legal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::settings::{Api, Limits, Link, Loop, Protocol};

/// Stands in for the counts a turn that a file leaves out by mistake.
const MISSING_COUNTS: u32 = legal::COUNTS_PER_TURN.least as u32;

/// A rig file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigFile {
    /// What people call the rig.
    #[serde(default = "rig_name")]
    #[schemars(length(min = 1, max = 100))]
    pub(crate) name: String,
    /// The sphere, a hollow one turning about its fixed centre.
    pub(crate) sphere: Sphere,
    /// The wheels, each steered about an axis through the sphere's centre and driven.
    #[schemars(length(min = 2, max = 8))]
    pub(crate) wheel: Vec<Wheel>,
    /// The control loop.
    #[serde(default)]
    pub(crate) r#loop: Loop,
    /// The serial line to the motor controllers.
    #[serde(default)]
    pub(crate) link: Link,
    /// What must not be exceeded.
    #[serde(default)]
    pub(crate) limits: Limits,
    /// The TCP service.
    #[serde(default)]
    pub(crate) api: Api,
}

fn rig_name() -> String {
    "Hbot".to_owned()
}

/// The sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sphere {
    /// Radius R.
    #[schemars(range(min = 0.001, max = 10.0), extend("unit" = "m"))]
    pub(crate) radius: f64,
    /// Mass m, taken as a thin shell: its inertia is 2/3 m R².
    #[schemars(range(min = 0.001, max = 1000.0), extend("unit" = "kg"))]
    pub(crate) mass: f64,
}

/// One wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wheel {
    /// What people call the wheel; A, B, C... in the order of the file where absent. Names differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "String", length(min = 1, max = 100))]
    pub(crate) name: Option<String>,
    /// Steering axis through the sphere's centre, in N; of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub(crate) axis: [f64; 3],
    /// Cone angle a, between the steering axis and the contact point.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = PI, "unit" = "rad"))]
    pub(crate) cone: f64,
    /// Toe angle b, about the contact normal.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = -FRAC_PI_2, "exclusiveMaximum" = FRAC_PI_2, "unit" = "rad"))]
    pub(crate) toe: f64,
    /// Wheel radius r.
    #[schemars(range(min = 0.0001, max = 10.0), extend("unit" = "m"))]
    pub(crate) radius: f64,
    /// The joint that turns the wheel about its steering axis.
    pub(crate) steer: Joint,
    /// The joint that turns the wheel about its axle.
    pub(crate) drive: Joint,
}

/// One joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Joint {
    /// Which of the ports in `link.port` carries the joint, from 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 7))]
    pub(crate) port: u32,
    /// The controller of the joint on its serial line. Protocol `hbot`: its position there, from 0 to 15; its place in the order
    /// steer, drive of each wheel among the joints of its port where absent. All joints of a port together name each position
    /// once. Protocols `moteus` (1 to 127) and `odrive` (0 to 63): the controller's id on the bus; required.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = 0, max = 127))]
    pub(crate) controller: Option<u32>,
    /// Encoder counts in one turn of the encoder (lines times 4), before the gear. Required with protocol `hbot`. Absent with the
    /// others, which report turns: the driver counts 131072 a turn with `moteus` and 2097152 with `odrive`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "u32", range(min = legal::COUNTS_PER_TURN.least as u32, max = legal::COUNTS_PER_TURN.most as u32))]
    pub(crate) counts_per_turn: Option<u32>,
    /// Turns of the encoder for one turn of the joint.
    #[serde(default = "one")]
    #[schemars(range(min = legal::GEAR.least, max = legal::GEAR.most))]
    pub(crate) gear: f64,
    /// Whether the controller counts and pushes with the joint's positive sense (1) or against it (-1).
    #[serde(default = "forwards")]
    #[schemars(extend("enum" = [1, -1]))]
    pub(crate) sign: i8,
    /// How the zero of a steering angle becomes known; without meaning for a drive joint.
    #[serde(default = "unknown")]
    pub(crate) zero: core::Zero,
    /// The joint's angle where its encoder says zero, as `hbot rig calibrate` finds it; without meaning for a drive joint.
    #[serde(default)]
    #[schemars(range(min = -6.3, max = 6.3), extend("unit" = "rad"))]
    pub(crate) zero_offset: f64,
    /// Inertia about the joint's axis with everything that turns with it, the rotor seen through its gear.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "kg m²"))]
    pub(crate) inertia: f64,
    /// Largest torque at the joint, after the gear. Required where there is a motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::PEAK.most), extend("exclusiveMinimum" = legal::PEAK.least, "unit" = legal::PEAK.unit))]
    pub(crate) peak: Option<f64>,
    /// Torque at the joint that the motor holds for ever, at most `peak`. Required where there is a motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(max = legal::PEAK.most), extend("exclusiveMinimum" = legal::PEAK.least, "unit" = legal::PEAK.unit))]
    pub(crate) continuous: Option<f64>,
    /// Whether the joint has a motor; false leaves an encoder alone.
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
