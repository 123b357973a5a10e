//! Parameters of a pulse.

use hbot_core::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{Anchor, IDENTITY, UP, target, unit_vector};
use crate::document::{Report, join};

/// Clicks: a short push and its opposite about an axis. One comes whenever `fire` is set to another number, at every
/// `period_s`, and whenever the dial about the axis passes from one of `count` notches to the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Pulse {
    /// The axis in the frame of the reference, of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Torque at the crest of a click.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    strength: f64,
    /// How long a click lasts.
    #[schemars(range(min = 0.002, max = 1.0), extend("unit" = "s"))]
    duration_s: f64,
    /// Setting another number clicks once; other than 0 it clicks at load too.
    #[schemars(range(min = 0, max = 4_000_000_000_u32))]
    fire: u32,
    /// Time from click to click; 0 for none.
    #[schemars(range(min = 0.0, max = 3600.0), extend("unit" = "s"))]
    period_s: f64,
    /// Notches around a turn that click when the next is reached, as `detents` has them; 0 for none.
    #[schemars(range(min = 0, max = 720))]
    count: u16,
    /// Where the dial is at zero, a quaternion [w, x, y, z] of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// What the reference is measured from.
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
