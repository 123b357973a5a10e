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
    /// Axis in frame N about which the hand sweeps, if `angle` is not 0. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub axis: [f64; 3],
    /// Angle to which the hand sweeps about `axis` from where it takes hold, and back, rad. 0: it
    /// moves about all axes, by `amplitude`.
    #[schemars(range(min = -3.0, max = 3.0), extend("unit" = "rad"))]
    pub angle: f64,
    /// Without `angle`: amplitude of the orientation that the hand moves, about each axis, rad. 0:
    /// the hand holds still.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    pub amplitude: f64,
    /// Frequency of the hand's motion about its fastest axis, Hz. With `angle`: number of sweeps per
    /// second, there and back.
    #[schemars(range(min = 0.0, max = 20.0), extend("unit" = "Hz"))]
    pub rate: f64,
}

impl Hand {
    /// The usual hand. The numbers are those of the physics notes, section 8. The amplitude keeps
    /// the hand within a rig's usual `enable_max_angle`.
    pub const USUAL: Self = Self {
        stiffness: 3.0,
        damping: 0.05,
        inertia: 2.0e-3,
        axis: [0.0, 0.0, 1.0],
        angle: 0.0,
        amplitude: 0.25,
        rate: 0.25,
    };
}

impl Default for Hand {
    fn default() -> Self {
        Self::USUAL
    }
}
