//! The errors that the server answers when it refuses a request.

use crate::names::names;
use crate::{Id, OpName, SplitError};
use serde::{Deserialize, Serialize};

names! {
    /// Why a request was refused, as a code for programs. The message that goes with it is for
    /// people.
    pub enum ErrorCode {
        /// The message could not be read, or a field is missing, unknown or not legal. Repeating
        /// the request gives the same error.
        BadRequest = "bad_request",
        /// The hello names a version of the messages that this server does not support.
        UnsupportedVersion = "unsupported_version",
        /// The token is missing or wrong.
        Unauthorized = "unauthorized",
        /// Only the holder of the lease can use this op. Send `acquire` first.
        NotHolder = "not_holder",
        /// Another client holds the lease.
        Busy = "busy",
        /// The scene has no effect with this id.
        UnknownEffect = "unknown_effect",
        /// The value is legal in general, but not for this rig, this effect or this moment.
        OutOfRange = "out_of_range",
        /// The rig is in a fault or an emergency stop, or its cause is still present.
        Faulted = "faulted",
        /// The message is too long: more than
        /// [`MAX_SHORT_REQUEST_BYTES`](crate::MAX_SHORT_REQUEST_BYTES), or than
        /// [`MAX_REQUEST_BYTES`](crate::MAX_REQUEST_BYTES) for an op that can be long.
        TooLarge = "too_large",
    }
}

/// The field `error` of an answer: a code for programs and a message for people.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("{message} ({code})")]
pub struct ErrorBody {
    /// Reason of the refusal, for programs.
    pub code: ErrorCode,
    /// What was wrong, where, and what would be legal, for people.
    pub message: String,
    /// Name of the client that holds the lease, if any. Present with [`ErrorCode::Busy`] and
    /// [`ErrorCode::NotHolder`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<String>,
    /// Angle between the sphere and the reference, rad. Present with [`ErrorCode::OutOfRange`] from
    /// `enable`.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "crate::finite::optional")]
    pub angle: Option<f64>,
}

impl ErrorBody {
    /// Creates an error with a code and a message only.
    pub fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), holder: None, angle: None }
    }
}

/// A request that could not be read, with the error to answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct RequestRefusal {
    /// Id of the request. `None` if it could not be read.
    pub id: Option<Id>,
    /// Op of the request, if it is known. A refused stream message without id is counted by its op.
    pub op: Option<OpName>,
    /// What is wrong with the request.
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

/// A frame that the splitter refuses has no readable id.
impl From<SplitError> for RequestRefusal {
    fn from(error: SplitError) -> Self {
        Self { id: None, op: None, error: error.into() }
    }
}
