//! Simulated masses and centres that are not where an ideal rig has them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A sphere whose centre is displaced. Gravity turns it, and the wheels roll on a varying radius.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Eccentric {
    /// Position of the sphere's true centre relative to its nominal centre, in the sphere's axes,
    /// m.
    #[schemars(inner(range(min = -0.1, max = 0.1)), extend("unit" = "m"))]
    pub offset: [f64; 3],
}

impl Default for Eccentric {
    fn default() -> Self {
        // The tolerance of a good printed or turned shell; assumed.
        Self { offset: [5.0e-4, 0.0, 0.0] }
    }
}

/// A sphere whose weight is off its centre, although the sphere is round and turns about its
/// centre. Gravity turns it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Imbalance {
    /// Weight of the sphere times the position of its centre of mass relative to its centre, in the
    /// sphere's axes, N m. It adds to the weight of an eccentric sphere.
    #[schemars(inner(range(min = -10.0, max = 10.0)), extend("unit" = "N m"))]
    pub torque: [f64; 3],
}

impl Default for Imbalance {
    fn default() -> Self {
        // A mass of 10 g in the shell of the prototype's sphere; assumed.
        Self { torque: [0.01, 0.0, 0.0] }
    }
}

/// The weight of the parts that are steered with each wheel (its module). It acts on the steer
/// joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WheelModules {
    /// Mass of the parts that are steered with each wheel, kg. It is placed at the wheel's centre.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "kg"))]
    pub mass: f64,
}

impl Default for WheelModules {
    fn default() -> Self {
        // Wheel, drive motor and gear together; assumed.
        Self { mass: 0.05 }
    }
}
