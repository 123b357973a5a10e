//! The errors that the server answers when it refuses a request.

use crate::names::names;
use crate::{Id, OpName, SplitError};
use serde::{Deserialize, Serialize};

names! {
    /// Why a request was refused, as a code that programs can check. An error also has a message
    /// for people.
    pub enum ErrorCode {
        /// The message could not be read, or one of its fields is missing, unknown or not legal.
        /// Repeating the request gives the same error.
        BadRequest = "bad_request",
        /// The client uses a version of the messages that this server does not support.
        UnsupportedVersion = "unsupported_version",
        /// The client sent no token or a wrong one.
        Unauthorized = "unauthorized",
        /// Only the client that holds the lease can use this op. Send `acquire` first.
        NotHolder = "not_holder",
        /// Another client holds the lease, which is the right to command.
        Busy = "busy",
        /// The running scene has no effect with this id.
        UnknownEffect = "unknown_effect",
        /// The value is legal in general, but not for this rig, this effect or this moment.
        OutOfRange = "out_of_range",
        /// The rig is in a fault or an emergency stop, or the cause of the fault is still present.
        Faulted = "faulted",
        /// The message is too long. The limit is [`MAX_REQUEST_BYTES`](crate::MAX_REQUEST_BYTES)
        /// for an op that can be long, and
        /// [`MAX_SHORT_REQUEST_BYTES`](crate::MAX_SHORT_REQUEST_BYTES) for any other.
        TooLarge = "too_large",
    }
}

/// The field `error` of an answer: why the server refused the request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("{message} ({code})")]
pub struct ErrorBody {
    /// Reason of the refusal, as a code for programs.
    pub code: ErrorCode,
    /// Description for people: what was wrong, where, and which values are legal.
    pub message: String,
    /// Name of the client that holds the lease, if any. Present with [`ErrorCode::Busy`] and
    /// [`ErrorCode::NotHolder`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<String>,
    /// Angle between the sphere and the reference, rad. Present if `enable` was refused with
    /// [`ErrorCode::OutOfRange`] because this angle is too large.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "crate::finite::optional")]
    pub angle: Option<f64>,
}

impl ErrorBody {
    /// Creates an error with a code and a message, and no other fields.
    pub fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), holder: None, angle: None }
    }

    /// Returns the message for people who do not know the ops: without the op at its beginning.
    #[must_use]
    pub fn reason(&self) -> &str {
        let rest = self.message.strip_prefix("op ").and_then(|rest| rest.split_once(": "));
        rest.map_or(&self.message, |(_, rest)| rest)
    }
}

/// A request that the server could not read, with the error for the answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct RequestRefusal {
    /// Id of the refused request. `None` if the id could not be read.
    pub id: Option<Id>,
    /// Op of the refused request, if it could be read. Refused stream messages without an id are
    /// counted by op, because they are not answered.
    pub op: Option<OpName>,
    /// The error that the server answers.
    pub error: ErrorBody,
}

impl From<SplitError> for ErrorBody {
    fn from(error: SplitError) -> Self {
        let code = match error {
            SplitError::TooLarge { .. } => ErrorCode::TooLarge,
            SplitError::LooksLikeJson | SplitError::NotUtf8 { .. } => ErrorCode::BadRequest,
        };
        Self::new(code, error.to_string())
    }
}

/// Creates the refusal of a message whose content was not read. It has no id, because the id was
/// not read either.
impl From<SplitError> for RequestRefusal {
    fn from(error: SplitError) -> Self {
        Self { id: None, op: None, error: error.into() }
    }
}
