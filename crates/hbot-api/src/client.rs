//! A client that waits for its answers, for programs without an asynchronous runtime.

mod connect;
mod error;
mod ops;
mod tls;

pub use connect::ConnectOptions;
pub use error::ClientError;
pub use tls::Trust;

use crate::{Encoding, Event, HelloOk, Id, MAX_ANSWER_BYTES, Op, Request, Response, ServerMessage, Splitter};
use serde_json::Value;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tls::TlsStream;

/// The most events kept for [`Client::next_event`]: the states of four seconds at 1 kHz. Then the oldest go.
const MAX_EVENTS: usize = 4096;

/// Bytes read from the socket at once.
const PIECE_BYTES: usize = 16 * 1024;

/// A connection to a server.
///
/// Requests are answered in order, one at a time; events that come between are kept for
/// [`next_event`](Self::next_event). A client that has subscribed and asks for no events lets the oldest go and
/// counts them in [`events_lost`](Self::events_lost). After [`ClientError::Io`], [`ClientError::Closed`] or
/// [`ClientError::Protocol`] only a new connection helps.
#[derive(Debug)]
pub struct Client {
    stream: Stream,
    splitter: Splitter,
    hello: HelloOk,
    /// How long an answer may take.
    timeout: Duration,
    events: VecDeque<Event>,
    events_lost: u64,
    last_id: i64,
    /// Reused, so a stream of torques takes no memory.
    out: Vec<u8>,
}

impl Client {
    /// What the server said of itself.
    #[must_use]
    pub const fn hello(&self) -> &HelloOk {
        &self.hello
    }

    /// How both sides send.
    #[must_use]
    pub const fn encoding(&self) -> Encoding {
        self.splitter.encoding()
    }

    /// Events that went because nobody asked for them in time.
    #[must_use]
    pub const fn events_lost(&self) -> u64 {
        self.events_lost
    }

    /// Changes how long an answer may take from now on.
    pub const fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Asks and waits for the answer.
    ///
    /// # Errors
    ///
    /// [`ClientError::Server`] where the server refuses, [`ClientError::Timeout`] where it does not answer in time; an
    /// answer that comes later is passed over.
    pub fn call(&mut self, op: Op) -> Result<Value, ClientError> {
        let what = op.name().as_str();
        self.last_id += 1;
        let id = Id::Integer(self.last_id);
        let deadline = Instant::now() + self.timeout;
        self.write(&Request { id: Some(id.clone()), op })?;
        loop {
            match self.receive(deadline)? {
                None => return Err(ClientError::Timeout { what, after: self.timeout }),
                Some(ServerMessage::Event(event)) => {
                    self.keep(event);
                    // A flood of events does not put off the end of waiting.
                    if Instant::now() > deadline {
                        return Err(ClientError::Timeout { what, after: self.timeout });
                    }
                }
                // An answer without id is to something that the server could not read: what was sent last.
                Some(ServerMessage::Response(Response { id: answered, result })) => {
                    if answered.as_ref().is_none_or(|answered| *answered == id) {
                        return result.map_err(ClientError::Server);
                    }
                }
            }
        }
    }

    /// Sends without asking for an answer: for streams. A refusal comes as [`Event::Refused`].
    ///
    /// # Errors
    ///
    /// [`ClientError::Encode`] where a number is not finite, [`ClientError::Io`] where the connection is broken.
    pub fn send(&mut self, op: Op) -> Result<(), ClientError> {
        self.write(&Request { id: None, op })
    }

    /// The next event, one kept first; `None` where none comes in time. With a timeout of zero: what has come already.
    ///
    /// # Errors
    ///
    /// [`ClientError::Closed`] after the last event of a connection that has ended.
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
                // The late answer to a call that has given up.
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

    /// The next message; `None` where none comes before the deadline.
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

/// Bytes to and from the server.
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
                // A server that is gone without a word of farewell is gone.
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(0),
                result => result,
            },
        }
    }
}

/// Reads what has come, or waits for it; false where the deadline passes first.
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

/// One read. After the deadline what has come is still read: systems round short timeouts up to milliseconds, and a
/// client that polls between the frames of a game must not wait for those.
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

/// Systems differ in what they call a read that has timed out.
fn is_timeout(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

const fn new_splitter() -> Splitter {
    Splitter::with_limit(Encoding::Json, MAX_ANSWER_BYTES)
}
