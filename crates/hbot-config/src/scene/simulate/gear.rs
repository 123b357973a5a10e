//! Simulated imperfections of the gears on the drive joints.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Backlash and losses in the gears of the drive joints. The encoder is on the motor's side of the
/// gear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gear {
    /// Total width of the backlash, rad of the joint. The default is 0.5 degrees.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "rad"))]
    pub backlash: f64,
    /// Fraction of the power that the gear transmits, in either direction.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub efficiency: f64,
    /// Fraction of the drive joint's inertia that is on the motor's side of the gear.
    #[schemars(range(min = 0.01, max = 0.99))]
    pub rotor_share: f64,
}

impl Default for Gear {
    fn default() -> Self {
        Self {
            // 0.5 degrees, as for a small spur gearhead; assumed.
            backlash: 0.5 * core::f64::consts::PI / 180.0,
            // As for two stages; assumed.
            efficiency: 0.9,
            // Seen through a gear of 17:1, the rotor has most of the inertia; assumed.
            rotor_share: 0.8,
        }
    }
}
