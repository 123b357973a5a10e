//! References, anchors and axes, as several kinds have them.

use hbot_core::effects::{self, Target};
use hbot_core::{Quat, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::document::{Report, join};

/// The default reference.
pub(super) const IDENTITY: [f64; 4] = [1.0, 0.0, 0.0, 0.0];
/// The default axis: up.
pub(super) const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Shorter ones are noise, not a direction.
const LEAST_LENGTH: f64 = 1.0e-6;

/// What a reference is measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Anchor {
    /// The frame N.
    Absolute,
    /// The orientation at enable, or at load where the rig is active already.
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

/// The target of the keys `reference` and `anchor` of the effect at `path`; `None` where the report says why there is none.
pub(super) fn target(reference: [f64; 4], anchor: Anchor, path: &str, report: &mut Report) -> Option<Target> {
    let reference = unit_quaternion(reference, &join(path, "reference"), report)?;
    Target::new(reference, anchor.into())
}

/// The quaternion [w, x, y, z] scaled to unit length; `None` where the report says that it has no direction.
pub(super) fn unit_quaternion(wxyz: [f64; 4], path: &str, report: &mut Report) -> Option<Quat> {
    let [w, x, y, z] = wxyz;
    let q = Quat::from_xyzw(x, y, z, w);
    if q.length() < LEAST_LENGTH {
        report.push(path, "the quaternion has no length", "[w, x, y, z], not all zero".to_owned());
        return None;
    }
    Some(q.normalize())
}

/// The vector scaled to unit length; `None` where the report says that it has no direction.
pub(super) fn unit_vector(xyz: [f64; 3], path: &str, report: &mut Report) -> Option<Vec3> {
    let v = Vec3::from_array(xyz);
    if v.length() < LEAST_LENGTH {
        report.push(path, "the vector has no length", "[x, y, z], not all zero".to_owned());
        return None;
    }
    Some(v.normalize())
}
