//! Parameters of the effect `detents`: the notches of a dial.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::knock::KnockKeys;
use super::target::{Anchor, IDENTITY, UP, target, unit_vector};
use super::{EffectKind, IdleKey, idle_keys};
use crate::document::{Report, join};

/// Notches of a dial that turns about an axis. They are evenly spaced or at given angles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Detents {
    /// Axis of the dial, in the axes of the reference. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Largest torque of a notch: the torque needed to leave it.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    strength: f64,
    /// Half the width of a notch. The torque is largest halfway from its centre to its edge. If two
    /// notches are closer than twice this width, their edges meet midway between them.
    #[schemars(range(min = 0.001, max = 3.2), extend("unit" = "rad"))]
    width: f64,
    /// Number of evenly spaced notches in one turn. The first is at the reference.
    #[schemars(range(min = 1, max = 720))]
    count: u16,
    /// Angles of the notches, ascending and at least 0.002 rad apart. They can cover several turns.
    /// If given, they replace `count`.
    #[schemars(length(max = 64), inner(range(min = -1000.0, max = 1000.0)), extend("unit" = "rad"))]
    positions: Vec<f64>,
    /// What happens beyond the first and the last notch in `positions`: no torque, or walls.
    ends: Ends,
    /// Stiffness of the walls if `ends` is `closed`.
    #[schemars(range(min = 0.01, max = 1000.0), extend("unit" = "N m/rad"))]
    end_stiffness: f64,
    /// Damping of the dial's rotation about its axis.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// The knock at an impact.
    #[serde(flatten)]
    knock: KnockKeys,
    /// Orientation at which the dial is at zero, as a quaternion [w, x, y, z]. Any length except
    /// zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

/// What happens beyond the first and the last notch of a dial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Ends {
    /// There is no torque, so the dial turns freely.
    Open,
    /// Walls keep the dial between the first and the last notch.
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
            damping: 0.003,
            knock: KnockKeys::default(),
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for Detents {
    const NAME: &'static str = "detents";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        /// Least angle between two notches, rad. Notches that are closer would act as one.
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
        let law = effects::Detents {
            target: target?,
            axis: axis?,
            strength: self.strength,
            width: self.width,
            count: if self.positions.is_empty() { self.count } else { 0 },
            end_stiffness: if self.ends == Ends::Closed { self.end_stiffness } else { 0.0 },
            damping: self.damping,
        };
        Some(self.knock.added_to(law, Kind::Detents, Kind::KnockingDetents))
    }

    fn numbers(&self) -> Vec<f64> {
        self.positions.clone()
    }

    fn idle(&self) -> Vec<IdleKey> {
        const GIVE: &str = "give positions";
        let count = || idle_keys(&["count"], "positions", "remove positions");
        let mut idle = match (self.positions.is_empty(), self.ends) {
            (true, Ends::Open) => [
                idle_keys(&["ends"], "positions", GIVE),
                idle_keys(&["end_stiffness"], "positions", "give positions and set ends = \"closed\""),
            ]
            .concat(),
            (true, Ends::Closed) => idle_keys(&["ends", "end_stiffness"], "positions", GIVE),
            (false, Ends::Open) => {
                [count(), idle_keys(&["end_stiffness"], "ends", "set ends = \"closed\"")].concat()
            }
            (false, Ends::Closed) => count(),
        };
        idle.extend(self.knock.idle());
        idle
    }
}
