//! Parameters of the effect `end_stop`: walls that limit the rotation.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::knock::KnockKeys;
use super::target::{Anchor, IDENTITY, UP, target, unit_vector};
use super::{EffectKind, IdleKey, idle_keys};
use crate::document::{Report, join};

/// Walls that keep an axis of the sphere inside a cone, its twist about this axis inside a range,
/// or both. The walls only push back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct EndStop {
    /// Which walls exist: those of the cone, those of the twist, or both.
    walls: Walls,
    /// Axis fixed in the sphere. The cone limits its direction, and the twist is the sphere's
    /// rotation about it. Given in the axes of the reference. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Half the opening angle of the cone.
    #[schemars(range(min = 0.0, max = 2.7), extend("unit" = "rad"))]
    cone: f64,
    /// Range in which the walls keep the twist, [from, to]. It can cover several turns.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)), extend("unit" = "rad"))]
    twist: [f64; 2],
    /// Stiffness of the walls.
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "N m/rad"))]
    stiffness: f64,
    /// Damping of the walls. It acts only while the sphere moves deeper into a wall.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// The knock at an impact.
    #[serde(flatten)]
    knock: KnockKeys,
    /// Orientation from which cone and twist are measured, as a quaternion [w, x, y, z]. Any length
    /// except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

/// Which walls an end stop has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Walls {
    /// Only the wall that keeps the axis inside the cone.
    Cone,
    /// Only the walls that keep the twist inside its range.
    Twist,
    /// The wall of the cone and the walls of the twist.
    Both,
}

impl Default for EndStop {
    fn default() -> Self {
        Self {
            walls: Walls::Cone,
            axis: UP,
            cone: 0.6,
            twist: [-1.0, 1.0],
            stiffness: 3.0,
            damping: 0.05,
            knock: KnockKeys::default(),
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for EndStop {
    const NAME: &'static str = "end_stop";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let axis = unit_vector(self.axis, &join(path, "axis"), report);
        let target = target(self.reference, self.anchor, path, report);
        let [from, to] = self.twist;
        if !(from <= to) {
            report.push(
                &join(path, "twist"),
                format!("from {from} to {to}"),
                "[from, to], ascending".to_owned(),
            );
            return None;
        }
        let law = effects::EndStop {
            target: target?,
            axis: axis?,
            cone: (self.walls != Walls::Twist).then_some(self.cone),
            twist: (self.walls != Walls::Cone).then_some(self.twist),
            stiffness: self.stiffness,
            damping: self.damping,
        };
        Some(self.knock.added_to(law, Kind::EndStop, Kind::KnockingEndStop))
    }

    fn idle(&self) -> Vec<IdleKey> {
        let mut idle = match self.walls {
            Walls::Cone => idle_keys(&["twist"], "walls", "set walls = \"twist\" or walls = \"both\""),
            Walls::Twist => idle_keys(&["cone"], "walls", "set walls = \"cone\" or walls = \"both\""),
            Walls::Both => Vec::new(),
        };
        idle.extend(self.knock.idle());
        idle
    }
}
