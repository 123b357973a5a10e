//! The errors of the client.

use crate::{ErrorBody, ErrorCode, MessageEncodeError};
use std::io::{self, ErrorKind};
use std::time::Duration;

/// The error returned when a client cannot connect, or a request fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// No program accepts connections at the address.
    #[error(
        "no server at {address} (connection refused). Start one with `hbot server` (`cargo run server` in the project's \
         folder), or name another address"
    )]
    NoServer {
        /// The address to which the client tried to connect.
        address: String,
    },
    /// The address has a wrong form.
    #[error("{address:?} is no address of a server: {reason}. Legal: HOST or HOST:PORT, as 127.0.0.1:4268")]
    Address {
        /// The address that the caller gave.
        address: String,
        /// What is wrong with the form of the address.
        reason: String,
    },
    /// The address has the right form, but no machine is known by its name.
    #[error("no machine is known by the name {host:?} ({reason})")]
    UnknownHost {
        /// The host in the address.
        host: String,
        /// The operating system's description of the error.
        reason: String,
    },
    /// The connection failed for another reason than [`NoServer`](Self::NoServer),
    /// [`Address`](Self::Address) or [`UnknownHost`](Self::UnknownHost).
    #[error("cannot connect to {address}: {source}")]
    Connect {
        /// The address to which the client tried to connect.
        address: String,
        /// The error from the operating system.
        source: io::Error,
    },
    /// The server did not answer a request in time.
    #[error("no answer to {what} within {} s", after.as_secs_f64())]
    Timeout {
        /// The op of the unanswered request.
        what: &'static str,
        /// How long the client waited for the answer.
        after: Duration,
    },
    /// No state arrived in time, although the client has subscribed to states.
    #[error("no state within {} s: the server's loop does not run, or the connection is cut", after.as_secs_f64())]
    NoState {
        /// How long the client waited for a state.
        after: Duration,
    },
    /// The server refused the request. The message of the error says why.
    #[error("{0}")]
    Server(ErrorBody),
    /// The connection was closed before the first answer.
    #[error(
        "{address} has closed the connection without an answer. Is it the port that the server prints after \
         `listen`? That after `web` is for browsers"
    )]
    NoHello {
        /// The address, with its port.
        address: String,
    },
    /// The server closed the connection.
    #[error("the server has closed the connection")]
    Closed,
    /// Reading or writing failed, so the connection is broken.
    #[error("connection to the server broken: {0}")]
    Io(io::Error),
    /// The server sent something that is not a message of this protocol. It is probably another
    /// program or another version.
    #[error("the server sent a message that cannot be read: {0}")]
    Protocol(String),
    /// The TLS connection failed, or the server requires encryption and the client does not use it.
    #[error("{0}")]
    Tls(String),
    /// The request cannot be encoded, for example because a number is not finite.
    #[error(transparent)]
    Encode(#[from] MessageEncodeError),
}

impl ClientError {
    /// Returns the error code from the server if the server refused the request, or `None` for
    /// other errors.
    #[must_use]
    pub const fn code(&self) -> Option<ErrorCode> {
        match self {
            Self::Server(error) => Some(error.code),
            _ => None,
        }
    }

    /// Converts an I/O error to a client error. An error which means that the other side has closed
    /// or reset the connection becomes [`Closed`](Self::Closed).
    pub(crate) fn from_io(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Io(error),
        }
    }
}
