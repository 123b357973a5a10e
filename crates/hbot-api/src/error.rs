//! What the server answers where it does not do what it was asked.

use crate::names::names;
use crate::{Id, OpName, SplitError};
use serde::{Deserialize, Serialize};

names! {
    /// Why a request was not carried out, for programs. The message that goes with it is for people.
    pub enum ErrorCode {
        /// The message could not be read, or a field is missing, unknown or not legal. Asking again gives the same.
        BadRequest = "bad_request",
        /// The hello names a version of the messages that this server does not speak.
        UnsupportedVersion = "unsupported_version",
        /// The token is missing or wrong.
        Unauthorized = "unauthorized",
        /// Only the holder of the lease may ask this: `acquire` first.
        NotHolder = "not_holder",
        /// Another client holds the lease.
        Busy = "busy",
        /// The scene has no effect of this id.
        UnknownEffect = "unknown_effect",
        /// A value is legal as such, but not for this rig, this effect or this moment.
        OutOfRange = "out_of_range",
        /// The rig is in a fault or an emergency stop, or the cause of one is still there.
        Faulted = "faulted",
        /// The message is longer than [`MAX_REQUEST_BYTES`](crate::MAX_REQUEST_BYTES).
        TooLarge = "too_large",
    }
}

/// The `error` of an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("{message} ({code})")]
pub struct ErrorBody {
    /// For programs.
    pub code: ErrorCode,
    /// For people: what was wrong, where, and what would be right.
    pub message: String,
    /// Who holds the lease, with [`ErrorCode::Busy`] and [`ErrorCode::NotHolder`] where anybody does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<String>,
    /// How far away the reference is, rad, with [`ErrorCode::OutOfRange`] from `enable`.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "crate::finite::optional")]
    pub angle: Option<f64>,
}

impl ErrorBody {
    /// An error without further fields.
    pub fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), holder: None, angle: None }
    }
}

/// A request that could not be read: what to answer, and to whom.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct RequestRefusal {
    /// The request's id; `None` where even that could not be read.
    pub id: Option<Id>,
    /// The request's op where it is one that exists, so that a refused stream message without an id can be counted.
    pub op: Option<OpName>,
    /// What is wrong with it.
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

/// A frame refused has no id that could be read.
impl From<SplitError> for RequestRefusal {
    fn from(error: SplitError) -> Self {
        Self { id: None, op: None, error: error.into() }
    }
}
