//! Parameters of the effect `spring`: a spring with a damper.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::impedance::{self, Impedance};
use super::target::{Anchor, IDENTITY, unit_quaternion};
use crate::document::{Report, join};

/// A spring that pulls the sphere towards a reference orientation, and a damper of its rotation
/// relative to the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Spring {
    /// How the torque depends on the angle from the reference: in proportion to it, or to its sine.
    law: Law,
    /// Torque per angle: a number, three for the axes, or a symmetric 3x3 matrix in the
    /// reference's axes.
    #[schemars(schema_with = "impedance::stiffness")]
    stiffness: Impedance,
    /// Torque per angular rate, against the rotation: a number, three for the axes, or a symmetric
    /// 3x3 matrix in the reference's axes.
    #[schemars(schema_with = "impedance::damping")]
    damping: Impedance,
    /// Angle from the reference within which there is no spring torque. Beyond it, the torque is
    /// that of the excess angle.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    deadband: f64,
    /// Orientation that the spring pulls towards, as a quaternion [w, x, y, z]. Any length except
    /// zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

/// How the torque of a spring depends on the angle from the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Law {
    /// The torque is in proportion to the angle, up to a half turn.
    Geodesic,
    /// The torque is in proportion to the sine of the angle: largest at a quarter turn, zero at a
    /// half turn.
    Quaternion,
}

impl Default for Spring {
    fn default() -> Self {
        Self {
            law: Law::Geodesic,
            stiffness: Impedance::Number(1.0),
            damping: Impedance::Number(0.0),
            deadband: 0.0,
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for Spring {
    const NAME: &'static str = "spring";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let stiffness = self.stiffness.matrix(&join(path, "stiffness"), report);
        let damping = self.damping.matrix(&join(path, "damping"), report);
        let reference = unit_quaternion(self.reference, &join(path, "reference"), report);
        let law = match self.law {
            Law::Geodesic => effects::SpringLaw::Geodesic,
            Law::Quaternion => effects::SpringLaw::Quaternion,
        };
        effects::Spring::new(law, stiffness?, damping?, reference?, self.anchor.into())
            .map(|spring| Kind::Spring(spring.with_deadband(self.deadband)))
    }
}
