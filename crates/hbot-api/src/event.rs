//! What the server sends unasked.

use crate::names::names;
use crate::{EffectCost, ErrorCode, Fault, Mode, StateEvent};
use serde::{Deserialize, Serialize};

/// A message with `event` in place of `id`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A sample of the loop, to who has subscribed.
    State(StateEvent),
    /// The rig went into a fault or an emergency stop, or came out of one; to all.
    Fault(FaultEvent),
    /// The lease to command changed hands; to all, the one who lost it among them.
    Lease(LeaseEvent),
    /// Another scene is rendered; to all.
    Scene(SceneEvent),
    /// Samples were lost because this client reads too slowly.
    Dropped(DroppedEvent),
    /// Stream messages of this client were refused; at most once a second.
    Refused(RefusedEvent),
    /// The server stops; the last message of a connection.
    Stopping(StoppingEvent),
    /// An event that a later server may send. Pass over it.
    #[serde(other)]
    Unknown,
}

names! {
    /// The name of an [`Event`].
    pub enum EventName {
        /// See [`Event::State`].
        State = "state",
        /// See [`Event::Fault`].
        Fault = "fault",
        /// See [`Event::Lease`].
        Lease = "lease",
        /// See [`Event::Scene`].
        Scene = "scene",
        /// See [`Event::Dropped`].
        Dropped = "dropped",
        /// See [`Event::Refused`].
        Refused = "refused",
        /// See [`Event::Stopping`].
        Stopping = "stopping",
    }
}

impl Event {
    /// Its name; `None` for one that a later server may send.
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

/// See [`Event::Fault`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultEvent {
    /// The tick in which it came about.
    pub tick: u64,
    /// Time of that tick, s.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
    /// The mode from this tick on: [`Mode::Fault`], [`Mode::Estop`], or where a reset led.
    pub mode: Mode,
    /// The cause; `None` but in [`Mode::Fault`].
    pub fault: Option<Fault>,
    /// For people: what was seen, against which limit, and what to do.
    pub message: String,
}

/// See [`Event::Lease`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseEvent {
    /// The name of who holds it now; `None` where it is free.
    pub holder: Option<String>,
    /// The session of who holds it now, as in its [`HelloOk`](crate::HelloOk); `None` where it is free.
    pub session: Option<u64>,
    /// How that came about.
    pub cause: LeaseCause,
}

names! {
    /// How the lease changed hands.
    pub enum LeaseCause {
        /// It was free and somebody took it.
        Acquired = "acquired",
        /// Its holder gave it back.
        Released = "released",
        /// Somebody took it from its holder.
        Stolen = "stolen",
        /// The connection of its holder ended.
        Disconnected = "disconnected",
    }
}

/// See [`Event::Scene`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneEvent {
    /// The first tick that renders it.
    pub tick: u64,
    /// Its name.
    pub name: String,
    /// Its effects.
    pub effects: Vec<EffectCost>,
}

/// See [`Event::Dropped`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroppedEvent {
    /// Samples lost since the last such event, >= 1.
    pub count: u64,
    /// Samples lost on this connection so far.
    pub total: u64,
}

/// See [`Event::Refused`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RefusedEvent {
    /// Messages refused since the last such event, >= 1.
    pub count: u64,
    /// Messages refused on this connection so far.
    pub total: u64,
    /// The op of the last one; `None` where it could not be read.
    pub op: Option<String>,
    /// Why the last one was refused, for programs.
    pub code: ErrorCode,
    /// The same for people.
    pub message: String,
}

/// See [`Event::Stopping`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoppingEvent {
    /// Why, for people.
    pub message: String,
}
