//! What ties an answer to its request.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The longest [`Id::Text`], in bytes of UTF-8.
pub const MAX_ID_BYTES: usize = 128;

/// The name that a client gives a request, repeated in its answer. The server does not compare ids; a client that uses
/// one twice gets two answers with it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Id {
    /// A whole number of 64 bits with sign.
    Integer(i64),
    /// Text of at most [`MAX_ID_BYTES`].
    Text(String),
}

impl Id {
    /// What is legal, for messages.
    pub(crate) const LEGAL: &str = "a whole number of 64 bits with sign, or text of at most 128 bytes";

    /// The id that an untyped value is, if it is one.
    pub(crate) fn from_value(value: Value) -> Result<Self, Value> {
        match value {
            Value::Number(number) => number.as_i64().map(Self::Integer).ok_or(Value::Number(number)),
            Value::String(text) if text.len() <= MAX_ID_BYTES => Ok(Self::Text(text)),
            other => Err(other),
        }
    }
}

impl From<i64> for Id {
    fn from(id: i64) -> Self {
        Self::Integer(id)
    }
}

impl From<&str> for Id {
    fn from(id: &str) -> Self {
        Self::Text(id.into())
    }
}
