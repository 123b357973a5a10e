//! A person's hand.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A person's hand that holds the sphere: a spring, a damper and a mass to a target that it moves about.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Hand {
    /// Stiffness of its grip, N m/rad.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m/rad"))]
    pub stiffness: f64,
    /// Damping of its grip, N m s/rad.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m s/rad"))]
    pub damping: f64,
    /// Inertia that moves with the sphere, kg m².
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "kg m²"))]
    pub inertia: f64,
    /// How far its target goes from the middle, rad; 0 holds still.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    pub amplitude: f64,
    /// How often its target goes there and back, Hz.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "Hz"))]
    pub rate: f64,
}

impl Default for Hand {
    fn default() -> Self {
        // Physics notes, section 8. The amplitude keeps the target within a rig's usual
        // `enable_max_angle`.
        Self { stiffness: 3.0, damping: 0.05, inertia: 2.0e-3, amplitude: 0.25, rate: 0.25 }
    }
}
