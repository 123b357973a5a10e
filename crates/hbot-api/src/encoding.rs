//! Encodes messages as bytes.

use crate::names::names;
use serde::Serialize;
use std::fmt;

names! {
    /// The encoding of messages on a connection. Messages have the same fields in both encodings.
    #[derive(Default)]
    pub enum Encoding {
        /// One JSON object per line, in UTF-8. A newline ends the message.
        #[default]
        Json = "json",
        /// A MessagePack map with named fields. A length of four bytes precedes it, most
        /// significant byte first.
        Msgpack = "msgpack",
    }
}

/// Number of bytes of the length that precedes a MessagePack map.
pub(crate) const LENGTH_BYTES: usize = 4;

impl Encoding {
    /// Appends a message to `out`, including the newline or length that frames it. Does not
    /// allocate memory if `out` has the capacity and the message is an
    /// [`Event::State`](crate::Event::State).
    ///
    /// # Errors
    ///
    /// Fails with [`MessageEncodeError`] if a number in the message is not finite. `out` is then
    /// unchanged.
    pub fn encode<T: Serialize + ?Sized>(
        self,
        message: &T,
        out: &mut Vec<u8>,
    ) -> Result<(), MessageEncodeError> {
        let start = out.len();
        let result = match self {
            Self::Json => json(message, out),
            Self::Msgpack => msgpack(message, out),
        };
        if result.is_err() {
            out.truncate(start);
        }
        result
    }
}

fn json<T: Serialize + ?Sized>(message: &T, out: &mut Vec<u8>) -> Result<(), MessageEncodeError> {
    serde_json::to_writer(&mut *out, message).map_err(MessageEncodeError::new)?;
    out.push(b'\n');
    Ok(())
}

fn msgpack<T: Serialize + ?Sized>(message: &T, out: &mut Vec<u8>) -> Result<(), MessageEncodeError> {
    let start = out.len();
    out.extend_from_slice(&[0; LENGTH_BYTES]);
    let mut serializer = rmp_serde::Serializer::new(&mut *out).with_struct_map();
    message.serialize(&mut serializer).map_err(MessageEncodeError::new)?;
    let length = u32::try_from(out.len() - start - LENGTH_BYTES).map_err(MessageEncodeError::new)?;
    out[start..start + LENGTH_BYTES].copy_from_slice(&length.to_be_bytes());
    Ok(())
}

/// The error returned when a message cannot be encoded, for example because a number is not finite.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("message not sent: {reason}")]
pub struct MessageEncodeError {
    reason: String,
}

impl MessageEncodeError {
    fn new(error: impl fmt::Display) -> Self {
        Self { reason: error.to_string() }
    }
}
