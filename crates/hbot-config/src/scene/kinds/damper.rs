//! Parameters of the effect `damper`: viscous damping.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::impedance::{self, Impedance};
use crate::document::{Report, join};

/// A torque against the sphere's rotation, as if it turned in honey. It only absorbs energy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Damper {
    /// Torque per angular rate, against the rotation: a number, three for the axes, or a symmetric
    /// 3x3 matrix in frame N (fixed in space).
    #[schemars(schema_with = "impedance::damping")]
    damping: Impedance,
    /// Angular rate below which there is no torque. Above it, the torque is in proportion to the
    /// excess.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "rad/s"))]
    deadband: f64,
}

impl Default for Damper {
    fn default() -> Self {
        // Felt clearly in the hand, and far from the stability limit at 1 kHz.
        Self { damping: Impedance::Number(0.02), deadband: 0.0 }
    }
}

impl EffectKind for Damper {
    const NAME: &'static str = "damper";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let damping = self.damping.matrix(&join(path, "damping"), report)?;
        effects::Damper::new(damping).map(|damper| Kind::Damper(damper.with_deadband(self.deadband)))
    }
}
