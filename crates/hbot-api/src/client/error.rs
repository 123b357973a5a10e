//! What can go wrong for a client.

use crate::{ErrorBody, ErrorCode, MessageEncodeError};
use std::io::{self, ErrorKind};
use std::time::Duration;

/// Why a client did not get what it asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// Nobody listens there.
    #[error(
        "no server at {address} (connection refused). Start one with `cargo run server`, or name another address"
    )]
    NoServer {
        /// Where it was looked for.
        address: String,
    },
    /// The address is none, or its name is not known.
    #[error("{address:?} is no address of a server: {reason}. Legal: HOST or HOST:PORT, as 127.0.0.1:4268")]
    Address {
        /// The address given.
        address: String,
        /// What the system says.
        reason: String,
    },
    /// The connection could not be made for another reason.
    #[error("cannot connect to {address}: {source}")]
    Connect {
        /// Where to.
        address: String,
        /// What the system says.
        source: io::Error,
    },
    /// The server is there and did not answer in time.
    #[error("no answer to {what} within {} s", after.as_secs_f64())]
    Timeout {
        /// The op asked.
        what: &'static str,
        /// How long was waited.
        after: Duration,
    },
    /// The server refused; its message says why.
    #[error("{0}")]
    Server(ErrorBody),
    /// The server ended the connection.
    #[error("the server has closed the connection")]
    Closed,
    /// The connection is broken.
    #[error("connection to the server broken: {0}")]
    Io(io::Error),
    /// The server sent something that is none of its messages: another program, or another version.
    #[error("the server sent what is no message of its: {0}")]
    Protocol(String),
    /// There is no encrypted connection, or there should have been one.
    #[error("{0}")]
    Tls(String),
    /// The request cannot be sent.
    #[error(transparent)]
    Encode(#[from] MessageEncodeError),
}

impl ClientError {
    /// The server's code, where the server refused.
    #[must_use]
    pub const fn code(&self) -> Option<ErrorCode> {
        match self {
            Self::Server(error) => Some(error.code),
            _ => None,
        }
    }

    /// An end is an end, whether the other side said so or not.
    pub(crate) fn from_io(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Io(error),
        }
    }
}
