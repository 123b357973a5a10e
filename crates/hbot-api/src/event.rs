//! Events: the messages that the server sends without a request.

use crate::names::names;
use crate::{EffectCost, ErrorCode, Fault, Mode, StateEvent};
use serde::{Deserialize, Serialize};

/// A message that the server sends without a request. It has a field `event` instead of `id`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// State of the rig in one tick. Sent to clients that have subscribed.
    State(StateEvent),
    /// The rig has entered or left a fault or an emergency stop. Sent to all clients.
    Fault(FaultEvent),
    /// The lease has changed hands. Sent to all clients, including the one that lost it.
    Lease(LeaseEvent),
    /// Another scene is being rendered. Sent to all clients.
    Scene(SceneEvent),
    /// States were dropped because this client reads too slowly.
    Dropped(DroppedEvent),
    /// Stream messages of this client were refused. Sent at most once per second.
    Refused(RefusedEvent),
    /// The server is stopping. This is the last message of a connection.
    Stopping(StoppingEvent),
    /// An event of a later server that this version does not know. Ignore it.
    #[serde(other)]
    Unknown,
}

names! {
    /// The name of an [`Event`], as it is sent in the field `event`.
    pub enum EventName {
        /// Name of [`Event::State`].
        State = "state",
        /// Name of [`Event::Fault`].
        Fault = "fault",
        /// Name of [`Event::Lease`].
        Lease = "lease",
        /// Name of [`Event::Scene`].
        Scene = "scene",
        /// Name of [`Event::Dropped`].
        Dropped = "dropped",
        /// Name of [`Event::Refused`].
        Refused = "refused",
        /// Name of [`Event::Stopping`].
        Stopping = "stopping",
    }
}

impl Event {
    /// Returns the name of the event. `None` for an event that this version does not know.
    #[must_use]
    pub const fn name(&self) -> Option<EventName> {
        Some(match self {
            Self::State(_) => EventName::State,
            Self::Fault(_) => EventName::Fault,
            Self::Lease(_) => EventName::Lease,
            Self::Scene(_) => EventName::Scene,
            Self::Dropped(_) => EventName::Dropped,
            Self::Refused(_) => EventName::Refused,
            Self::Stopping(_) => EventName::Stopping,
            Self::Unknown => return None,
        })
    }
}

/// The fields of [`Event::Fault`]: the rig has entered or left a fault or an emergency stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultEvent {
    /// Tick in which the mode changed.
    pub tick: u64,
    /// Time of that tick since the loop began, s.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
    /// Mode from this tick on: [`Mode::Fault`], [`Mode::Estop`], or the mode after a reset.
    pub mode: Mode,
    /// Cause of the fault. `None` unless the mode is [`Mode::Fault`].
    pub fault: Option<Fault>,
    /// What was measured, which limit it exceeded, and what to do, for people.
    pub message: String,
}

/// The fields of [`Event::Lease`]: the lease has changed hands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseEvent {
    /// Name of the client that now holds the lease. `None` if the lease is free.
    pub holder: Option<String>,
    /// Session of the client that now holds the lease, as in its [`HelloOk`](crate::HelloOk).
    /// `None` if the lease is free.
    pub session: Option<u64>,
    /// How the lease changed hands.
    pub cause: LeaseCause,
}

names! {
    /// How the lease changed hands.
    pub enum LeaseCause {
        /// The lease was free, and a client took it.
        Acquired = "acquired",
        /// The holder gave the lease back.
        Released = "released",
        /// Another client took the lease from its holder.
        Stolen = "stolen",
        /// The holder's connection ended.
        Disconnected = "disconnected",
    }
}

/// The fields of [`Event::Scene`]: another scene is being rendered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneEvent {
    /// First tick that renders the scene.
    pub tick: u64,
    /// Name of the scene.
    pub name: String,
    /// Effects of the scene.
    pub effects: Vec<EffectCost>,
}

/// The fields of [`Event::Dropped`]: states were dropped because the client reads too slowly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroppedEvent {
    /// Number of states dropped since the last such event, at least 1.
    pub count: u64,
    /// Number of states dropped on this connection so far.
    pub total: u64,
}

/// The fields of [`Event::Refused`]: stream messages of this client were refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RefusedEvent {
    /// Number of messages refused since the last such event, at least 1.
    pub count: u64,
    /// Number of messages refused on this connection so far.
    pub total: u64,
    /// Op of the last refused message. `None` if it could not be read.
    pub op: Option<String>,
    /// Why the last message was refused, for programs.
    pub code: ErrorCode,
    /// Why the last message was refused, for people.
    pub message: String,
}

/// The fields of [`Event::Stopping`]: the server is stopping.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoppingEvent {
    /// Why the server stops, for people.
    pub message: String,
}
