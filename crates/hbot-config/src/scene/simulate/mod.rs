//! What the simulated rig shows of a real one, on request of the scene.
//!
//! Each phenomenon is a table; its defaults are those of hbot-sim, where a test of `scene.rs` compares the
//! two. The sources of the figures are there too.

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

pub use self::contact::{Pivoting, Slip};
pub use self::encoder::Encoder;
pub use self::friction::{CageFriction, JointFriction};
pub use self::gear::Gear;
pub use self::hand::Hand;
pub use self::link::Link;
pub use self::masses::{Eccentric, WheelModules};
pub use self::motor::Motor;
use crate::schema;

/// The table `[simulate]`: the phenomena that are there. What is not named is not.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Simulate {
    /// Friction at every joint: Coulomb with a Stribeck peak, and viscous. A joint at rest truly sticks.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "JointFriction")]
    pub joint_friction: Option<JointFriction>,
    /// Coulomb friction of the sphere in its cage.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "CageFriction")]
    pub cage_friction: Option<CageFriction>,
    /// Contacts that hold no more than Coulomb friction: beyond it wheels slip.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Slip")]
    pub slip: Option<Slip>,
    /// Friction of the contact patches against pivoting about their normal.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Pivoting")]
    pub pivoting: Option<Pivoting>,
    /// A sphere that is out of centre: gravity turns it, and wheels roll on a radius that changes.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Eccentric")]
    pub eccentric: Option<Eccentric>,
    /// The weight of each wheel's module on its steering joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "WheelModules")]
    pub wheel_modules: Option<WheelModules>,
    /// Play and losses of the gears on the drive joints, with the encoder on the motor's side.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Gear")]
    pub gear: Option<Gear>,
    /// Encoders that are coarse, run out of centre, or are wrongly zeroed. Whole counts, `counts_per_turn` a turn, are there without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Encoder")]
    pub encoder: Option<Encoder>,
    /// Motors that are weak, lag, slow down and get hot. Peak and continuous torque are those of the rig file.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Motor")]
    pub motor: Option<Motor>,
    /// A serial line that is late and loses or spoils frames, each way, from the first tick on. Frames never overtake one another.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Link")]
    pub link: Option<Link>,
    /// A person's hand that holds the sphere and turns it about.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Hand")]
    pub hand: Option<Hand>,
}

pub(super) static SCHEMA: LazyLock<Value> = LazyLock::new(schema::of::<Simulate>);
