//! What the server answers.

use crate::untyped;
use crate::{Encoding, ErrorBody, Event, Id, Mode};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value};

/// How deep an answer may be nested; more than a request, whose data it may repeat inside.
const ANSWER_DEPTH: usize = crate::MAX_DEPTH + 8;

/// The answer to one request: `{"id", "ok"}` or `{"id", "error"}`. `T` is what its writer has, as [`PingOk`]; its reader has the untyped
/// value.
#[derive(Clone, Debug, PartialEq)]
pub struct Response<T = Value> {
    /// The request's id; `None` where the request had none that could be read.
    pub id: Option<Id>,
    /// What was asked for, a map whose fields depend on the op; or why not.
    pub result: Result<T, ErrorBody>,
}

impl<T: Serialize> Response<T> {
    /// The answer to a request carried out. It cannot be encoded where `body` holds a number that is not finite.
    #[must_use]
    pub const fn ok(id: Option<Id>, body: T) -> Self {
        Self { id, result: Ok(body) }
    }
}

impl Response {
    /// The answer to a request carried out that has nothing to tell: `"ok": {}`.
    #[must_use]
    pub fn done(id: Option<Id>) -> Self {
        Self { id, result: Ok(Value::Object(Map::new())) }
    }

    /// The answer to a request refused.
    #[must_use]
    pub const fn error(id: Option<Id>, error: ErrorBody) -> Self {
        Self { id, result: Err(error) }
    }
}

impl From<crate::RequestRefusal> for Response {
    fn from(refusal: crate::RequestRefusal) -> Self {
        Self::error(refusal.id, refusal.error)
    }
}

impl<T: Serialize> Serialize for Response<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("id", &self.id)?;
        match &self.result {
            Ok(body) => map.serialize_entry("ok", body)?,
            Err(error) => map.serialize_entry("error", error)?,
        }
        map.end()
    }
}

/// Whatever a client receives.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerMessage {
    /// An answer to one of its requests.
    Response(Response),
    /// Something that it did not ask for just now.
    Event(Event),
}

impl ServerMessage {
    /// Reads a message without its newline or length.
    ///
    /// # Errors
    ///
    /// Where it is none that a server of this version sends; for people.
    pub fn read(encoding: Encoding, bytes: &[u8]) -> Result<Self, String> {
        let untyped = untyped::read(encoding, bytes, ANSWER_DEPTH)?;
        if let Some(problem) = untyped.problem {
            return Err(problem.to_string());
        }
        let Value::Object(mut fields) = untyped.value else { return Err("not a map".into()) };
        if fields.contains_key("event") {
            return serde_json::from_value(Value::Object(fields)).map(Self::Event).map_err(|e| e.to_string());
        }
        let id = match fields.remove("id") {
            None | Some(Value::Null) => None,
            Some(id) => Some(Id::from_value(id).map_err(|id| format!("id is {id}; legal: {}", Id::LEGAL))?),
        };
        let result = match (fields.remove("ok"), fields.remove("error")) {
            (Some(body), None) => Ok(body),
            (None, Some(error)) => Err(serde_json::from_value(error).map_err(|error| error.to_string())?),
            _ => return Err("neither an event nor an answer with either \"ok\" or \"error\"".into()),
        };
        Ok(Self::Response(Response { id, result }))
    }
}

/// The answer to `hello`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HelloOk {
    /// The program and its version: `hbot 0.1.0`.
    pub server: String,
    /// The version of the messages: [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION).
    pub version: u64,
    /// The rig's name.
    pub rig: String,
    /// Ticks a second, Hz.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub rate_hz: f64,
    /// A number of this connection, different from that of every other of this server.
    pub session: u64,
}

/// The answer to `subscribe`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubscribeOk {
    /// Ticks a sample, >= 1.
    pub every: u64,
}

/// The answer to `load_scene`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoadSceneOk {
    /// The effects of the scene, in its order.
    pub effects: Vec<EffectCost>,
    /// The phenomena of `simulate` that a real rig has by itself and does not take from a scene.
    pub ignored: Vec<String>,
}

/// An effect and what it costs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EffectCost {
    /// Its id in the scene.
    pub id: String,
    /// Its kind, as `spring`.
    pub kind: String,
    /// Time that it takes of each tick, ns.
    pub cost_ns: u64,
}

/// The answer to `enable`, `disable`, `reset` and `estop`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModeOk {
    /// The mode from the next tick on.
    pub mode: Mode,
}

/// The answer to `align`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignOk {
    /// The angle between the orientation seen from outside and the server's own at that time, rad, from 0 to pi.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub angle: f64,
}

/// The answer to `ping`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PingOk {
    /// What the ping brought; null where it brought nothing.
    pub data: Value,
    /// The loop's last tick.
    pub tick: u64,
    /// Time of that tick, s.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
}
