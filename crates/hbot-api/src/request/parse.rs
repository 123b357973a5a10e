//! From an untyped value to a request.

use super::fields::{Excerpt, Fields, Found, bad, illegal};
use super::{Hello, MAX_EVERY, MAX_NAME_BYTES, Op, ROWS, Request};
use crate::{
    Align, DEFAULT_VALID_MS, Encoding, ErrorBody, ErrorCode, Id, MAX_DEPTH, MAX_VALID_MS, PROTOCOL_VERSION,
    ReferenceCommand, Refusal, TorqueCommand, untyped,
};
use serde_json::{Map, Value};

/// The longest effect's id and the longest token that are read, bytes.
const MAX_EFFECT_BYTES: usize = 128;
const MAX_TOKEN_BYTES: usize = 1024;

impl Request {
    /// Reads a message without its newline or length.
    ///
    /// # Errors
    ///
    /// A [`Refusal`] where it is no legal request. It carries the id wherever that could be read, so the client learns
    /// which of its requests is meant.
    pub fn read(encoding: Encoding, bytes: &[u8]) -> Result<Self, Refusal> {
        let untyped = untyped::read(encoding, bytes, MAX_DEPTH).map_err(|message| Refusal {
            id: None,
            op: None,
            error: bad(message),
        })?;
        parse(untyped.value, untyped.problem.map(|problem| problem.to_string()))
    }

    /// Reads a value that has been decoded elsewhere. Decoders that take NaN for null, or the last of two equal keys,
    /// hide those from it; [`read`](Self::read) does not.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn from_value(value: Value) -> Result<Self, Refusal> {
        parse(value, None)
    }
}

fn parse(value: Value, problem: Option<String>) -> Result<Request, Refusal> {
    let Value::Object(map) = value else {
        let error = bad(format!("the message is {}; legal: a map with \"op\"", Found(&value)));
        return Err(Refusal { id: None, op: None, error });
    };
    let mut fields = Fields(map);
    let id = fields.take("id").map(Id::from_value).transpose().map_err(|id| Refusal {
        id: None,
        op: None,
        error: illegal("id", &id, Id::LEGAL),
    })?;
    let mut known = None;
    match op(&mut fields, problem, &mut known) {
        Ok(op) => Ok(Request { id, op }),
        Err(error) => Err(Refusal { id, op: known, error }),
    }
}

/// Reads the op and its fields. `known` becomes its name as soon as that is seen to be one.
fn op(
    fields: &mut Fields,
    problem: Option<String>,
    known: &mut Option<&'static str>,
) -> Result<Op, ErrorBody> {
    let legal = || Op::names().collect::<Vec<_>>().join(", ");
    let name = match fields.take("op") {
        Some(Value::String(name)) => name,
        Some(other) => return Err(illegal("op", &other, legal())),
        None => {
            return Err(bad(
                problem.unwrap_or_else(|| format!("field \"op\" is missing; legal: {}", legal()))
            ));
        }
    };
    let Some((name, _, names)) = ROWS.iter().find(|row| row.0 == name) else {
        return Err(bad(format!("unknown op {:?}; legal: {}", Excerpt(&name), legal())));
    };
    *known = Some(name);
    // Whoever wants the rig to stop gets it stopped, whatever else the message holds.
    if *name == "estop" {
        return Ok(Op::Estop);
    }
    if let Some(problem) = problem {
        return Err(bad(problem));
    }
    // A later version may have other fields, so it is named before they are.
    if *name == "hello" {
        check_version(fields)?;
    }
    if *name != "set" {
        check_names(name, names, &fields.0)?;
    }
    fields.op(name)
}

fn check_version(fields: &Fields) -> Result<(), ErrorBody> {
    match fields.0.get("version").and_then(Value::as_u64) {
        Some(version) if version != PROTOCOL_VERSION => Err(ErrorBody::new(
            ErrorCode::UnsupportedVersion,
            format!("field \"version\" is {version}; this server speaks {PROTOCOL_VERSION}"),
        )),
        _ => Ok(()),
    }
}

