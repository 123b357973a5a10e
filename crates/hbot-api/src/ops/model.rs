//! The op `model`: a local model that a client streams. It is not only a torque, but also how the
//! torque changes as the sphere turns.

use super::{MAX_MAGNITUDE, MAX_VALID_MS, Op, OpRow, Who, may, must};
use crate::fields::{Excerpt, Fields, LEGAL_VECTOR, array, bad, illegal, normalized, number};
use crate::{Client, ClientError, ErrorBody, finite};
use serde::ser::{Error, SerializeSeq};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

/// Largest number of half-spaces in a model.
pub const MAX_PLANES: usize = 8;

/// Longest time in which one model blends into the next, ms.
pub const MAX_BLEND_MS: u64 = 200;

/// Largest turn at which a half-space can begin, rad.
pub const MAX_OFFSET: f64 = 6.3;

/// Largest asymmetry of a stiffness or damping, relative to its largest element. Rounding makes
/// less; what is left is taken out by the mean of both halves.
pub const MAX_ASYMMETRY: f64 = 1e-6;

pub(super) const ROW: OpRow = OpRow::new(
    Who::Holder,
    &[
        may("torque"),
        may("stiffness"),
        may("damping"),
        may("pose"),
        may("planes"),
        must("valid_ms"),
        may("blend_ms"),
        may("soften"),
        may("tick"),
        may("seq"),
    ],
)
.stream();

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
    #[serde(default, skip_serializing_if = "finite::is_false")]
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

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Model(Box::new(ModelCommand {
        torque: fields.optional_vector("torque")?.unwrap_or([0.0; 3]),
        stiffness: impedance(fields, "stiffness")?,
        damping: impedance(fields, "damping")?,
        pose: fields.optional_quaternion("pose")?,
        planes: planes(fields, "planes")?,
        valid_ms: fields.integer("valid_ms", 1, MAX_VALID_MS)?,
        blend_ms: fields.optional_integer("blend_ms", 0, MAX_BLEND_MS)?,
        soften: fields.flag("soften")?,
        tick: fields.optional_integer("tick", 0, u64::MAX)?,
        seq: fields.optional_integer("seq", 0, u64::MAX)?,
    })))
}

/// Removes an optional stiffness or damping. It is 0 if the field is absent. Fails if it is
/// negative about an axis of frame N, or not symmetric. Its other eigenvalues are not checked.
fn impedance(fields: &mut Fields, name: &str) -> Result<Impedance, ErrorBody> {
    let Some(value) = fields.take(name) else { return Ok(Impedance::default()) };
    let Value::Array(items) = &value else {
        if !value.is_number() {
            return Err(illegal(name, &value, LEGAL_IMPEDANCE));
        }
        return number(name, &value, 0.0, MAX_MAGNITUDE).map(Impedance::All);
    };
    if items.len() != 3 {
        return Err(illegal(name, &value, LEGAL_IMPEDANCE));
    }
    let mut rows = [[0.0; 3]; 3];
    for (i, item) in items.iter().enumerate() {
        if items.iter().any(Value::is_array) {
            rows[i] = array(&format!("{name}[{i}]"), item, LEGAL_VECTOR, MAX_MAGNITUDE)?;
        }
        let own = if item.is_array() { &item[i] } else { item };
        rows[i][i] = number(format_args!("{name}[{i}]"), own, 0.0, MAX_MAGNITUDE)?;
    }
    if !items.iter().any(Value::is_array) {
        return Ok(Impedance::Axes([rows[0][0], rows[1][1], rows[2][2]]));
    }
    let largest = rows.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let [above, below] = [rows[i][j], rows[j][i]];
        if (above - below).abs() > MAX_ASYMMETRY * largest {
            return Err(bad(format!(
                "field \"{name}[{i}][{j}]\" is {above}, and \"{name}[{j}][{i}]\" is {below}; legal: a symmetric matrix"
            )));
        }
    }
    Ok(Impedance::Matrix(rows))
}

/// Removes an optional list of half-spaces.
fn planes(fields: &mut Fields, name: &str) -> Result<Vec<PlaneCommand>, ErrorBody> {
    let legal = format_args!("a list of at most {MAX_PLANES} maps");
    let items = match fields.take(name) {
        None => return Ok(Vec::new()),
        Some(Value::Array(items)) if items.len() <= MAX_PLANES => items,
        Some(other) => return Err(illegal(name, &other, legal)),
    };
    let plane = |(i, item): (usize, Value)| {
        let Value::Object(map) = item else {
            return Err(illegal(format_args!("{name}[{i}]"), &item, "a map with \"normal\""));
        };
        let path = |key: &str| format!("{name}[{i}].{key}");
        if let Some(key) = map.keys().find(|key| !PLANE.contains(&key.as_str())) {
            let legal = PLANE.join(", ");
            return Err(bad(format!("unknown field {:?}; legal: {legal}", Excerpt(&path(key)))));
        }
        let mut fields = Fields(map.into_iter().map(|(key, x)| (path(&key), x)).collect());
        let normal = fields.required(&path("normal"), LEGAL_NORMAL)?;
        Ok(PlaneCommand {
            normal: normalized(&path("normal"), &normal, LEGAL_NORMAL)?,
            offset: fields.optional_number(&path("offset"), -MAX_OFFSET, MAX_OFFSET)?.unwrap_or(0.0),
            stiffness: fields.number(&path("stiffness"), 0.0, MAX_MAGNITUDE)?,
            damping: fields.optional_number(&path("damping"), 0.0, MAX_MAGNITUDE)?.unwrap_or(0.0),
        })
    };
    items.into_iter().enumerate().map(plane).collect()
}

const LEGAL_NORMAL: &str = "a list of 3 numbers whose norm is at least 0.001";
const LEGAL_IMPEDANCE: &str = "a number from 0, 3 of them, or the 3 rows of a symmetric matrix";

/// The fields of a half-space in a model.
const PLANE: [&str; 4] = ["normal", "offset", "stiffness", "damping"];

impl Client {
    /// Sends a local model of the torque, without waiting for an answer. Call it again before the
    /// model expires.
    pub fn model(&mut self, command: ModelCommand) -> Result<(), ClientError> {
        self.send(Op::Model(Box::new(command)))
    }

    /// Sends a local model of the torque, and waits for the answer. So a program that begins to
    /// stream learns whether the server refuses its models or softens them.
    pub fn try_model(&mut self, command: ModelCommand) -> Result<ModelOk, ClientError> {
        self.ask(Op::Model(Box::new(command)))
    }
}
