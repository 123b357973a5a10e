//! Converts an untyped value to a request.

use super::fields::{Excerpt, Fields, Shown, bad, illegal};
use super::{Field, Hello, MAX_EVERY, MAX_NAME_BYTES, Op, OpName, Request};
use crate::{
    Align, AlignDirection, DEFAULT_OVER_MS, DEFAULT_VALID_MS, Encoding, ErrorBody, ErrorCode, HandCommand,
    HandHold, Id, MAX_BLEND_MS, MAX_DEPTH, MAX_OVER_MS, MAX_SHORT_REQUEST_BYTES, MAX_VALID_MS, MIN_SIGMA,
    ModelCommand, PROTOCOL_VERSION, ReferenceCommand, RequestRefusal, TorqueCommand, asks_estop, untyped,
};
use serde_json::{Map, Value};
use std::borrow::Cow;

/// Largest length of an effect's id in a request, in bytes.
const MAX_EFFECT_BYTES: usize = 128;
const MAX_TOKEN_BYTES: usize = 1024;

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
        if let Some((few, problem)) = untyped::read_few(encoding, bytes, depth) {
            let problem = problem.map(|problem| problem.to_string());
            return parse(few.op.map(Ok), Fields(few.others), problem);
        }
        // Reads the general form: the message has many fields, or something is wrong with it.
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
    let (few, _) = untyped::read_few(encoding, bytes, MAX_DEPTH)?;
    Fields(few.others).take("id").and_then(|id| Id::from_value(id).ok())
}

/// The content of the field `op` of a message: the text, or the value if it is not text. `None` if
/// the field is absent.
type Found<'a> = Option<Result<Cow<'a, str>, Value>>;

/// Separates the field `op` of a message from its other fields.
fn split(value: Value) -> Result<(Found<'static>, Fields<'static>), RequestRefusal> {
    let Value::Object(map) = value else {
        let error = bad(format!("the message is {}; legal: a map with \"op\"", Shown(&value)));
        return Err(RequestRefusal { id: None, op: None, error });
    };
    let mut fields = Fields(map.into_iter().map(|(name, value)| (Cow::Owned(name), value)).collect());
    let op = fields.take("op").map(|op| match op {
        Value::String(name) => Ok(Cow::Owned(name)),
        other => Err(other),
    });
    Ok((op, fields))
}

fn parse(
    found: Found<'_>,
    mut fields: Fields<'_>,
    problem: Option<String>,
) -> Result<Request, RequestRefusal> {
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
    found: Found<'_>,
    fields: &mut Fields<'_>,
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
    // Checked before the fields, because another version can have other fields.
    if name == OpName::Hello {
        check_version(fields)?;
    }
    if !name.row().parameters {
        check_names(name, fields)?;
    }
    Op::read(name, fields)
}

fn check_version(fields: &Fields<'_>) -> Result<(), ErrorBody> {
    match fields.get("version").and_then(Value::as_u64) {
        Some(version) if version != PROTOCOL_VERSION => Err(ErrorBody::new(
            ErrorCode::UnsupportedVersion,
            format!("field \"version\" is {version}; this server speaks {PROTOCOL_VERSION}"),
        )),
        _ => Ok(()),
    }
}

fn check_names(op: OpName, fields: &Fields<'_>) -> Result<(), ErrorBody> {
    let legal = op.row().fields.iter().map(|Field { name, .. }| *name);
    let Some((unknown, _)) = fields.0.iter().find(|(name, _)| !legal.clone().any(|legal| legal == name))
    else {
        return Ok(());
    };
    let legal = ["id", "op"].into_iter().chain(legal).collect::<Vec<_>>().join(", ");
    Err(bad(format!("unknown field {:?} of op {op}; legal: {legal}", Excerpt(unknown))))
}

