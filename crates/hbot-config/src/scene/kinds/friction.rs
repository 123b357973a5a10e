//! Parameters of the effect `friction`: dry friction.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use crate::document::Report;

/// Dry friction: the sphere sticks until the torque on it reaches the limit `torque`, then it
/// slides. It only absorbs energy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Friction {
    /// Torque above which the sphere slides.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    torque: f64,
    /// Stiffness of the spring that holds the sphere while it sticks.
    #[schemars(range(min = 0.1, max = 1000.0), extend("unit" = "N m/rad"))]
    stiffness: f64,
    /// Damping of the sphere's rotation, both while it sticks and while it slides.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
}

impl Default for Friction {
    fn default() -> Self {
        // While it sticks, the sphere gives way by at most 6 mrad (torque over stiffness).
        Self { torque: 0.03, stiffness: 5.0, damping: 0.005 }
    }
}

impl EffectKind for Friction {
    const NAME: &'static str = "friction";

    fn compile(&self, _: &str, _: &mut Report) -> Option<Kind> {
        let Self { torque, stiffness, damping } = *self;
        Some(Kind::Friction(effects::Friction { torque, stiffness, damping }))
    }
}
