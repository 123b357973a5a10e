//! Parameters of the effect `guide`: it holds some rotations and leaves others free.

use hbot_core::render::effects::{self, Freedom, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::target::{Anchor, IDENTITY, UP, target, unit_vector};
use super::{EffectKind, IdleKey, idle_keys};
use crate::document::{Report, join};

/// Prevents some rotations of the sphere and leaves the others free, as a hinge does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Guide {
    /// Which rotations are free: only those about the axis, all others, or those that keep the
    /// pointer in a plane.
    free: Free,
    /// Axis of the guide, in the axes of the reference. With `free = "plane"`, the normal of the
    /// plane. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// With `free = "plane"`: the pointer, an axis fixed in the sphere that is kept in the plane.
    /// Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pointer: [f64; 3],
    /// Stiffness against the rotations that are not free.
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "N m/rad"))]
    stiffness: f64,
    /// Damping of the rotations that are not free.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// Angle in either direction within which there is no spring torque.
    #[schemars(range(min = 0.0, max = 1.5), extend("unit" = "rad"))]
    deadband: f64,
    /// Orientation from which the rotations that are not free are measured, as a quaternion [w, x,
    /// y, z]. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

/// The rotations that a guide leaves free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Free {
    /// Rotation about the axis only, as with a hinge.
    Axis,
    /// Every rotation except that about the axis.
    Swing,
    /// Every rotation that keeps the pointer (an axis of the sphere) in the plane.
    Plane,
}

impl Default for Guide {
    fn default() -> Self {
        Self {
            free: Free::Axis,
            axis: UP,
            pointer: [1.0, 0.0, 0.0],
            stiffness: 3.0,
            damping: 0.03,
            deadband: 0.0,
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for Guide {
    const NAME: &'static str = "guide";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        let axis = unit_vector(self.axis, &join(path, "axis"), report);
        let pointer = unit_vector(self.pointer, &join(path, "pointer"), report);
        let target = target(self.reference, self.anchor, path, report);
        let free = match self.free {
            Free::Axis => Freedom::Axis,
            Free::Swing => Freedom::Swing,
            Free::Plane => Freedom::Plane(pointer?),
        };
        Some(Kind::Guide(effects::Guide {
            target: target?,
            axis: axis?,
            free,
            stiffness: self.stiffness,
            damping: self.damping,
            deadband: self.deadband,
        }))
    }

    fn idle(&self) -> Vec<IdleKey> {
        match self.free {
            Free::Axis | Free::Swing => idle_keys(&["pointer"], "free", "set free = \"plane\""),
            Free::Plane => Vec::new(),
        }
    }
}
