//! Parameters of detents.

use hbot_core::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{Anchor, IDENTITY, UP, target, unit_vector};
use crate::document::{Report, join};

/// Notches of a dial about an axis: evenly around, or at given angles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Detents {
    /// The dial's axis in the frame of the reference, of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// The largest torque of a notch: what it takes to leave it.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    strength: f64,
    /// Half width of a notch; its torque is largest half way. Notches nearer than twice this meet half way.
    #[schemars(range(min = 0.001, max = 3.2), extend("unit" = "rad"))]
    width: f64,
    /// How many notches evenly around a turn, the first at the reference.
    #[schemars(range(min = 1, max = 720))]
    count: u16,
    /// Angles of the notches, ascending and 0.002 rad apart or more, over as many turns as one likes; where there are any, they
    /// stand in place of `count`.
    #[schemars(length(max = 64), inner(range(min = -1000.0, max = 1000.0)), extend("unit" = "rad"))]
    positions: Vec<f64>,
    /// What is beyond the outermost of `positions`.
    ends: Ends,
    /// Stiffness of the walls at closed ends.
    #[schemars(range(min = 0.01, max = 1000.0), extend("unit" = "N m/rad"))]
    end_stiffness: f64,
    /// Damping of the dial.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// Where the dial is at zero, a quaternion [w, x, y, z] of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// What the reference is measured from.
    anchor: Anchor,
}

/// What is beyond the outermost notches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Ends {
    /// Level ground.
    Open,
    /// Walls that rise from the outermost notches themselves.
    Closed,
}

impl Default for Detents {
    fn default() -> Self {
        Self {
            axis: UP,
            strength: 0.05,
            width: 0.1,
            count: 12,
            positions: Vec::new(),
            ends: Ends::Open,
            end_stiffness: 2.0,
            damping: 0.002,
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for Detents {
    const NAME: &'static str = "detents";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        /// Nearer ones are one.
        const APART: f64 = 0.002;
        let axis = unit_vector(self.axis, &join(path, "axis"), report);
        let target = target(self.reference, self.anchor, path, report);
        let near = |pair: &[f64]| !(pair[1] - pair[0] >= APART);
        if let Some(i) = self.positions.windows(2).position(near) {
            let message = format!("{} does not follow {}", self.positions[i + 1], self.positions[i]);
            report.push(
                &format!("{}[{}]", join(path, "positions"), i + 1),
                message,
                format!("ascending, {APART} rad apart or more"),
            );
            return None;
        }
        Some(Kind::Detents(effects::Detents {
            target: target?,
            axis: axis?,
            strength: self.strength,
            width: self.width,
            count: if self.positions.is_empty() { self.count } else { 0 },
            end_stiffness: if self.ends == Ends::Closed { self.end_stiffness } else { 0.0 },
            damping: self.damping,
        }))
    }

    fn figures(&self) -> Vec<f64> {
        self.positions.clone()
    }
}
