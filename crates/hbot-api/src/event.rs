//! Events: the messages that the server sends without a request.

use crate::names::names;
use crate::{EffectCost, ErrorCode, Fault, Mode, StateEvent};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A message that the server sends without a request from the client. It has a field `event`
/// instead of `id`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// State of the rig in one tick. Sent only to clients that have subscribed.
    State(StateEvent),
    /// The rig has entered or left a fault or an emergency stop. Sent to all clients.
    Fault(FaultEvent),
    /// The lease (the right to command) has changed hands. Sent to all clients, including the one
    /// that lost it.
    Lease(LeaseEvent),
    /// The rig has begun to render another scene. Sent to all clients.
    Scene(SceneEvent),
    /// Parameters of an effect have changed. Sent to all clients.
    Set(SetEvent),
    /// State messages were dropped because this client reads too slowly.
    Dropped(DroppedEvent),
    /// Some of this client's stream messages were refused. Sent at most once per second.
    Refused(RefusedEvent),
    /// The sphere shakes by itself, or has its full torque again after it did. Sent to all clients.
    Shaking(ShakingEvent),
    /// The server is stopping. This is the last message on a connection.
    Stopping(StoppingEvent),
    /// An event that a later version of the server sends and this version cannot read. Ignore it.
    #[serde(other)]
    Unknown,
}

names! {
    /// The name of an [`Event`], as it is written in the field `event` of a message.
    pub enum EventName {
        /// The event [`Event::State`]: the state of the rig in one tick.
        State = "state",
        /// The event [`Event::Fault`]: a fault or an emergency stop has begun or ended.
        Fault = "fault",
        /// The event [`Event::Lease`]: the right to command has changed hands.
        Lease = "lease",
        /// The event [`Event::Scene`]: the rig has begun to render another scene.
        Scene = "scene",
        /// The event [`Event::Set`]: parameters of an effect have changed.
        Set = "set",
        /// The event [`Event::Dropped`]: state messages were dropped.
        Dropped = "dropped",
        /// The event [`Event::Refused`]: stream messages were refused.
        Refused = "refused",
        /// The event [`Event::Shaking`]: the sphere shakes by itself, or has its full torque again.
        Shaking = "shaking",
        /// The event [`Event::Stopping`]: the server is stopping.
        Stopping = "stopping",
    }
}

impl Event {
    /// Returns the name of the event. Returns `None` for an event of a later version.
    #[must_use]
    pub const fn name(&self) -> Option<EventName> {
        Some(match self {
            Self::State(_) => EventName::State,
            Self::Fault(_) => EventName::Fault,
            Self::Lease(_) => EventName::Lease,
            Self::Scene(_) => EventName::Scene,
            Self::Set(_) => EventName::Set,
            Self::Dropped(_) => EventName::Dropped,
            Self::Refused(_) => EventName::Refused,
            Self::Shaking(_) => EventName::Shaking,
            Self::Stopping(_) => EventName::Stopping,
            Self::Unknown => return None,
        })
    }
}

/// The fields of [`Event::Fault`], sent when the rig has entered or left a fault or an emergency
/// stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultEvent {
    /// Number of the tick in which the mode changed.
    pub tick: u64,
    /// Time of the tick in which the mode changed, in seconds since the control loop began.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
    /// Mode after the change: [`Mode::Fault`], [`Mode::Estop`], or the mode after a reset.
    pub mode: Mode,
    /// Cause of the fault. `None` unless the mode is [`Mode::Fault`].
    pub fault: Option<Fault>,
    /// Description for people: what was measured and which limit it exceeded, or who has stopped or
    /// reset the rig.
    pub message: String,
    /// What was found about the fault, and where to look. `None` without a fault.
    #[serde(default)]
    pub found: Option<String>,
    /// What to do about the fault on this rig before a reset, in sentences. `None` without a fault.
    #[serde(default)]
    pub remedy: Option<String>,
    /// Path of the flight log that the server writes about it, on the server's computer. `None` if
    /// it writes none.
    #[serde(default)]
    pub flight_log: Option<String>,
    /// Who stopped or reset the rig. `None` if the rig stopped by itself.
    #[serde(default)]
    pub by: Option<Requester>,
}

/// Who asked for what an event reports.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Requester {
    /// Name of the client, from its `hello`. The name of the signal if a signal stopped the rig.
    pub name: String,
    /// Number of the client's connection, as in its [`HelloOk`](crate::HelloOk). `None` for a
    /// signal.
    pub session: Option<u64>,
}

