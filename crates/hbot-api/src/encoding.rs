//! From messages to bytes.

use crate::names::names;
use serde::Serialize;
use std::fmt;

names! {
    /// How messages travel. Both carry the same fields.
    #[derive(Default)]
    pub enum Encoding {
        /// One JSON object a line, in UTF-8, ended by a newline.
        #[default]
        Json = "json",
        /// The length in four bytes, most significant first, then a MessagePack map with its fields by name.
        Msgpack = "msgpack",
    }
}

/// Bytes of the length before a MessagePack map.
pub(crate) const LENGTH_BYTES: usize = 4;

impl Encoding {
    /// Appends a whole message, ready to be sent, to `out`. Takes no memory where `out` has the capacity and the message
    /// is an [`Event::State`](crate::Event::State).
    ///
    /// # Errors
    ///
    /// [`MessageEncodeError`] where a number of the message is not finite; `out` is then as it was before.
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

/// A message that cannot be sent.
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