fn check_names(op: &str, legal: &[&str], map: &Map<String, Value>) -> Result<(), ErrorBody> {
    let Some(unknown) = map.keys().find(|name| !legal.contains(&name.as_str())) else { return Ok(()) };
    let legal = ["id", "op"].iter().chain(legal).copied().collect::<Vec<_>>().join(", ");
    Err(bad(format!("unknown field {:?} of op {op}; legal: {legal}", Excerpt(unknown))))
}

impl Fields {
    fn op(&mut self, name: &str) -> Result<Op, ErrorBody> {
        Ok(match name {
            "hello" => Op::Hello(self.hello()?),
            "info" => Op::Info,
            "subscribe" => Op::Subscribe { every: self.integer("every", 1, MAX_EVERY)? },
            "unsubscribe" => Op::Unsubscribe,
            "stats" => Op::Stats,
            "acquire" => Op::Acquire { steal: self.flag("steal")? },
            "release" => Op::Release,
            "load_scene" => Op::LoadScene { scene: self.scene()? },
            "set" => self.set()?,
            "torque" => Op::Torque(TorqueCommand {
                torque: self.vector("torque")?,
                valid_ms: self.integer("valid_ms", 1, MAX_VALID_MS)?,
                tick: self.optional_integer("tick", 0, u64::MAX)?,
                seq: self.optional_integer("seq", 0, u64::MAX)?,
            }),
            "reference" => Op::Reference(ReferenceCommand {
                effect: self.text("effect", MAX_EFFECT_BYTES)?,
                q: self.quaternion("q")?,
                omega: self.optional_vector("omega")?,
                valid_ms: self.optional_integer("valid_ms", 1, MAX_VALID_MS)?.unwrap_or(DEFAULT_VALID_MS),
                tick: self.optional_integer("tick", 0, u64::MAX)?,
                seq: self.optional_integer("seq", 0, u64::MAX)?,
            }),
            "align" => Op::Align(Align {
                q: self.quaternion("q")?,
                weight: self.number("weight", 0.0, 1.0)?,
                t: self.optional_number("t", 0.0, f64::MAX)?,
            }),
            "enable" => Op::Enable,
            "disable" => Op::Disable,
            "reset" => Op::Reset,
            "ping" => Op::Ping { data: self.take("data").unwrap_or(Value::Null) },
            _ => unreachable!("every other row of ROWS has its arm; a test parses them all"),
        })
    }

    fn hello(&mut self) -> Result<Hello, ErrorBody> {
        Ok(Hello {
            version: self.integer("version", PROTOCOL_VERSION, PROTOCOL_VERSION)?,
            name: self.text("name", MAX_NAME_BYTES)?,
            token: match self.take("token") {
                None => None,
                Some(Value::String(token)) if token.len() <= MAX_TOKEN_BYTES => Some(token.into()),
                // What was found is a secret, if a mistaken one.
                Some(_) => {
                    return Err(bad("field \"token\" is not legal; legal: text of at most 1024 bytes"));
                }
            },
            encoding: match self.take("encoding") {
                None => Encoding::Json,
                Some(value) => value
                    .as_str()
                    .and_then(|text| text.parse().ok())
                    .ok_or_else(|| illegal("encoding", &value, "\"json\" or \"msgpack\""))?,
            },
        })
    }

    fn scene(&mut self) -> Result<Value, ErrorBody> {
        let legal = "a map of the shape of a scene file";
        match self.0.shift_remove("scene") {
            Some(scene @ Value::Object(_)) => Ok(scene),
            Some(other) => Err(illegal("scene", &other, legal)),
            None => Err(bad(format!("field \"scene\" is missing; legal: {legal}"))),
        }
    }

    fn set(&mut self) -> Result<Op, ErrorBody> {
        let effect = self.text("effect", MAX_EFFECT_BYTES)?;
        let parameters = std::mem::take(&mut self.0);
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
