//! Parameters of the effect `constant`: a constant torque.

use hbot_core::Vec3;
use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use crate::document::Report;

/// A constant torque on the sphere, like that of a wound-up string. It delivers energy while the
/// sphere turns in its direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Constant {
    /// Torque on the sphere.
    #[schemars(inner(range(min = -100.0, max = 100.0)), extend("unit" = "N m"))]
    torque: [f64; 3],
    /// Axes in which `torque` is given: those of frame N (fixed in space), or those of the sphere.
    frame: Frame,
}

/// The axes in which a constant torque is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Frame {
    /// The axes of frame N, which is fixed in space.
    World,
    /// The sphere's axes, which turn with it.
    Sphere,
}

impl Default for Constant {
    fn default() -> Self {
        Self { torque: [0.0, 0.0, 0.05], frame: Frame::World }
    }
}

impl EffectKind for Constant {
    const NAME: &'static str = "constant";

    fn compile(&self, _: &str, _: &mut Report) -> Option<Kind> {
        let frame = match self.frame {
            Frame::World => effects::Frame::World,
            Frame::Sphere => effects::Frame::Sphere,
        };
        Some(Kind::Constant(effects::Constant { torque: Vec3::from_array(self.torque), frame }))
    }
}
