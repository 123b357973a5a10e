//! A blocking client, for programs without an asynchronous runtime.

mod connect;
mod error;
mod name;
mod render;
mod time;
#[cfg_attr(not(feature = "tls"), path = "client/no_tls.rs")]
mod tls;

pub use connect::ConnectOptions;
pub use error::ClientError;
pub use name::client_name;
pub use render::{LatePolicy, RenderEnd, RenderOptions, RenderReport};
pub use time::time_of_day;
pub use tls::Trust;

use crate::{Encoding, Event, HelloOk, Id, MAX_ANSWER_BYTES, Op, Request, Response, ServerMessage, Splitter};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tls::TlsStream;

/// Largest number of events kept for [`Client::next_event`]: the states of four seconds at 1 kHz.
/// If more arrive, the oldest are dropped.
const MAX_EVENTS: usize = 4096;

/// Largest number of bytes that one read takes from the socket.
const PIECE_BYTES: usize = 16 * 1024;

/// A connection to a server.
///
/// Every call sends one request, waits for its answer, and fails like [`call`](Self::call). Only
/// [`torque`](Self::torque), [`reference`](Self::reference), [`model`](Self::model) and
/// [`hand`](Self::hand), which are called repeatedly, do not wait and fail like
/// [`send`](Self::send). Events that arrive in the meantime are kept for
/// [`next_event`](Self::next_event). If too many are kept, the oldest are dropped and counted in
/// [`events_lost`](Self::events_lost). After [`ClientError::Io`], [`ClientError::Closed`] or
/// [`ClientError::Protocol`] the connection is unusable, and the program has to connect again.
#[derive(Debug)]
pub struct Client {
    stream: Stream,
    splitter: Splitter,
    hello: HelloOk,
    /// Longest time that a call waits for its answer.
    timeout: Duration,
    events: VecDeque<Event>,
    events_lost: u64,
    last_id: i64,
    /// Buffer for messages to send. It is reused, so that repeated sending does not allocate.
    out: Vec<u8>,
}

impl Client {
    /// Returns the server's answer to the first message: its name, version, rig and tick rate.
    #[must_use]
    pub const fn hello(&self) -> &HelloOk {
        &self.hello
    }

    /// Returns the encoding of messages on this connection.
    #[must_use]
    pub const fn encoding(&self) -> Encoding {
        self.splitter.encoding()
    }

    /// Returns the number of events that were dropped because the program did not call
    /// [`next_event`](Self::next_event) often enough.
    #[must_use]
    pub const fn events_lost(&self) -> u64 {
        self.events_lost
    }

