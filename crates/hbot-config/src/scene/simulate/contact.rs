//! What the contacts between wheels and sphere hold.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contacts that hold no more than Coulomb friction: beyond it wheels slip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Slip {
    /// Friction coefficient.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub mu: f64,
    /// Normal force of each wheel, N.
    #[schemars(range(min = 0.0, max = 10_000.0), extend("unit" = "N"))]
    pub normal_force: f64,
}

impl Default for Slip {
    fn default() -> Self {
        // Usual for rubber on plastic; the force is assumed.
        Self { mu: 0.8, normal_force: 10.0 }
    }
}

/// Friction of the contact patches against pivoting about their normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Pivoting {
    /// Friction coefficient.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub mu: f64,
    /// Normal force of each wheel, N.
    #[schemars(range(min = 0.0, max = 10_000.0), extend("unit" = "N"))]
    pub normal_force: f64,
    /// Radius of the contact patch, m; pressure is taken as even.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "m"))]
    pub patch_radius: f64,
}

impl Default for Pivoting {
    fn default() -> Self {
        // As for slip; the patch of a hard tyre, assumed.
        Self { mu: 0.8, normal_force: 10.0, patch_radius: 1.0e-4 }
    }
}
