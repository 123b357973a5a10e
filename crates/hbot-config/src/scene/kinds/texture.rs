//! Parameters of the effect `texture`: a bumpy surface.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{UP, unit_vector};
use crate::document::{Report, join};

/// Bumps on the sphere's surface, which are felt as the surface turns past a point that is fixed in
/// space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Texture {
    /// Direction from the sphere's centre to the fixed point, in frame N (fixed in space). Any
    /// length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    at: [f64; 3],
    /// Number of bumps that pass the fixed point in one turn.
    #[schemars(range(min = 1.0, max = 500.0))]
    waves: f64,
    /// Torque amplitude of the bumps along each of the sphere's three axes.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    depth: f64,
    /// Damping of the sphere's rotation about axes across `at`. A turn about `at` is not damped.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
}

impl Default for Texture {
    fn default() -> Self {
        Self { at: UP, waves: 40.0, depth: 0.02, damping: 0.01 }
    }
}

impl EffectKind for Texture {
    const NAME: &'static str = "texture";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let at = unit_vector(self.at, &join(path, "at"), report)?;
        Some(Kind::Texture(effects::Texture { at, wave_number: self.waves, depth: self.depth }))
    }

    fn numbers(&self) -> Vec<f64> {
        Vec::from_iter((self.damping > 0.0).then_some(self.damping))
    }
}
