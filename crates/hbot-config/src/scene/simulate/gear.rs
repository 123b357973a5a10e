//! The gears of the drive joints.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Play and losses of the gears on the drive joints, with the encoder on the motor's side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gear {
    /// Whole width of the play, rad of the joint; by default 0.5 degrees.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "rad"))]
    pub backlash: f64,
    /// Part of the power that comes through, either way.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub efficiency: f64,
    /// Part of the drive joint's inertia that sits on the motor's side.
    #[schemars(range(min = 0.01, max = 0.99))]
    pub rotor_share: f64,
}

impl Default for Gear {
    fn default() -> Self {
        Self {
            // 0.5 degrees, of a small spur gearhead, assumed.
            backlash: 0.5 * core::f64::consts::PI / 180.0,
            // Of two stages, assumed.
            efficiency: 0.9,
            // Seen through 17:1 the rotor's inertia is most of it, assumed.
            rotor_share: 0.8,
        }
    }
}
