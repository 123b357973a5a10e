//! Parameters of a texture.

use hbot_core::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{UP, unit_vector};
use crate::document::{Report, join};

/// Bumps on the sphere's surface, felt as it turns past a point that stands still.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Texture {
    /// Where it is felt, a direction in N of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    at: [f64; 3],
    /// How many bumps a turn passes.
    #[schemars(range(min = 1.0, max = 500.0))]
    waves: f64,
    /// The torque of the bumps of each of the sphere's three axes.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    depth: f64,
}

impl Default for Texture {
    fn default() -> Self {
        Self { at: UP, waves: 40.0, depth: 0.02 }
    }
}

impl EffectKind for Texture {
    const NAME: &'static str = "texture";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let at = unit_vector(self.at, &join(path, "at"), report)?;
        Some(Kind::Texture(effects::Texture { at, wave_number: self.waves, depth: self.depth }))
    }
}
