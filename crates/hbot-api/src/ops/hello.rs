//! The op `hello`, with which a client introduces itself.

use super::{Op, OpRow, Who, may, must};
use crate::fields::{Fields, bad, illegal};
use crate::{Encoding, ErrorBody, ErrorCode, PROTOCOL_VERSION};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;

/// Largest length of a client's name, in bytes of UTF-8.
pub const MAX_NAME_BYTES: usize = 64;

const MAX_TOKEN_BYTES: usize = 1024;

pub(super) const ROW: OpRow =
    OpRow::new(Who::First, &[must("version"), must("name"), may("token"), may("encoding")]);

/// The first message of a client, which introduces it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hello {
    /// Version of the messages that the client uses: [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION).
    pub version: u64,
    /// Name of the client, shown to people: 1 to [`MAX_NAME_BYTES`] bytes without control or
    /// invisible characters (see [`is_plain`](crate::is_plain)).
    pub name: String,
    /// Token of the server. A server that other machines can reach requires it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<Token>,
    /// Encoding of all messages after the answer to this one. The answer itself is still JSON.
    pub encoding: Encoding,
}

/// A secret text. Debug output does not show it.
#[derive(Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Token(String);

impl Token {
    /// Returns the secret text. To check it, use a comparison that takes constant time.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl From<String> for Token {
    fn from(secret: String) -> Self {
        Self(secret)
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
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

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Hello(Hello {
        version: fields.integer("version", PROTOCOL_VERSION, PROTOCOL_VERSION)?,
        name: fields.text("name", MAX_NAME_BYTES)?,
        token: match fields.take("token") {
            None => None,
            Some(Value::String(token)) if token.len() <= MAX_TOKEN_BYTES => Some(token.into()),
            // The message does not show the value, because it is a secret even if it is wrong.
            Some(_) => {
                return Err(bad("field \"token\" is not legal; legal: text of at most 1024 bytes"));
            }
        },
        encoding: match fields.take("encoding") {
            None => Encoding::Json,
            Some(value) => value.as_str().and_then(|text| text.parse().ok()).ok_or_else(|| {
                let legal = Encoding::ALL.map(|encoding| format!("\"{encoding}\"")).join(" or ");
                illegal("encoding", &value, legal)
            })?,
        },
    }))
}

/// Checked before the other fields, because another version can have others.
pub(crate) fn check_version(fields: &Fields) -> Result<(), ErrorBody> {
    match fields.get("version").and_then(Value::as_u64) {
        Some(version) if version != PROTOCOL_VERSION => Err(ErrorBody::new(
            ErrorCode::UnsupportedVersion,
            format!("field \"version\" is {version}; this server speaks {PROTOCOL_VERSION}"),
        )),
        _ => Ok(()),
    }
}
