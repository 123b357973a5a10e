//! Parameters of the effect `magnet`: attraction near an orientation.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{Anchor, IDENTITY, target};
use crate::document::Report;

/// A torque that pulls the sphere towards an orientation. Far from this orientation, the torque is
/// almost zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Magnet {
    /// Largest torque of the magnet.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    strength: f64,
    /// Angle from the reference at which the torque is largest. At three times this angle, little
    /// torque is left.
    #[schemars(range(min = 0.01, max = 2.0), extend("unit" = "rad"))]
    width: f64,
    /// Damping of the sphere's rotation at the reference. Far from it, there is no damping.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// Orientation that the magnet pulls towards, as a quaternion [w, x, y, z]. Any length except
    /// zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

impl Default for Magnet {
    fn default() -> Self {
        Self { strength: 0.15, width: 0.2, damping: 0.01, reference: IDENTITY, anchor: Anchor::Absolute }
    }
}

impl EffectKind for Magnet {
    const NAME: &'static str = "magnet";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let target = target(self.reference, self.anchor, path, report)?;
        Some(Kind::Magnet(effects::Magnet { target, strength: self.strength, width: self.width }))
    }

    fn numbers(&self) -> Vec<f64> {
        Vec::from_iter((self.damping > 0.0).then_some(self.damping))
    }
}
