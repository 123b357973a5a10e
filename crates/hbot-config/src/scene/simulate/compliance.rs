//! Simulated compliance between motors and sphere.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parts between the motors and the sphere that give way under force: each contact along the
/// sphere's surface, and the bearing of the sphere in its cage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Compliance {
    /// Stiffness of each contact between a wheel and the sphere, in any direction along the
    /// surface, N/m. What gives way in tyre, wheel, axle and steering counts in series.
    #[schemars(range(min = 1.0e3, max = 1.0e9), extend("unit" = "N/m"))]
    pub contact_stiffness: f64,
    /// Damping of each contact in the same directions, N s/m.
    #[schemars(range(min = 0.0, max = 1.0e5), extend("unit" = "N s/m"))]
    pub contact_damping: f64,
    /// Stiffness with which the cage holds the centre of the sphere, N/m.
    #[schemars(range(min = 1.0e3, max = 1.0e9), extend("unit" = "N/m"))]
    pub cage_stiffness: f64,
    /// Damping with which the cage holds the centre of the sphere, N s/m.
    #[schemars(range(min = 0.0, max = 1.0e5), extend("unit" = "N s/m"))]
    pub cage_damping: f64,
}

impl Default for Compliance {
    fn default() -> Self {
        Self {
            // A tyre of hard polyurethane (shear modulus G of 15 MPa) with a contact patch of
            // radius a = 1 mm: 8 a G / (2 - nu) is about 8e4 N/m (Mindlin 1949); assumed.
            contact_stiffness: 1.0e5,
            // A loss factor of about 0.1 at 200 Hz; assumed.
            contact_damping: 5.0,
            // A light frame with ball transfer units; the sphere of 467 g rings at 230 Hz in it;
            // assumed.
            cage_stiffness: 1.0e6,
            // 2 % of the critical damping of that; assumed.
            cage_damping: 30.0,
        }
    }
}
