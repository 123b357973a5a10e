//! Parameters of the effect `snaps`: orientations that attract the sphere.

use hbot_core::Quat;
use hbot_core::render::effects::{self, Kind, MAX_OWN, SnapSet};
use hbot_core::rotation::{angle_between, to_wxyz};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::knock::KnockKeys;
use super::target::{Anchor, IDENTITY, target, unit_quaternion};
use super::{EffectKind, IdleKey};
use crate::document::{Report, join};

/// Pulls the sphere towards the nearest of a set of orientations. The set is that of a rotation
/// group, or a given list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Snaps {
    /// Which set of orientations pulls the sphere: those of a solid's symmetry, or the list
    /// `orientations`.
    set: Set,
    /// With `set = "own"`: the orientations relative to the reference, as quaternions [w, x, y, z].
    /// Any length except zero, and at least 0.2 rad apart.
    #[schemars(
        length(max = MAX_OWN),
        inner(inner(range(min = -1000.0, max = 1000.0))),
        extend("legal" = "up to 16 quaternions [w, x, y, z]")
    )]
    orientations: Vec<[f64; 4]>,
    /// Largest torque with which an orientation pulls: the torque needed to leave it.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    strength: f64,
    /// Angle over which the torque rises to `strength`. `strength` divided by `width` is the
    /// stiffness at an orientation.
    #[schemars(range(min = 0.01, max = 3.0), extend("unit" = "rad"))]
    width: f64,
    /// Damping of the sphere's rotation.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// The knock at an impact.
    #[serde(flatten)]
    knock: KnockKeys,
    /// Orientation from which those of the set are measured, as a quaternion [w, x, y, z]. Any
    /// length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

/// The set of orientations towards which the sphere is pulled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Set {
    /// The 12 rotations that map a tetrahedron onto itself.
    Tetrahedron,
    /// The 24 rotations that map a cube onto itself.
    Cube,
    /// The 60 rotations that map an icosahedron onto itself.
    Icosahedron,
    /// The orientations in the list `orientations`.
    Own,
}

impl From<Set> for SnapSet {
    fn from(set: Set) -> Self {
        match set {
            Set::Tetrahedron => Self::Tetrahedron,
            Set::Cube => Self::Cube,
            Set::Icosahedron => Self::Icosahedron,
            Set::Own => Self::Own,
        }
    }
}

impl Default for Snaps {
    fn default() -> Self {
        Self {
            set: Set::Cube,
            orientations: Vec::new(),
            strength: 0.1,
            width: 0.2,
            damping: 0.01,
            knock: KnockKeys::default(),
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl EffectKind for Snaps {
    const NAME: &'static str = "snaps";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        /// Least angle between two orientations, rad. Orientations that are closer would merge into
        /// one.
        const APART: f64 = 0.2;
        let target = target(self.reference, self.anchor, path, report);
        let at = join(path, "orientations");
        match (self.set, self.orientations.is_empty()) {
            (Set::Own, true) => {
                report.push(
                    &at,
                    "the set is \"own\" and there is none",
                    format!("1 to {MAX_OWN} quaternions"),
                );
                return None;
            }
            (Set::Own, false) | (_, true) => {}
            (_, false) => {
                report.push(&at, "the set is not \"own\"", "no orientations, or set = \"own\"".to_owned());
                return None;
            }
        }
        let mut own: Vec<Quat> = Vec::new();
        for (i, wxyz) in self.orientations.iter().enumerate() {
            let at = format!("{at}[{i}]");
            let q = unit_quaternion(*wxyz, &at, report)?;
            if let Some(j) = own.iter().position(|other| !(angle_between(*other, q) >= APART)) {
                let message = format!("only {:.3} rad from orientation {j}", angle_between(own[j], q));
                report.push(&at, message, format!("{APART} rad apart or more"));
                return None;
            }
            own.push(q);
        }
        let law = effects::Snaps {
            target: target?,
            set: self.set.into(),
            strength: self.strength,
            width: self.width,
            rounding: effects::Snaps::rounding(self.set.into(), &self.numbers()),
            damping: self.damping,
        };
        Some(self.knock.added_to(law, Kind::Snaps, Kind::KnockingSnaps))
    }

    fn numbers(&self) -> Vec<f64> {
        let unit = |[w, x, y, z]: &[f64; 4]| to_wxyz(Quat::from_xyzw(*x, *y, *z, *w).normalize());
        self.orientations.iter().flat_map(unit).collect()
    }

    fn idle(&self) -> Vec<IdleKey> {
        self.knock.idle()
    }
}
