//! Reads the public messages of a recording back.

use hbot_api::{Encoding, Event, ServerMessage};
use prost::Message as _;

use crate::messages::foxglove::Log;
use crate::messages::hbot::{Scene, State};
use crate::topic::Topic;

/// A public message of a recording.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    /// The state of a tick.
    State(Box<State>),
    /// An event of the TCP API.
    Event(Box<Event>),
    /// A scene that is rendered from its tick on.
    Scene(Box<Scene>),
}

/// Reads a message of the topic `topic`. Returns `None` for any other topic, and for a message that
/// cannot be read.
#[must_use]
pub fn told(topic: &str, data: &[u8]) -> Option<Told> {
    if topic == Topic::State.name() {
        return State::decode(data).ok().map(|state| Told::State(Box::new(state)));
    }
    if topic == Topic::Scene.name() {
        return Scene::decode(data).ok().map(|scene| Told::Scene(Box::new(scene)));
    }
    if topic == Topic::Event.name() {
        let log = Log::decode(data).ok()?;
        return match ServerMessage::read(Encoding::Json, log.message.as_bytes()) {
            Ok(ServerMessage::Event(event)) => Some(Told::Event(Box::new(event))),
            _ => None,
        };
    }
    None
}