    /// Sets the longest time that a call waits for its answer.
    pub const fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Sends a request and waits for its answer. Returns the answer's body.
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::Server`] if the server refuses the request, and with
    /// [`ClientError::Timeout`] if it does not answer in time. An answer that arrives later is
    /// ignored. Fails with other errors if the request cannot be sent or the connection is
    /// unusable.
    pub fn call(&mut self, op: Op) -> Result<Value, ClientError> {
        let what = op.name().as_str();
        let deadline = Instant::now() + self.timeout;
        let id = self.send_with_id(op)?;
        self.answer(&id, what, deadline)
    }

    /// Sends a request with a new id, and returns the id. The answer belongs to no other request.
    pub(crate) fn send_with_id(&mut self, op: Op) -> Result<Id, ClientError> {
        self.last_id += 1;
        let id = Id::Integer(self.last_id);
        self.write(&Request { id: Some(id.clone()), op })?;
        Ok(id)
    }

    /// Like [`call`](Self::call), for an answer of type `T`.
    pub(crate) fn ask<T: DeserializeOwned>(&mut self, op: Op) -> Result<T, ClientError> {
        self.call(op).and_then(connect::typed)
    }

    /// Waits for the answer to the request `id`, whose op is `what`. Returns the answer's body.
    fn answer(&mut self, id: &Id, what: &'static str, deadline: Instant) -> Result<Value, ClientError> {
        loop {
            match self.receive(deadline)? {
                None => return Err(ClientError::Timeout { what, after: self.timeout }),
                Some(ServerMessage::Event(event)) => {
                    self.keep(event);
                    // A flood of events must not extend the waiting time.
                    if Instant::now() > deadline {
                        return Err(ClientError::Timeout { what, after: self.timeout });
                    }
                }
                // An answer without id belongs to a message that the server could not read: the
                // last one.
                Some(ServerMessage::Response(Response { id: answered, result })) => {
                    if answered.as_ref().is_none_or(|answered| answered == id) {
                        return result.map_err(ClientError::Server);
                    }
                }
            }
        }
    }

    /// Sends a request without waiting for an answer, as is usual for repeated commands (streams).
    /// If the server refuses it, an [`Event::Refused`] arrives later.
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::Encode`] if a number is not finite, and with [`ClientError::Io`]
    /// or [`ClientError::Closed`] if the connection is broken.
    pub fn send(&mut self, op: Op) -> Result<(), ClientError> {
        self.write(&Request { id: None, op })
    }

    /// Returns the oldest event that has not been returned yet, and waits for one if necessary.
    /// Returns `None` if no event arrives within `timeout`. A timeout of zero returns only events
    /// that have already arrived.
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::Closed`] after the last event of a connection that has ended.
    pub fn next_event(&mut self, timeout: Duration) -> Result<Option<Event>, ClientError> {
        if let Some(event) = self.events.pop_front() {
            return Ok(Some(event));
        }
        let deadline = Instant::now() + timeout;
        loop {
            match self.receive(deadline)? {
                None => return Ok(None),
                Some(ServerMessage::Event(event)) => return Ok(Some(event)),
                Some(ServerMessage::Response(Response { id: None, result: Err(error) })) => {
                    return Err(ClientError::Server(error));
                }
                // The late answer to a call that has timed out.
                Some(ServerMessage::Response(_)) => {}
            }
        }
    }

    fn keep(&mut self, event: Event) {
        if self.events.len() == MAX_EVENTS {
            self.events.pop_front();
            self.events_lost += 1;
        }
        self.events.push_back(event);
    }

    fn write(&mut self, request: &Request) -> Result<(), ClientError> {
        self.out.clear();
        self.encoding().encode(request, &mut self.out)?;
        self.stream.send(&self.out).map_err(ClientError::from_io)
    }

    /// Returns the next message from the server. Returns `None` if no message arrives before the
    /// deadline.
    fn receive(&mut self, deadline: Instant) -> Result<Option<ServerMessage>, ClientError> {
        let encoding = self.encoding();
        loop {
            if let Some(message) = self.splitter.next_message() {
                let message = message.map_err(|error| ClientError::Protocol(error.to_string()))?;
                return ServerMessage::read(encoding, message).map(Some).map_err(ClientError::Protocol);
            }
            if !read_piece(&mut self.stream, &mut self.splitter, deadline)? {
                return Ok(None);
            }
        }
    }
}

/// The byte stream of a connection, either plain TCP or TLS.
#[derive(Debug)]
enum Stream {
    Plain(TcpStream),
    Tls(Box<TlsStream>),
}

impl Stream {
    const fn socket(&self) -> &TcpStream {
        match self {
            Self::Plain(socket) => socket,
            Self::Tls(stream) => &stream.sock,
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Plain(socket) => socket.write_all(bytes),
            Self::Tls(stream) => {
                stream.write_all(bytes)?;
                stream.flush()
            }
        }
    }

    fn read(&mut self, piece: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(socket) => socket.read(piece),
            Self::Tls(stream) => match stream.read(piece) {
                // A server that closes the connection without TLS's closing message counts as
                // closed.
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(0),
                result => result,
            },
        }
    }
}

/// Reads bytes from `stream` and passes them to the splitter, which finds the messages in them.
/// Returns false if no bytes arrive before the deadline.
fn read_piece(stream: &mut Stream, splitter: &mut Splitter, deadline: Instant) -> Result<bool, ClientError> {
    let mut piece = [0; PIECE_BYTES];
    loop {
        return match read_before(stream, &mut piece, deadline) {
            Ok(0) => Err(ClientError::Closed),
            Ok(length) => {
                splitter.push(&piece[..length]);
                Ok(true)
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) if is_timeout(&error) => Ok(false),
            Err(error) => Err(ClientError::from_io(error)),
        };
    }
}

/// Reads once, and waits until the deadline at most. After the deadline, it still reads bytes that
/// have arrived, but does not wait. Operating systems round short timeouts up to milliseconds, and
/// a client that polls once per frame of a game must not wait that long.
fn read_before(stream: &mut Stream, piece: &mut [u8], deadline: Instant) -> io::Result<usize> {
    let left = deadline.saturating_duration_since(Instant::now());
    if left.is_zero() {
        stream.socket().set_nonblocking(true)?;
        let result = stream.read(piece);
        stream.socket().set_nonblocking(false)?;
        return result;
    }
    stream.socket().set_read_timeout(Some(left))?;
    stream.read(piece)
}

/// Returns whether an error means that a read timed out. Operating systems report a timeout as
/// different kinds of error.
fn is_timeout(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

const fn new_splitter() -> Splitter {
    Splitter::with_limit(Encoding::Json, MAX_ANSWER_BYTES)
}
