//! The id that links an answer to its request.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Largest length of an id that is text, in bytes of UTF-8.
pub const MAX_ID_BYTES: usize = 128;

/// The id that a client gives to a request. The answer contains the same id. The server does not
/// check that ids differ: if a client uses an id twice, it gets two answers with this id.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Id {
    /// A signed 64-bit integer.
    Integer(i64),
    /// Text of at most [`MAX_ID_BYTES`] bytes.
    Text(String),
}

impl Id {
    /// Description of legal ids, for error messages.
    pub(crate) const LEGAL: &str = "a whole number of 64 bits with sign, or text of at most 128 bytes";

    /// Converts an untyped value to an id. If the value is not a legal id, returns the value as the
    /// error.
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
