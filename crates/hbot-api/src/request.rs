//! One message from a client.

use crate::fields::{Excerpt, Fields, Shown, bad, illegal};
use crate::ops::check_version;
use crate::{
    Encoding, ErrorBody, Field, Id, MAX_DEPTH, MAX_SHORT_REQUEST_BYTES, Op, OpName, RequestRefusal,
    asks_estop, untyped,
};
use serde::Serialize;
use serde_json::Value;

/// One message from a client. After reading, every number is finite and in range, and every
/// quaternion has unit norm. The server checks later whether the request is legal for the rig, the
/// scene and the moment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Request {
    /// Id of the request, which the answer repeats. A stream message without an id is not answered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<Id>,
    /// The operation (op) that the client requests, with its fields.
    #[serde(flatten)]
    pub op: Op,
}

impl Request {
    /// Reads a request. `bytes` is the message without the newline (JSON) or length (MessagePack)
    /// that frames it.
    ///
    /// # Errors
    ///
    /// Fails with a [`RequestRefusal`] if the bytes are not a legal request. It contains the id if
    /// the id can be read, so that the client learns which request was refused.
    pub fn read(encoding: Encoding, bytes: &[u8]) -> Result<Self, RequestRefusal> {
        Self::read_within(encoding, bytes, MAX_DEPTH)
    }

    /// Reads the first message of a connection, a line of JSON without its newline. This message
    /// must be a hello, which contains no list and no map, so reading stops at the first of either.
    /// This limits the work that an unknown client can cause.
    ///
    /// # Errors
    ///
    /// Fails like [`read`](Self::read).
    pub fn read_first(line: &[u8]) -> Result<Self, RequestRefusal> {
        Self::read_within(Encoding::Json, line, 1)
    }

    fn read_within(encoding: Encoding, bytes: &[u8], depth: usize) -> Result<Self, RequestRefusal> {
        // Checked before parsing, because an `estop` in a damaged message is obeyed too.
        if asks_estop(bytes) {
            return Ok(Self { id: id_of(encoding, bytes), op: Op::Estop });
        }
        let untyped = untyped::read(encoding, bytes, depth).map_err(|message| RequestRefusal {
            id: None,
            op: None,
            error: bad(message),
        })?;
        let (op, fields) = split(untyped.value)?;
        parse(op, fields, untyped.problem.map(|problem| problem.to_string()))
    }

    /// Reads a request from a value that was decoded elsewhere. Unlike [`read`](Self::read), it
    /// cannot notice mistakes that some decoders hide: they turn NaN into null, or keep only the
    /// last of two equal keys.
    ///
    /// # Errors
    ///
    /// Fails like [`read`](Self::read).
    pub fn from_value(value: Value) -> Result<Self, RequestRefusal> {
        let (op, fields) = split(value)?;
        parse(op, fields, None)
    }
}

/// Returns the id of an `estop` message. Returns `None` if the id cannot be read, or if the message
/// is so long that reading it would delay other clients.
fn id_of(encoding: Encoding, bytes: &[u8]) -> Option<Id> {
    if bytes.len() > MAX_SHORT_REQUEST_BYTES {
        return None;
    }
    let untyped = untyped::read(encoding, bytes, MAX_DEPTH).ok()?;
    Id::from_value(untyped.value.get("id")?.clone()).ok()
}

/// The content of the field `op` of a message: the text, or the value if it is not text. `None` if
/// the field is absent.
type Found = Option<Result<String, Value>>;

/// Separates the field `op` of a message from its other fields.
fn split(value: Value) -> Result<(Found, Fields), RequestRefusal> {
    let Value::Object(map) = value else {
        let error = bad(format!("the message is {}; legal: a map with \"op\"", Shown(&value)));
        return Err(RequestRefusal { id: None, op: None, error });
    };
    let mut fields = Fields(map);
    let op = fields.take("op").map(|op| match op {
        Value::String(name) => Ok(name),
        other => Err(other),
    });
    Ok((op, fields))
}

fn parse(found: Found, mut fields: Fields, problem: Option<String>) -> Result<Request, RequestRefusal> {
    let id = fields.take("id").map(Id::from_value).transpose();
    // An `estop` that is written with escapes is found only here, not in the bytes.
    if matches!(&found, Some(Ok(op)) if *op == OpName::Estop.as_str()) {
        return Ok(Request { id: id.unwrap_or_default(), op: Op::Estop });
    }
    let id = id.map_err(|id| RequestRefusal { id: None, op: None, error: illegal("id", &id, Id::LEGAL) })?;
    let mut known = None;
    match op(found, &mut fields, problem, &mut known) {
        Ok(op) => Ok(Request { id, op }),
        Err(error) => Err(RequestRefusal { id, op: known, error }),
    }
}

/// Converts the content of the field `op` and the other fields of a message to an [`Op`]. Sets
/// `known` to the op's name as soon as the name is recognized, so that a refusal can contain it.
fn op(
    found: Found,
    fields: &mut Fields,
    problem: Option<String>,
    known: &mut Option<OpName>,
) -> Result<Op, ErrorBody> {
    let legal = || OpName::ALL.map(OpName::as_str).join(", ");
    let name = match found {
        Some(Ok(name)) => name,
        Some(Err(other)) => return Err(illegal("op", &other, legal())),
        None => {
            return Err(bad(
                problem.unwrap_or_else(|| format!("field \"op\" is missing; legal: {}", legal()))
            ));
        }
    };
    let Ok(name) = name.parse::<OpName>() else {
        return Err(bad(format!("unknown op {:?}; legal: {}", Excerpt(&name), legal())));
    };
    *known = Some(name);
    if let Some(problem) = problem {
        return Err(bad(problem));
    }
    if name == OpName::Hello {
        check_version(fields)?;
    }
    if !name.row().parameters {
        check_names(name, fields)?;
    }
    Op::read(name, fields)
}

fn check_names(op: OpName, fields: &Fields) -> Result<(), ErrorBody> {
    let legal = op.row().fields.iter().map(|Field { name, .. }| *name);
    let Some((unknown, _)) = fields.0.iter().find(|(name, _)| !legal.clone().any(|legal| legal == *name))
    else {
        return Ok(());
    };
    let legal = ["id", "op"].into_iter().chain(legal).collect::<Vec<_>>().join(", ");
    Err(bad(format!("unknown field {:?} of op {op}; legal: {legal}", Excerpt(unknown))))
}