impl Fields<'_> {
    pub(super) fn subscribe(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Subscribe { every: self.integer("every", 1, MAX_EVERY)? })
    }

    pub(super) fn advance(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Advance { ticks: self.integer("ticks", 1, MAX_EVERY)? })
    }

    pub(super) fn acquire(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Acquire { steal: self.flag("steal")? })
    }

    pub(super) fn torque(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Torque(TorqueCommand {
            torque: self.vector("torque")?,
            valid_ms: self.integer("valid_ms", 1, MAX_VALID_MS)?,
            tick: self.optional_integer("tick", 0, u64::MAX)?,
            seq: self.optional_integer("seq", 0, u64::MAX)?,
        }))
    }

    pub(super) fn reference(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Reference(ReferenceCommand {
            effect: self.text("effect", MAX_EFFECT_BYTES)?,
            q: self.quaternion("q")?,
            omega: self.optional_vector("omega")?,
            valid_ms: self.optional_integer("valid_ms", 1, MAX_VALID_MS)?.unwrap_or(DEFAULT_VALID_MS),
            tick: self.optional_integer("tick", 0, u64::MAX)?,
            seq: self.optional_integer("seq", 0, u64::MAX)?,
        }))
    }

    pub(super) fn model(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Model(Box::new(ModelCommand {
            torque: self.optional_vector("torque")?.unwrap_or([0.0; 3]),
            stiffness: self.impedance("stiffness")?,
            damping: self.impedance("damping")?,
            pose: self.optional_quaternion("pose")?,
            planes: self.planes("planes")?,
            valid_ms: self.integer("valid_ms", 1, MAX_VALID_MS)?,
            blend_ms: self.optional_integer("blend_ms", 0, MAX_BLEND_MS)?,
            soften: self.flag("soften")?,
            tick: self.optional_integer("tick", 0, u64::MAX)?,
            seq: self.optional_integer("seq", 0, u64::MAX)?,
        })))
    }

    pub(super) fn align(&mut self) -> Result<Op, ErrorBody> {
        let q = self.quaternion("q")?;
        let sigma = self.optional_sigmas("sigma")?;
        let weight = match sigma {
            None => self.number("weight", 0.0, 1.0)?,
            Some(_) => self.optional_number("weight", 0.0, 1.0)?.unwrap_or(1.0),
        };
        Ok(Op::Align(Align { q, weight, sigma, t: self.optional_number("t", 0.0, f64::MAX)? }))
    }

    pub(super) fn align_direction(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::AlignDirection(AlignDirection {
            body: self.direction("body")?,
            world: self.direction("world")?,
            sigma: self.number("sigma", MIN_SIGMA, std::f64::consts::PI)?,
            t: self.optional_number("t", 0.0, f64::MAX)?,
        }))
    }

    pub(super) fn hand(&mut self) -> Result<Op, ErrorBody> {
        if self.flag("release")? {
            return match self.0.iter().find(|(_, value)| !value.is_null()) {
                None => Ok(Op::Hand(HandCommand::RELEASE)),
                Some((field, _)) => Err(bad(format!(
                    "field {field:?} goes with \"q\"; legal with \"release\": no other field"
                ))),
            };
        }
        Ok(Op::Hand(HandCommand::Hold(HandHold {
            q: self.quaternion("q")?,
            over_ms: self.optional_integer("over_ms", 0, MAX_OVER_MS)?.unwrap_or(DEFAULT_OVER_MS),
            stiffness: self.optional_number("stiffness", 0.0, 100.0)?,
            damping: self.optional_number("damping", 0.0, 10.0)?,
            inertia: self.optional_number("inertia", 0.0, 1.0)?,
        })))
    }

    pub(super) fn ping(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Ping { data: self.take("data").unwrap_or(Value::Null) })
    }

    pub(super) fn hello(&mut self) -> Result<Op, ErrorBody> {
        Ok(Op::Hello(Hello {
            version: self.integer("version", PROTOCOL_VERSION, PROTOCOL_VERSION)?,
            name: self.text("name", MAX_NAME_BYTES)?,
            token: match self.take("token") {
                None => None,
                Some(Value::String(token)) if token.len() <= MAX_TOKEN_BYTES => Some(token.into()),
                // The message does not show the value, because it is a secret even if it is wrong.
                Some(_) => {
                    return Err(bad("field \"token\" is not legal; legal: text of at most 1024 bytes"));
                }
            },
            encoding: match self.take("encoding") {
                None => Encoding::Json,
                Some(value) => value.as_str().and_then(|text| text.parse().ok()).ok_or_else(|| {
                    let legal = Encoding::ALL.map(|encoding| format!("\"{encoding}\"")).join(" or ");
                    illegal("encoding", &value, legal)
                })?,
            },
        }))
    }

    pub(super) fn load_scene(&mut self) -> Result<Op, ErrorBody> {
        let legal = "a map of the shape of a scene file, or the name of a ready-made scene";
        match self.remove("scene") {
            Some(scene @ (Value::Object(_) | Value::String(_))) => Ok(Op::LoadScene { scene }),
            Some(other) => Err(illegal("scene", &other, legal)),
            None => Err(bad(format!("field \"scene\" is missing; legal: {legal}"))),
        }
    }

    pub(super) fn set(&mut self) -> Result<Op, ErrorBody> {
        let effect = self.text("effect", MAX_EFFECT_BYTES)?;
        let parameters: Map<String, Value> =
            std::mem::take(&mut self.0).into_iter().map(|(name, value)| (name.into_owned(), value)).collect();
        if parameters.contains_key("kind") {
            return Err(bad(
                "field \"kind\" cannot be set; legal: parameters of the effect's kind (load_scene \
                            gives an effect another kind)",
            ));
        }
        if parameters.is_empty() {
            return Err(bad(
                "op set names no parameter; legal: effect and at least one parameter of its kind",
            ));
        }
        Ok(Op::Set { effect, parameters })
    }
}
