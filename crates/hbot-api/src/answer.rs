//! The server's answers to requests.

use crate::untyped;
use crate::{Encoding, ErrorBody, Event, Id, Mode};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value};

/// Largest nesting depth of lists and maps in an answer. It exceeds that of a request, because an
/// answer can contain the request's data.
const ANSWER_DEPTH: usize = crate::MAX_DEPTH + 8;

/// The answer to one request, sent as `{"id", "ok"}` or `{"id", "error"}`. A sender uses the type
/// of the body for `T`, such as [`PingOk`]. A receiver gets the body as an untyped value.
#[derive(Clone, Debug, PartialEq)]
pub struct Response<T = Value> {
    /// Id of the request that is answered. `None` if the request had no readable id.
    pub id: Option<Id>,
    /// The body of the answer, a map whose fields depend on the op; or the error if the request was
    /// refused.
    pub result: Result<T, ErrorBody>,
}

impl<T: Serialize> Response<T> {
    /// Creates the answer to a request that was carried out. It cannot be encoded if `body`
    /// contains a number that is not finite.
    #[must_use]
    pub const fn ok(id: Option<Id>, body: T) -> Self {
        Self { id, result: Ok(body) }
    }
}

impl Response {
    /// Creates the answer to a request that was carried out and returns no data: `"ok": {}`.
    #[must_use]
    pub fn done(id: Option<Id>) -> Self {
        Self { id, result: Ok(Value::Object(Map::new())) }
    }

    /// Creates the answer to a request that was refused.
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

/// Any message that a client receives from the server: an answer or an event.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all of them are states; a box would cost an allocation each"
)]
pub enum ServerMessage {
    /// The answer to one of the client's requests.
    Response(Response),
    /// An event, which the server sends without a request.
    Event(Event),
}

impl ServerMessage {
    /// Reads one message from the server. `bytes` is the message without the newline (JSON) or
    /// length (MessagePack) that frames it.
    ///
    /// # Errors
    ///
    /// Fails with a description for people if the bytes are not a message that a server of this
    /// version sends.
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

/// The answer to the op `hello`. It describes the server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HelloOk {
    /// Name and version of the server program, such as `hbot 0.1.0`.
    pub server: String,
    /// Version of the messages that the server uses: [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION).
    pub version: u64,
    /// Name of the rig.
    pub rig: String,
    /// Tick rate of the loop, Hz.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub rate_hz: f64,
    /// Number of this connection. No other connection to the server has it.
    pub session: u64,
}

/// The answer to the op `subscribe`, with which a client asks for state messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubscribeOk {
    /// Number of ticks from one state message to the next, at least 1.
    pub every: u64,
}

/// The answer to the op `load_scene`, with which a client loads a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoadSceneOk {
    /// Effects of the loaded scene, in the order of the scene.
    pub effects: Vec<EffectCost>,
    /// Simulated phenomena in the scene that have no effect because the rig is real.
    pub ignored: Vec<String>,
    /// What the rig cannot make of the scene or may not keep stable, what has no effect in the
    /// scene, and what the simulated rig keeps of an earlier scene: one sentence each, for people.
    /// Empty if a server does not send it.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// The answer to the op `set`, with which a client changes parameters of an effect.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetOk {
    /// What the rig cannot make of the changed scene or may not keep stable, and what has no effect
    /// in it: one sentence each, for people. Empty if a server does not send it.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// An effect of a scene, with the computing time that it needs in each tick.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EffectCost {
    /// Id of the effect in the scene.
    pub id: String,
    /// Kind of the effect, such as `spring`.
    pub kind: String,
    /// Computing time of the effect in each tick, ns.
    pub cost_ns: u64,
}

/// The answer to the ops `enable`, `disable`, `reset` and `estop`, with which a client changes the
/// mode of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModeOk {
    /// Mode of the rig from the next tick on.
    pub mode: Mode,
}

/// The answer to the ops `align` and `align_direction`, with which a client sends an orientation or
/// a direction measured from outside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignOk {
    /// Angle between the measured orientation and the server's own at the time of the measurement,
    /// 0 to pi rad.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub angle: f64,
    /// False if a measurement with a sigma does not correct the orientation: it is too far from the
    /// server's own, or its weight is 0.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub used: bool,
}

fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference")]
fn is_true(used: &bool) -> bool {
    *used
}

/// The answer to the op `ping`, with which a client tests the connection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PingOk {
    /// The data of the request, unchanged. Null if the request had none.
    pub data: Value,
    /// Number of the last tick of the control loop.
    pub tick: u64,
    /// Time of the last tick, in seconds since the control loop began.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
}
