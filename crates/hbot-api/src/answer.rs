//! The server's answers to requests.

use crate::untyped;
use crate::{Encoding, ErrorBody, Event, Id};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

/// Largest nesting depth of lists and maps in an answer. It exceeds that of a request, because an
/// answer can contain the request's data.
const ANSWER_DEPTH: usize = crate::MAX_DEPTH + 8;

/// The answer to one request, sent as `{"id", "ok"}` or `{"id", "error"}`. A sender uses the type
/// of the body for `T`, such as [`PingOk`](crate::PingOk). A receiver gets the body as an untyped
/// value.
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
