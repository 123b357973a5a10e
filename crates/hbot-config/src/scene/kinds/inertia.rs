//! Parameters of the effect `inertia`: a virtual mass.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::impedance::{self, Impedance};
use crate::document::{Report, join};

/// A virtual mass that resists acceleration. Above a limit it would be unstable, because the
/// acceleration is measured with a delay. Mass beyond the limit is left out. More smoothing allows
/// more mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Inertia {
    /// Virtual mass: a number, three for the axes, or a symmetric 3x3 matrix in frame N (fixed in
    /// space).
    #[schemars(schema_with = "impedance::mass")]
    mass: Impedance,
    /// Time constant of the low-pass filter on the acceleration. Against faster motion, the effect
    /// acts as a damper instead of a mass.
    #[schemars(range(min = 0.001, max = 1.0), extend("unit" = "s"))]
    smoothing_s: f64,
}

impl Default for Inertia {
    fn default() -> Self {
        // About the inertia of the prototype's own sphere.
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
