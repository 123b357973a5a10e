//! Simulated friction at the joints and in the cage.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Friction in every joint: Coulomb friction with a Stribeck peak, and viscous friction. A joint at
/// rest sticks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointFriction {
    /// Coulomb friction torque of a moving joint, N m.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m"))]
    pub coulomb: f64,
    /// Viscous friction coefficient of a joint, N m s/rad.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m s/rad"))]
    pub viscous: f64,
    /// Largest friction torque of a joint at rest, N m. A value below `coulomb` is replaced by
    /// `coulomb`.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m"))]
    pub breakaway: f64,
    /// Joint rate over which the friction falls from `breakaway` to `coulomb`, rad/s.
    #[schemars(range(min = 1.0e-3, max = 100.0), extend("unit" = "rad/s"))]
    pub stribeck_rate: f64,
}

impl Default for JointFriction {
    fn default() -> Self {
        Self {
            // Small bearings, assumed. Together with the cage's friction it gives back-drive
            // torques like those in the paper's table II.
            coulomb: 2.0e-4,
            // Assumed.
            viscous: 1.0e-5,
            // Equal to `coulomb`, so there is no Stribeck peak.
            breakaway: 2.0e-4,
            // Assumed. It has no effect while `breakaway` equals `coulomb`.
            stribeck_rate: 0.5,
        }
    }
}

/// Coulomb friction between the sphere and the cage that holds it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CageFriction {
    /// Largest friction torque on the sphere, N m.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m"))]
    pub torque: f64,
}

impl Default for CageFriction {
    fn default() -> Self {
        // Together with the joints' friction it gives back-drive torques of about 4.2, 5.0 and 4.1
        // mN m about n1, n2 and n3. The paper's are 5, 4 and 4 mN m.
        Self { torque: 2.0e-3 }
    }
}
