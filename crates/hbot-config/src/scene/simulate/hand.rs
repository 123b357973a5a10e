//! The simulated hand of a person who holds the sphere.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A person's hand that holds the sphere. It adds inertia to the sphere. Its grip, a spring and a
/// damper, pulls the sphere towards an orientation that the hand moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Hand {
    /// Spring stiffness of the hand's grip, N m/rad.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m/rad"))]
    pub stiffness: f64,
    /// Damping of the hand's grip, N m s/rad.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "N m s/rad"))]
    pub damping: f64,
    /// Moment of inertia that the hand adds to the sphere, kg m².
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "kg m²"))]
    pub inertia: f64,
    /// Amplitude of the orientation that the hand moves, about each axis, rad. 0: the hand holds
    /// still.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    pub amplitude: f64,
    /// Frequency of the hand's motion about its fastest axis, Hz.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "Hz"))]
    pub rate: f64,
}

impl Default for Hand {
    fn default() -> Self {
        // From the physics notes, section 8. The amplitude keeps the hand within a rig's usual
        // `enable_max_angle`.
        Self { stiffness: 3.0, damping: 0.05, inertia: 2.0e-3, amplitude: 0.25, rate: 0.25 }
    }
}
