//! Stream messages, which a client sends repeatedly: torques and references that it computes
//! itself, and orientations that it measures from outside.

use crate::finite;
use serde::{Deserialize, Serialize};

/// Longest time for which a stream message can be valid, ms.
pub const MAX_VALID_MS: u64 = 1000;

/// Default time for which the `omega` of a reference is valid, ms.
pub const DEFAULT_VALID_MS: u64 = 100;

/// Largest component of a torque (N m) or an angular velocity (rad/s) in a request. It is far
/// beyond any rig and keeps sums of squares finite. The server applies the limits of the rig.
pub const MAX_MAGNITUDE: f64 = 1e6;

/// Smallest norm of a quaternion in a request. Larger ones are scaled to unit norm.
pub const MIN_QUATERNION_NORM: f64 = 1e-3;

/// A torque on the sphere that is added to the scene's torque until it expires. It then falls to
/// zero over 20 ms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TorqueCommand {
    /// Torque on the sphere in frame N, N m. Each component is within [`MAX_MAGNITUDE`].
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// Time for which the torque holds from its arrival at the server, ms, 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// Tick of the state from which the message was computed. The server refuses a tick older than
    /// the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Sequence number, chosen by the client. Every state contains that of the last accepted
    /// message.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// A new reference of an effect. The reference moves there at the rig's `reference_rate` at most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCommand {
    /// Id of an effect of the scene that has a reference.
    pub effect: String,
    /// Orientation of the reference, `[w, x, y, z]`, unit norm. It stays until another arrives.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the reference in frame N, rad/s. Each component is within
    /// [`MAX_MAGNITUDE`]. It becomes zero when it expires.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub omega: Option<[f64; 3]>,
    /// Time for which `omega` holds from its arrival at the server, ms, 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// Tick of the state from which the message was computed. The server refuses a tick older than
    /// the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Sequence number, chosen by the client. Every state contains that of the last accepted
    /// message.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// The sphere's orientation as measured from outside, for example by a camera. It corrects the
/// drift of the odometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Align {
    /// Measured orientation, `[w, x, y, z]`, unit norm.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Fraction of the difference to correct, from 0 (only record it) to 1.
    #[serde(serialize_with = "finite::scalar")]
    pub weight: f64,
    /// Time of the measurement, s, on the clock of the state's `t`. Default: its arrival.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub t: Option<f64>,
}
