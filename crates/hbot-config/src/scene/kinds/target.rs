//! References, anchors and axes, which several kinds of effects have as parameters.

use hbot_core::render::effects::{self, Target};
use hbot_core::{Quat, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::document::{Report, join};

/// The default of a reference orientation, as a quaternion [w, x, y, z]: no rotation.
pub(super) const IDENTITY: [f64; 4] = [1.0, 0.0, 0.0, 0.0];
/// The default of an axis: upwards, along the third axis of frame N (fixed in space).
pub(super) const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Smallest length of a vector or quaternion. A shorter one has no usable direction.
const LEAST_LENGTH: f64 = 1.0e-6;

/// Names of the parameters that are a vector or quaternion of any length except zero, in all kinds.
const DIRECTIONS: [&str; 4] = ["axis", "pointer", "at", "reference"];

/// Adds a mistake to the report for each vector and quaternion of length zero in the effect `value`
/// at `path` whose parameter has no other mistake.
pub(in crate::scene) fn check_directions(value: &Value, path: &str, report: &mut Report) {
    for key in DIRECTIONS {
        let at = join(path, key);
        if !report.clean_under(&at) {
            continue;
        }
        if let Ok(vector) = <[f64; 3]>::deserialize(&value[key]) {
            unit_vector(vector, &at, report);
        } else if let Ok(quaternion) = <[f64; 4]>::deserialize(&value[key]) {
            unit_quaternion(quaternion, &at, report);
        }
    }
}

/// From where a reference orientation is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Anchor {
    /// From frame N, which is fixed in space.
    Absolute,
    /// From the sphere's orientation when rendering is enabled, or when the scene is loaded if the
    /// rig is already active.
    Here,
}

impl From<Anchor> for effects::Anchor {
    fn from(anchor: Anchor) -> Self {
        match anchor {
            Anchor::Absolute => Self::Absolute,
            Anchor::Here => Self::Here,
        }
    }
}

/// Creates the core's target from the parameters `reference` and `anchor` of the effect at `path`.
/// If the reference has length zero, adds a mistake to the report and returns `None`.
pub(super) fn target(reference: [f64; 4], anchor: Anchor, path: &str, report: &mut Report) -> Option<Target> {
    let reference = unit_quaternion(reference, &join(path, "reference"), report)?;
    Target::new(reference, anchor.into())
}

/// Scales the quaternion [w, x, y, z] at `path` to unit length. If its length is nearly zero, adds
/// a mistake to the report and returns `None`.
pub(super) fn unit_quaternion(wxyz: [f64; 4], path: &str, report: &mut Report) -> Option<Quat> {
    let [w, x, y, z] = wxyz;
    let q = Quat::from_xyzw(x, y, z, w);
    if q.length() < LEAST_LENGTH {
        report.push(path, "the quaternion has no length", "[w, x, y, z], not all zero".to_owned());
        return None;
    }
    Some(q.normalize())
}

/// Scales the vector at `path` to unit length. If its length is nearly zero, adds a mistake to the
/// report and returns `None`.
pub(in crate::scene) fn unit_vector(xyz: [f64; 3], path: &str, report: &mut Report) -> Option<Vec3> {
    let v = Vec3::from_array(xyz);
    if v.length() < LEAST_LENGTH {
        report.push(path, "the vector has no length", "[x, y, z], not all zero".to_owned());
        return None;
    }
    Some(v.normalize())
}
