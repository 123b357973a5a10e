//! Parameters of the effect `pulse`: clicks.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{Anchor, IDENTITY, UP, target, unit_vector};
use crate::document::{Report, join};

/// Clicks about an axis. A click is a short torque, then its opposite. It occurs when `fire`
/// changes, every `period_s`, and when the sphere, turned like a dial about the axis, reaches the
/// next of `count` notches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Pulse {
    /// Axis of the clicks and of the dial, in the axes of the reference. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Peak torque of a click.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    strength: f64,
    /// Duration of a click.
    #[schemars(range(min = 0.002, max = 1.0), extend("unit" = "s"))]
    duration_s: f64,
    /// Each change of this number makes one click. A value other than 0 also makes a click when the
    /// scene is loaded.
    #[schemars(range(min = 0, max = 4_000_000_000_u32))]
    fire: u32,
    /// Time from one click to the next. 0: there are no periodic clicks.
    #[schemars(range(min = 0.0, max = 3600.0), extend("unit" = "s"))]
    period_s: f64,
    /// Number of evenly spaced notches in one turn of the dial. A click occurs halfway between two
    /// notches. 0: no notches.
    #[schemars(range(min = 0, max = 720))]
    count: u16,
    /// Orientation at which the dial is at zero, as a quaternion [w, x, y, z]. Any length except
    /// zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

impl Default for Pulse {
    fn default() -> Self {
        Self {
            axis: UP,
            strength: 0.1,
            duration_s: 0.01,
            fire: 0,
            period_s: 0.0,
            count: 0,
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for Pulse {
    const NAME: &'static str = "pulse";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let axis = unit_vector(self.axis, &join(path, "axis"), report);
        let target = target(self.reference, self.anchor, path, report);
        Some(Kind::Pulse(effects::Pulse {
            target: target?,
            axis: axis?,
            strength: self.strength,
            duration: self.duration_s,
            fire: self.fire,
            period: self.period_s,
            count: self.count,
        }))
    }
}