/// The fields of [`Event::Lease`], sent when the lease (the right to command) has changed hands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseEvent {
    /// Name of the client that now holds the lease. `None` if no client holds it.
    pub holder: Option<String>,
    /// Number of the connection of the client that now holds the lease, as in its
    /// [`HelloOk`](crate::HelloOk). `None` if the lease is free.
    pub session: Option<u64>,
    /// Why the lease changed hands.
    pub cause: LeaseCause,
    /// Who took the lease, gave it back, or lost it with the connection.
    #[serde(default)]
    pub by: Option<Requester>,
}

names! {
    /// Why the lease (the right to command) changed hands.
    pub enum LeaseCause {
        /// A client took the lease, which no client held before.
        Acquired = "acquired",
        /// The client that held the lease gave it back.
        Released = "released",
        /// A client took the lease from another client.
        Stolen = "stolen",
        /// The connection of the client that held the lease ended.
        Disconnected = "disconnected",
    }
}

/// The fields of [`Event::Scene`], sent when the rig has begun to render another scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneEvent {
    /// Number of the first tick that renders the scene.
    pub tick: u64,
    /// Name of the new scene.
    pub name: String,
    /// Effects of the new scene, with the computing time that each needs.
    pub effects: Vec<EffectCost>,
    /// Who loaded the scene.
    #[serde(default)]
    pub by: Option<Requester>,
}

/// The fields of [`Event::Set`], sent when the rig has begun to render changed parameters of an
/// effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetEvent {
    /// Number of the first tick that renders the change.
    pub tick: u64,
    /// Id of the effect.
    pub effect: String,
    /// The new values by the names of the parameters, as `info` gives them.
    pub parameters: Map<String, Value>,
    /// Warnings about the changed scene, as in [`SetOk`](crate::SetOk).
    pub warnings: Vec<String>,
    /// The same warnings in parts.
    #[serde(default)]
    pub advice: Vec<WarningParts>,
    /// Who changed them.
    #[serde(default)]
    pub by: Option<Requester>,
}

/// A warning about a scene, in the parts of which its sentence is made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct WarningParts {
    /// Id of the effect.
    pub effect: Option<String>,
    /// What it warns of, without the effect.
    pub what: String,
    /// The values that lead to it.
    pub why: Option<String>,
    /// What to do about it, a sentence.
    pub remedy: Option<String>,
    /// Whether the scene may shake the sphere.
    pub shakes: bool,
}

/// The fields of [`Event::Dropped`], sent when state messages were dropped because the client reads
/// too slowly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroppedEvent {
    /// Number of state messages dropped since the last event of this kind, at least 1.
    pub count: u64,
    /// Number of state messages dropped on this connection so far.
    pub total: u64,
}

/// The fields of [`Event::Refused`], sent when some of this client's stream messages were refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RefusedEvent {
    /// Number of stream messages refused since the last event of this kind, at least 1.
    pub count: u64,
    /// Number of stream messages refused on this connection so far.
    pub total: u64,
    /// Op of the last refused message. `None` if the op could not be read.
    pub op: Option<String>,
    /// Why the last message was refused, as a code for programs.
    pub code: ErrorCode,
    /// Why the last message was refused, described for people.
    pub message: String,
}

/// The fields of [`Event::Shaking`], sent when the sphere shakes by itself, or has its full torque
/// again after it did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShakingEvent {
    /// Number of the tick in which this was found.
    pub tick: u64,
    /// Time of that tick, in seconds since the control loop began.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
    /// True if the sphere shakes and the torque is lowered. False if the torque has its full value
    /// again.
    pub shaking: bool,
    /// Frequency at which the sphere shakes, Hz. 0 if `shaking` is false.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub frequency: f64,
    /// Largest rate of the sphere about an axis of frame N, rad/s. 0 if `shaking` is false.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub amplitude: f64,
    /// Id of the effect that gives the most energy. `None` if it is not known, or if `shaking` is
    /// false.
    pub effect: Option<String>,
    /// Fraction of the torque that was left when this was found, 0 to 1. If the sphere shakes, it
    /// is lowered further until the sphere is calm.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub gain: f64,
    /// Description for people: what was found, and what to do.
    pub message: String,
}

/// The fields of [`Event::Stopping`], sent before the server stops.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoppingEvent {
    /// Why the server stops, described for people.
    pub message: String,
}
