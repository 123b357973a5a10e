//! What a client sends again and again: torques and references that it renders itself, and orientations that it sees
//! from outside.

use crate::finite;
use serde::{Deserialize, Serialize};

/// The longest that a stream message is valid, ms.
pub const MAX_VALID_MS: u64 = 1000;

/// How long the `omega` of a reference is valid where it does not say, ms.
pub const DEFAULT_VALID_MS: u64 = 100;

/// The largest component of a torque (N m) or an angular velocity (rad/s) that is read. It is far beyond any rig and
/// keeps sums of squares finite; the rig's own limits are the server's to apply.
pub const MAX_MAGNITUDE: f64 = 1e6;

/// The least norm of a quaternion that is taken for one. Those of other norms are brought to 1.
pub const MIN_QUATERNION_NORM: f64 = 1e-3;

/// A torque on the sphere, added to what the scene renders until it expires; then it goes to zero over 20 ms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TorqueCommand {
    /// Torque on the sphere in N, N m; each component within [`MAX_MAGNITUDE`].
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// How long it holds from its arrival at the server, ms, from 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// The tick of the state from which it was computed. The server refuses one older than the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// A number of the client's own; the one taken last is in every state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// Where an effect's reference is to go, at most at the rig's `reference_rate`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCommand {
    /// The id of an effect of the scene that has a reference.
    pub effect: String,
    /// Orientation of the reference, `[w, x, y, z]`, unit norm. It stays until another comes.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the reference in N, rad/s; each component within [`MAX_MAGNITUDE`]. Zero once it expires.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub omega: Option<[f64; 3]>,
    /// How long `omega` holds from its arrival at the server, ms, from 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// The tick of the state from which it was computed. The server refuses one older than the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// A number of the client's own; the one taken last is in every state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// The sphere's orientation as seen from outside, by a camera for example, against the drift of odometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Align {
    /// Orientation seen, `[w, x, y, z]`, unit norm.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// The share of the difference to take over, from 0 (record it only) to 1.
    #[serde(serialize_with = "finite::scalar")]
    pub weight: f64,
    /// When it was seen, s, on the clock of the state's `t`. Where absent: on arrival.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub t: Option<f64>,
}
