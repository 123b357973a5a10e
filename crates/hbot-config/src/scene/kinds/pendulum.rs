//! Parameters of the effect `pendulum`: an off-centre mass under gravity.

use hbot_core::Vec3;
use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use crate::document::Report;

/// A point mass away from the sphere's centre, which gravity pulls down. Its weight turns the
/// sphere, but it adds no inertia.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Pendulum {
    /// Position of the point mass relative to the sphere's centre, in the sphere's axes.
    #[schemars(inner(range(min = -10.0, max = 10.0)), extend("unit" = "m"))]
    centre: [f64; 3],
    /// The point mass.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "kg"))]
    mass: f64,
    /// Acceleration of gravity, positive downwards in frame N (fixed in space). A negative value
    /// makes the mass rise, like a balloon.
    #[schemars(range(min = -100.0, max = 100.0), extend("unit" = "m/s²"))]
    gravity: f64,
}

impl Default for Pendulum {
    fn default() -> Self {
        Self { centre: [0.0, 0.0, -0.05], mass: 0.4, gravity: 9.81 }
    }
}

impl EffectKind for Pendulum {
    const NAME: &'static str = "pendulum";

    fn compile(&self, _: &str, _: &mut Report) -> Option<Kind> {
        let weight = Vec3::new(0.0, 0.0, -self.mass * self.gravity);
        Some(Kind::Pendulum(effects::Pendulum { centre: Vec3::from_array(self.centre), weight }))
    }
}
