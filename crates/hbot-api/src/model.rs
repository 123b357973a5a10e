//! The local model that a client streams: not only a torque, but also how it changes as the sphere
//! turns.

use crate::finite;
use serde::ser::{Error, SerializeSeq};
use serde::{Deserialize, Serialize, Serializer};

/// Largest number of half-spaces in a model.
pub const MAX_PLANES: usize = 8;

/// Longest time in which one model blends into the next, ms.
pub const MAX_BLEND_MS: u64 = 200;

/// Largest turn at which a half-space can begin, rad.
pub const MAX_OFFSET: f64 = 6.3;

/// Largest asymmetry of a stiffness or damping, relative to its largest element. Rounding makes
/// less; what is left is taken out by the mean of both halves.
pub const MAX_ASYMMETRY: f64 = 1e-6;

/// A local model of the torque on the sphere. The server renders it in every tick of its loop until
/// it expires, and then lets it fall to zero over 20 ms. Its torque is added to that of the scene:
///
/// T = `torque` - `stiffness` (turn from `pose`) - `damping` (angular velocity) - `planes`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelCommand {
    /// Torque on the sphere at the pose, in frame N (fixed in space), N m. No component exceeds
    /// [`MAX_MAGNITUDE`](crate::MAX_MAGNITUDE).
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// Stiffness in frame N, N m/rad. No eigenvalue is below 0.
    #[serde(default, skip_serializing_if = "Impedance::is_none")]
    pub stiffness: Impedance,
    /// Damping in frame N, N m s/rad. No eigenvalue is below 0.
    #[serde(default, skip_serializing_if = "Impedance::is_none")]
    pub damping: Impedance,
    /// Orientation about which the stiffness acts, a unit quaternion `[w, x, y, z]`. `None`: the
    /// orientation of the state with the number `tick`, or that at arrival without a `tick`.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub pose: Option<[f64; 4]>,
    /// Half-spaces of turns that push the sphere back, at most [`MAX_PLANES`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub planes: Vec<PlaneCommand>,
    /// Time from arrival at the server until the model expires, ms, 1 to
    /// [`MAX_VALID_MS`](crate::MAX_VALID_MS).
    pub valid_ms: u64,
    /// Time in which the torque of before blends into that of this model, ms, 0 to
    /// [`MAX_BLEND_MS`]. `None`: the time since the last model, at most 50 ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blend_ms: Option<u64>,
    /// Whether a model that the loop does not keep stable is rendered with less stiffness. If
    /// false, the server refuses it.
    #[serde(default, skip_serializing_if = "is_false")]
    pub soften: bool,
    /// Tick of the state message from which the client computed this model. The server refuses a
    /// tick older than the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Sequence number, chosen by the client. Every state message contains the number of the last
    /// accepted command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// A half-space of turns that pushes the sphere back, such as a contact. It never pulls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlaneCommand {
    /// Unit vector in frame N about which a turn leads into the half-space.
    #[serde(serialize_with = "finite::array")]
    pub normal: [f64; 3],
    /// Turn from the model's pose about the normal at which the half-space begins, rad, at most
    /// [`MAX_OFFSET`] in either direction. If it is negative, the pose is inside.
    #[serde(serialize_with = "finite::scalar")]
    pub offset: f64,
    /// Stiffness, N m/rad, not below 0.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness: f64,
    /// Damping inside of the half-space, N m s/rad, not below 0.
    #[serde(default, serialize_with = "finite::scalar")]
    pub damping: f64,
}

/// A stiffness or damping: the same about all axes, one for each axis of frame N, or a symmetric
/// matrix given by its rows.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Impedance {
    /// The same about all axes.
    All(f64),
    /// One about each axis of frame N.
    Axes([f64; 3]),
    /// The rows of a symmetric matrix in frame N.
    Matrix([[f64; 3]; 3]),
}

impl Default for Impedance {
    fn default() -> Self {
        Self::All(0.0)
    }
}

impl From<f64> for Impedance {
    fn from(all: f64) -> Self {
        Self::All(all)
    }
}

impl From<[f64; 3]> for Impedance {
    fn from(axes: [f64; 3]) -> Self {
        Self::Axes(axes)
    }
}

impl From<[[f64; 3]; 3]> for Impedance {
    fn from(rows: [[f64; 3]; 3]) -> Self {
        Self::Matrix(rows)
    }
}

impl Impedance {
    /// Returns the rows of the matrix in frame N. A matrix whose halves differ by rounding becomes
    /// exactly symmetric.
    #[must_use]
    pub fn rows(&self) -> [[f64; 3]; 3] {
        let diagonal = |[x, y, z]: [f64; 3]| [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]];
        match *self {
            Self::All(all) => diagonal([all; 3]),
            Self::Axes(axes) => diagonal(axes),
            Self::Matrix(rows) => [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (rows[i][j] + rows[j][i]))),
        }
    }

    /// Returns true if it is zero about all axes, written as one number.
    fn is_none(&self) -> bool {
        matches!(self, Self::All(all) if all.to_bits() == 0)
    }
}

impl Serialize for Impedance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All(all) => finite::scalar(all, serializer),
            Self::Axes(axes) => finite::array(axes, serializer),
            Self::Matrix(rows) => {
                if !rows.as_flattened().iter().all(|x| x.is_finite()) {
                    return Err(S::Error::custom("a number to be sent is not finite"));
                }
                let mut list = serializer.serialize_seq(Some(3))?;
                for row in rows {
                    list.serialize_element(row)?;
                }
                list.end()
            }
        }
    }
}

/// The answer to the op `model`, if it has an id.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelOk {
    /// Fraction of the stiffness that is rendered. It is below 1 only if the request has allowed
    /// the server to soften the model.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness_scale: f64,
}

fn is_false(flag: &bool) -> bool {
    !flag
}
