//! Parameters of a virtual mass.

use hbot_core::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::impedance::{self, Impedance};
use crate::document::{Report, join};

/// A virtual mass: resistance against being sped up or slowed down. The acceleration is measured late, so no rig renders more
/// than a part of its own inertia, more of it the smoother; what a scene asks beyond that is left out (docs/effects.md).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Inertia {
    /// The mass: a number, or a symmetric 3x3 matrix in N.
    #[schemars(schema_with = "impedance::mass")]
    mass: Impedance,
    /// Time constant of the acceleration's smoothing; quicker motion feels a damper instead.
    #[schemars(range(min = 0.001, max = 1.0), extend("unit" = "s"))]
    smoothing_s: f64,
}

impl Default for Inertia {
    fn default() -> Self {
        // As much again as the prototype's own sphere.
        Self { mass: Impedance::Number(0.003), smoothing_s: 0.01 }
    }
}

impl EffectKind for Inertia {
    const NAME: &'static str = "inertia";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let mass = self.mass.matrix(&join(path, "mass"), report)?;
        Some(Kind::Inertia(effects::Inertia { mass, smoothing: self.smoothing_s }))
    }
}
