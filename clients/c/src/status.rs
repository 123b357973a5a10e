//! The codes that functions return, and the text of the last error.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};

use hbot_api::{ClientError, ErrorCode};

/// What a function returns. 0: success. 1: nothing has arrived in the given time, which is no
/// failure. 10 to 18: the server has refused the request. 30 to 37: the connection failed, or the
/// answer did not come in time. 38: a number in the request is not finite, so nothing was sent.
/// 50 to 54: the call was wrong. 55: a defect of this library.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbotStatus {
    /// Success.
    Ok = 0,
    /// Nothing has arrived in the given time. The connection is intact.
    Nothing = 1,
    /// The server could not read the request, or one of its fields is not legal.
    BadRequest = 10,
    /// The server does not speak this client's version of the protocol.
    UnsupportedVersion = 11,
    /// The token is missing or wrong.
    Unauthorized = 12,
    /// Only the holder of the lease may do this: call hbot_acquire() first.
    NotHolder = 13,
    /// Another client has the lease. The text of the error names it.
    Busy = 14,
    /// The scene has no effect with this id.
    UnknownEffect = 15,
    /// The value is legal in general, but not for this rig, this effect or this moment.
    OutOfRange = 16,
    /// The rig is in a fault or an emergency stop.
    Faulted = 17,
    /// The request is too long.
    TooLarge = 18,
    /// No program listens at the address.
    NoServer = 30,
    /// The text is no address, or its host is unknown.
    Address = 31,
    /// Connecting failed for another reason.
    Connect = 32,
    /// The server did not answer in time, or no state came. A connection that was open stays open.
    Timeout = 33,
    /// The server has closed the connection, or it has died. Connect again.
    Closed = 34,
    /// Reading or writing failed. Connect again.
    Io = 35,
    /// The server sent something that is no message of this protocol. Connect again.
    Protocol = 36,
    /// The encrypted connection failed, or only one side encrypts.
    Tls = 37,
    /// A number in the request is not finite. Nothing was sent; the connection is intact.
    NotFinite = 38,
    /// A pointer is NULL that must not be.
    NullPointer = 50,
    /// A text is not UTF-8.
    NotUtf8 = 51,
    /// An argument has an illegal value. The text of the error says which one.
    BadArgument = 52,
    /// A scene file or text cannot be read. The text of the error names each mistake.
    BadScene = 53,
    /// Another call with this client is running, in another thread or around this callback.
    InUse = 54,
    /// A defect of this library. Close the client.
    Panic = 55,
}

/// A failed call: the status that it returns, and the reason as text.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: HbotStatus,
    pub(crate) text: String,
}

impl Failure {
    pub(crate) fn new(status: HbotStatus, text: impl Into<String>) -> Self {
        Self { status, text: text.into() }
    }

    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self::new(HbotStatus::BadArgument, text)
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        let status = match &error {
            ClientError::Server(body) => refusal(body.code),
            ClientError::NoServer { .. } => HbotStatus::NoServer,
            ClientError::Address { .. } | ClientError::UnknownHost { .. } => HbotStatus::Address,
            ClientError::Connect { .. } => HbotStatus::Connect,
            ClientError::Timeout { .. } | ClientError::NoState { .. } => HbotStatus::Timeout,
            ClientError::Closed | ClientError::NoHello { .. } => HbotStatus::Closed,
            ClientError::Protocol(_) => HbotStatus::Protocol,
            ClientError::Tls(_) => HbotStatus::Tls,
            ClientError::Encode(_) => HbotStatus::NotFinite,
            // The enum can grow. What is left are errors of the socket.
            _ => HbotStatus::Io,
        };
        Self::new(status, error.to_string())
    }
}

pub(crate) const fn refusal(code: ErrorCode) -> HbotStatus {
    match code {
        ErrorCode::BadRequest => HbotStatus::BadRequest,
        ErrorCode::UnsupportedVersion => HbotStatus::UnsupportedVersion,
        ErrorCode::Unauthorized => HbotStatus::Unauthorized,
        ErrorCode::NotHolder => HbotStatus::NotHolder,
        ErrorCode::Busy => HbotStatus::Busy,
        ErrorCode::UnknownEffect => HbotStatus::UnknownEffect,
        ErrorCode::OutOfRange => HbotStatus::OutOfRange,
        ErrorCode::Faulted => HbotStatus::Faulted,
        ErrorCode::TooLarge => HbotStatus::TooLarge,
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

pub(crate) fn remember(text: &str) {
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    LAST_ERROR.with_borrow_mut(|last| *last = text);
}

/// Returns the reason of the last failed call of this thread, as text for people. Returns an empty
/// text if none has failed. The text is valid until the next failing call of this thread.
#[unsafe(no_mangle)]
pub extern "C" fn hbot_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|last| last.as_ptr())
}

/// Returns the name of a status, such as "not_holder", or "unknown" for a number that is none. The
/// text is valid for ever.
#[unsafe(no_mangle)]
pub extern "C" fn hbot_status_name(status: i32) -> *const c_char {
    NAMES.iter().find(|(code, _)| *code as i32 == status).map_or(c"unknown", |(_, name)| *name).as_ptr()
}

const NAMES: [(HbotStatus, &CStr); 26] = [
    (HbotStatus::Ok, c"ok"),
    (HbotStatus::Nothing, c"nothing"),
    (HbotStatus::BadRequest, c"bad_request"),
    (HbotStatus::UnsupportedVersion, c"unsupported_version"),
    (HbotStatus::Unauthorized, c"unauthorized"),
    (HbotStatus::NotHolder, c"not_holder"),
    (HbotStatus::Busy, c"busy"),
    (HbotStatus::UnknownEffect, c"unknown_effect"),
    (HbotStatus::OutOfRange, c"out_of_range"),
    (HbotStatus::Faulted, c"faulted"),
    (HbotStatus::TooLarge, c"too_large"),
    (HbotStatus::NoServer, c"no_server"),
    (HbotStatus::Address, c"address"),
    (HbotStatus::Connect, c"connect"),
    (HbotStatus::Timeout, c"timeout"),
    (HbotStatus::Closed, c"closed"),
    (HbotStatus::Io, c"io"),
    (HbotStatus::Protocol, c"protocol"),
    (HbotStatus::Tls, c"tls"),
    (HbotStatus::NotFinite, c"not_finite"),
    (HbotStatus::NullPointer, c"null_pointer"),
    (HbotStatus::NotUtf8, c"not_utf8"),
    (HbotStatus::BadArgument, c"bad_argument"),
    (HbotStatus::BadScene, c"bad_scene"),
    (HbotStatus::InUse, c"in_use"),
    (HbotStatus::Panic, c"panic"),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The names of refusals are those of `docs/api.md`.
    #[test]
    fn refusals_are_called_as_in_messages() {
        for code in ErrorCode::ALL {
            let status = refusal(code);
            let name = NAMES.iter().find(|(named, _)| *named == status).map(|(_, name)| *name);
            assert_eq!(name.and_then(|name| name.to_str().ok()), Some(code.as_str()));
        }
    }
}
