//! Stream messages, which a client sends repeatedly: torques and references that it computes
//! itself, orientations that it measures from outside, and the simulated hand.

use crate::finite;
use serde::{Deserialize, Serialize};

/// Longest time for which a client's torque or angular velocity can be valid, ms.
pub const MAX_VALID_MS: u64 = 1000;

/// Default time for which the angular velocity `omega` of a reference is valid, ms.
pub const DEFAULT_VALID_MS: u64 = 100;

/// Largest component of a torque (N m) or an angular velocity (rad/s) in a request. No rig can
/// reach it, but sums of squares stay finite. The server also applies the limits of the rig.
pub const MAX_MAGNITUDE: f64 = 1e6;

/// Smallest norm of a quaternion in a request. A quaternion with a larger norm is scaled to unit
/// norm.
pub const MIN_QUATERNION_NORM: f64 = 1e-3;

/// A torque on the sphere that a client computes. It is added to the scene's torque until it
/// expires, and then falls to zero over 20 ms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TorqueCommand {
    /// Torque on the sphere in frame N (fixed in space), N m. No component exceeds
    /// [`MAX_MAGNITUDE`].
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// Time from arrival at the server until the torque expires, ms, 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// Tick of the state message from which the client computed this command. The server refuses a
    /// tick older than the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Sequence number, chosen by the client. Every state message contains the number of the last
    /// accepted command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// A new reference orientation for an effect. The effect's reference moves to it at a limited rate,
/// the rig's `reference_rate`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCommand {
    /// Id of an effect in the scene. The effect must have a reference.
    pub effect: String,
    /// The new orientation as a unit quaternion `[w, x, y, z]`. It applies until another arrives.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the reference in frame N (fixed in space), rad/s. No component exceeds
    /// [`MAX_MAGNITUDE`]. It becomes zero when it expires.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub omega: Option<[f64; 3]>,
    /// Time from arrival at the server until `omega` expires, ms, 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// Tick of the state message from which the client computed this command. The server refuses a
    /// tick older than the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Sequence number, chosen by the client. Every state message contains the number of the last
    /// accepted command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

/// Longest time in which the simulated hand turns to an orientation, ms.
pub const MAX_OVER_MS: u64 = 60_000;

/// Default time in which the simulated hand turns to an orientation, ms.
pub const DEFAULT_OVER_MS: u64 = 50;

/// What the simulated hand does. Only a simulated rig has one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum HandCommand {
    /// The hand holds the sphere and turns it.
    Hold(HandHold),
    /// The hand lets go of the sphere.
    Release {
        /// Always true.
        release: bool,
    },
}

impl HandCommand {
    /// The hand lets go of the sphere.
    pub const RELEASE: Self = Self::Release { release: true };
}

/// The orientation to which the simulated hand turns the sphere, and how firm its grip is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HandHold {
    /// The orientation as a unit quaternion `[w, x, y, z]`.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Time in which the hand's target turns there at a constant rate, ms, 0 to [`MAX_OVER_MS`].
    pub over_ms: u64,
    /// Spring stiffness of the grip, N m/rad, 0 to 100. `None`: that of a usual hand, 3.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub stiffness: Option<f64>,
    /// Damping of the grip, N m s/rad, 0 to 10. `None`: that of a usual hand, 0.05.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub damping: Option<f64>,
    /// Moment of inertia that the hand adds to the sphere, kg m², 0 to 1. `None`: that of a usual
    /// hand, 0.002.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub inertia: Option<f64>,
}
/// Smallest standard deviation of a measured angle, rad.
pub const MIN_SIGMA: f64 = 1.0e-5;

/// The sphere's orientation as measured from outside, for example by a camera. The server uses it
/// to correct the drift of the orientation that it computes from the joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Align {
    /// Measured orientation as a unit quaternion `[w, x, y, z]`.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Fraction of the difference to correct: from 0, which only records the measurement, to 1.
    /// With `sigma`, its variances are divided by the weight.
    #[serde(serialize_with = "finite::scalar")]
    pub weight: f64,
    /// Standard deviations of the error of `q` about the axes of frame N (fixed in space), rad,
    /// each [`MIN_SIGMA`] to pi. The server then weighs the measurement by them and by its own
    /// uncertainty, and does not use one that is too far away. `None`: `weight` alone decides.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub sigma: Option<[f64; 3]>,
    /// Time of the measurement, s, on the same clock as the `t` of state messages. Default: the
    /// time of arrival at the server.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub t: Option<f64>,
}

/// A direction of the sphere as measured from outside or by a sensor in the sphere, for example
/// that of gravity. It corrects the orientation except for the turn around the direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignDirection {
    /// The direction in the sphere's axes, a unit vector.
    #[serde(serialize_with = "finite::array")]
    pub body: [f64; 3],
    /// The same direction in frame N (fixed in space), a unit vector.
    #[serde(serialize_with = "finite::array")]
    pub world: [f64; 3],
    /// Standard deviation of the error about each axis across the direction, rad, [`MIN_SIGMA`] to
    /// pi.
    #[serde(serialize_with = "finite::scalar")]
    pub sigma: f64,
    /// Time of the measurement, s, on the same clock as the `t` of state messages. Default: the
    /// time of arrival at the server.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub t: Option<f64>,
}
