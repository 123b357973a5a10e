//! The errors of the client.

use crate::{ErrorBody, ErrorCode, MessageEncodeError};
use std::io::{self, ErrorKind};
use std::time::Duration;

/// The error returned when a client cannot connect, or a request fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// No program listens at the address.
    #[error(
        "no server at {address} (connection refused). Start one with `cargo run server`, or name another address"
    )]
    NoServer {
        /// The address that was tried.
        address: String,
    },
    /// The address is malformed, or its name cannot be resolved.
    #[error("{address:?} is no address of a server: {reason}. Legal: HOST or HOST:PORT, as 127.0.0.1:4268")]
    Address {
        /// The address that was given.
        address: String,
        /// The reason that the operating system gives.
        reason: String,
    },
    /// The connection could not be made for another reason.
    #[error("cannot connect to {address}: {source}")]
    Connect {
        /// The address that was tried.
        address: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The server did not answer in time.
    #[error("no answer to {what} within {} s", after.as_secs_f64())]
    Timeout {
        /// The op of the request.
        what: &'static str,
        /// How long the client waited.
        after: Duration,
    },
    /// The server refused the request. Its message says why.
    #[error("{0}")]
    Server(ErrorBody),
    /// The server ended the connection.
    #[error("the server has closed the connection")]
    Closed,
    /// The connection is broken.
    #[error("connection to the server broken: {0}")]
    Io(io::Error),
    /// The server sent something that is not one of its messages. It is another program or version.
    #[error("the server sent what is no message of its: {0}")]
    Protocol(String),
    /// The encrypted connection failed, or the server encrypts and the client does not.
    #[error("{0}")]
    Tls(String),
    /// The request cannot be encoded, for example because a number is not finite.
    #[error(transparent)]
    Encode(#[from] MessageEncodeError),
}

impl ClientError {
    /// Returns the server's error code if the server refused the request.
    #[must_use]
    pub const fn code(&self) -> Option<ErrorCode> {
        match self {
            Self::Server(error) => Some(error.code),
            _ => None,
        }
    }

    /// Converts an I/O error. A connection that the other side has closed or reset becomes
    /// [`Closed`](Self::Closed).
    pub(crate) fn from_io(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Io(error),
        }
    }
}
