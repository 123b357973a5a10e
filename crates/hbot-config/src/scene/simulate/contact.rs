//! Simulated friction at the contacts between wheels and sphere.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limited friction between wheels and sphere. A wheel slips if the force on it exceeds the Coulomb
/// friction force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Slip {
    /// Friction coefficient between wheel and sphere.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub mu: f64,
    /// Normal force of each wheel on the sphere, N.
    #[schemars(range(min = 0.0, max = 10_000.0), extend("unit" = "N"))]
    pub normal_force: f64,
}

impl Default for Slip {
    fn default() -> Self {
        // A usual coefficient for rubber on plastic. The force is assumed.
        Self { mu: 0.8, normal_force: 10.0 }
    }
}

/// Friction torque that opposes the pivoting of each wheel on the sphere, which is its rotation
/// about the contact normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Pivoting {
    /// Friction coefficient between wheel and sphere.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub mu: f64,
    /// Normal force of each wheel on the sphere, N.
    #[schemars(range(min = 0.0, max = 10_000.0), extend("unit" = "N"))]
    pub normal_force: f64,
    /// Radius of the area in which each wheel touches the sphere, m. The pressure in it is assumed
    /// to be uniform.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "m"))]
    pub patch_radius: f64,
}

impl Default for Pivoting {
    fn default() -> Self {
        // Coefficient and force as for `Slip`. The patch is that of a hard tyre, assumed.
        Self { mu: 0.8, normal_force: 10.0, patch_radius: 1.0e-4 }
    }
}
