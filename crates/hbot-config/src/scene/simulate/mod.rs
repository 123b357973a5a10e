//! The imperfections of a real rig that a scene can switch on in the simulated rig.
//!
//! Each phenomenon is a table, defined only here. The crate hbot-sim computes with the same types.
//! Comments at the defaults name their sources. Equations are in docs/simulator.md,
//! methods and validation in docs/internals/plant.md.

mod compliance;
mod contact;
mod encoder;
mod friction;
mod gear;
mod hand;
mod link;
mod masses;
mod motor;

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use self::compliance::Compliance;
pub use self::contact::{Pivoting, Slip};
pub use self::encoder::Encoder;
pub use self::friction::{CageFriction, JointFriction};
pub use self::gear::Gear;
pub use self::hand::Hand;
pub use self::link::Link;
pub use self::masses::{Eccentric, Imbalance, WheelModules};
pub use self::motor::{Cogging, Motor, TorqueConstants};
use crate::schema;

/// The table `[simulate]` of a scene file. It switches on phenomena of the simulated rig. Absent
/// phenomena are not simulated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Simulate {
    /// Friction in every joint: Coulomb friction with a Stribeck peak, and viscous friction. A
    /// joint at rest sticks.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "JointFriction")]
    pub joint_friction: Option<JointFriction>,
    /// Coulomb friction between the sphere and the cage that holds it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "CageFriction")]
    pub cage_friction: Option<CageFriction>,
    /// Limited friction between wheels and sphere. A wheel slips if the force on it exceeds the
    /// Coulomb friction force.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Slip")]
    pub slip: Option<Slip>,
    /// Friction torque that opposes the pivoting of each wheel on the sphere, which is its rotation
    /// about the contact normal.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Pivoting")]
    pub pivoting: Option<Pivoting>,
    /// A sphere whose centre is displaced. Gravity turns it, and the wheels roll on a varying
    /// radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Eccentric")]
    pub eccentric: Option<Eccentric>,
    /// A sphere whose weight is off its centre, although the sphere is round and turns about its
    /// centre. Gravity turns it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Imbalance")]
    pub imbalance: Option<Imbalance>,
    /// The weight of the parts that are steered with each wheel (its module). It acts on the steer
    /// joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "WheelModules")]
    pub wheel_modules: Option<WheelModules>,
    /// Backlash and losses in the gears of the drive joints. The encoder is on the motor's side of
    /// the gear.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Gear")]
    pub gear: Option<Gear>,
    /// Parts between the motors and the sphere that give way under force: each contact along the
    /// sphere's surface, and the bearing of the sphere in its cage.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Compliance")]
    pub compliance: Option<Compliance>,
    /// Encoders with coarse resolution, periodic errors or a wrong zero. Rounding to whole encoder
    /// counts (`counts_per_turn`) is simulated even without this table.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Encoder")]
    pub encoder: Option<Encoder>,
    /// Motors that are not ideal. They make less torque than commanded, respond late, lose torque
    /// at high speed, and give only their continuous torque when they are hot. Their peak and
    /// continuous torques are those of the rig file.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Motor")]
    pub motor: Option<Motor>,
    /// Motors whose torque constants differ from those that their controllers believe, each by
    /// another fraction.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "TorqueConstants")]
    pub torque_constants: Option<TorqueConstants>,
    /// Motors whose magnets pull the rotor towards some angles: a torque that repeats with the
    /// angle of the encoder, in two harmonics.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Cogging")]
    pub cogging: Option<Cogging>,
    /// A serial line that delays, loses and corrupts frames in both directions, from the first tick
    /// on. Frames in the same direction keep their order.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Link")]
    pub link: Option<Link>,
    /// A person's hand that holds the sphere and moves it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Hand")]
    pub hand: Option<Hand>,
}

pub(super) static SCHEMA: LazyLock<Value> = LazyLock::new(schema::of::<Simulate>);
