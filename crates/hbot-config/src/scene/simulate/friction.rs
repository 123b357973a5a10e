//! Friction at the joints and in the cage.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Friction at every joint: Coulomb with a Stribeck peak, and viscous. A joint at rest truly sticks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointFriction {
    /// Coulomb torque of a moving joint, N m.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m"))]
    pub coulomb: f64,
    /// Viscous friction, N m s/rad.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m s/rad"))]
    pub viscous: f64,
    /// Torque that a joint at rest withstands, N m; below `coulomb` it counts as that.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m"))]
    pub breakaway: f64,
    /// Rate over which it falls to Coulomb, rad/s.
    #[schemars(range(min = 1.0e-3, max = 100.0), extend("unit" = "rad/s"))]
    pub stribeck_rate: f64,
}

impl Default for JointFriction {
    fn default() -> Self {
        Self {
            // Of small bearings, assumed: with the cage's it gives back-drive torques like the paper's
            // table II.
            coulomb: 2.0e-4,
            // Assumed.
            viscous: 1.0e-5,
            // That of `coulomb`: no Stribeck peak.
            breakaway: 2.0e-4,
            // Assumed; without meaning where breakaway and coulomb are equal.
            stribeck_rate: 0.5,
        }
    }
}

/// Coulomb friction of the sphere in its cage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CageFriction {
    /// Largest torque, N m.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m"))]
    pub torque: f64,
}

impl Default for CageFriction {
    fn default() -> Self {
        // With that of the joints back-drive torques are about 4.2, 5.0, 4.1 mN m about n1, n2, n3;
        // the paper's are 5, 4, 4.
        Self { torque: 2.0e-3 }
    }
}
