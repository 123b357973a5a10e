//! The id that links an answer to its request.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Largest length of an [`Id::Text`], in bytes of UTF-8.
pub const MAX_ID_BYTES: usize = 128;

/// The id that a client gives a request. The answer repeats it. The server does not compare ids: a
/// client that uses an id twice gets two answers with it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Id {
    /// A signed integer of 64 bits.
    Integer(i64),
    /// Text of at most [`MAX_ID_BYTES`] bytes.
    Text(String),
}

impl Id {
    /// Description of legal ids, for messages.
    pub(crate) const LEGAL: &str = "a whole number of 64 bits with sign, or text of at most 128 bytes";

    /// Converts an untyped value to an id. Returns the value if it is not a legal id.
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
