//! Connects to a server and exchanges the hello.

use super::{Client, ClientError, Stream, Trust, new_splitter, read_piece};
use crate::{
    DEFAULT_PORT, Encoding, Hello, HelloOk, Id, Mode, ModeOk, Op, OpName, PROTOCOL_VERSION, Request,
    Response, ServerMessage, Token,
};
use serde_json::Value;
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// First byte of a TLS alert. A server that requires encryption sends an alert to a client that
/// does not encrypt.
const ALERT: u8 = 0x15;

/// Options for connecting to a server.
#[derive(Clone, Debug)]
pub struct ConnectOptions {
    /// Name of the client, shown to people: 1 to [`MAX_NAME_BYTES`](crate::MAX_NAME_BYTES) bytes
    /// without control or invisible characters (see [`is_plain`](crate::is_plain)).
    pub name: String,
    /// Token of the server. Required if the server has one.
    pub token: Option<Token>,
    /// Encoding of all messages after the first one (`hello`) and its answer.
    pub encoding: Encoding,
    /// Certificates that the client trusts. With `Some`, connecting fails if the server does not
    /// encrypt. With `None`, it fails if the server encrypts.
    pub trust: Option<Trust>,
    /// Longest time for connecting, and later for each answer. Default: 5 s, which is enough for
    /// `load_scene` on a small machine.
    pub timeout: Duration,
}

impl ConnectOptions {
    /// Creates options for a client with this name. The other options have their defaults: no
    /// token, JSON, no encryption and a timeout of 5 s.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.into(),
            token: None,
            encoding: Encoding::Json,
            trust: None,
            timeout: Duration::from_secs(5),
        }
    }
}

impl Client {
    /// Connects to the server at `address` and introduces the client as `name`. The address is
    /// `HOST:PORT` or `HOST`, such as `127.0.0.1:4268`, `[::1]:4268` or `rig.local`. The default
    /// port is [`DEFAULT_PORT`].
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::NoServer`] if no program listens at the address, and with
    /// [`ClientError::Server`] if the server refuses the client.
    pub fn connect(address: &str, name: &str) -> Result<Self, ClientError> {
        Self::connect_with(address, &ConnectOptions::new(name))
    }

    /// Connects to the server at `address` with the given options. See [`connect`](Self::connect)
    /// for the form of the address.
    ///
    /// # Errors
    ///
    /// Fails like [`connect`](Self::connect).
    pub fn connect_with(address: &str, options: &ConnectOptions) -> Result<Self, ClientError> {
        Self::greet(address, options, None).map_err(|error| unanswered(error, address))
    }

    /// Performs an emergency stop of the rig at `address`, over a new connection. Returns the mode
    /// from the next tick on.
    ///
    /// The stop is sent together with the hello, so it does not wait for the answer to the hello. A
    /// server that is suspended reads both when it runs again, even if this call has failed
    /// meanwhile. If the server encrypts, the stop has to wait for the TLS handshake. The messages
    /// are JSON, whatever [`encoding`](ConnectOptions::encoding) says.
    ///
    /// # Errors
    ///
    /// Fails like [`connect`](Self::connect), and with [`ClientError::Timeout`] if the server does
    /// not confirm the stop in time. After any error nobody knows whether the rig stops: cut the
    /// motors' power.
    pub fn estop_at(address: &str, options: &ConnectOptions) -> Result<Mode, ClientError> {
        let deadline = Instant::now() + options.timeout;
        let options = ConnectOptions { encoding: Encoding::Json, ..options.clone() };
        let id = Id::Integer(1);
        let stop = Request { id: Some(id.clone()), op: Op::Estop };
        let mut client =
            Self::greet(address, &options, Some(&stop)).map_err(|error| unanswered(error, address))?;
        let answer = client.answer(&id, OpName::Estop.as_str(), deadline)?;
        typed(answer).map(|ModeOk { mode }| mode)
    }

    /// Connects, and sends the hello and the request `first`, if any, together. Returns when the
    /// hello is answered. `first` is in JSON, so it needs `options` with this encoding.
    fn greet(address: &str, options: &ConnectOptions, first: Option<&Request>) -> Result<Self, ClientError> {
        let deadline = Instant::now() + options.timeout;
        let stream = open(address, options.timeout)?;
        let configure = |stream: &TcpStream| {
            stream.set_nodelay(true)?;
            stream.set_write_timeout(Some(options.timeout))
        };
        configure(&stream).map_err(ClientError::from_io)?;
        let late = || ClientError::Timeout { what: OpName::Hello.as_str(), after: options.timeout };
        let mut stream = match &options.trust {
            None => Stream::Plain(stream),
            Some(trust) => {
                let secured = trust.shake_hands(host(address), stream, deadline)?;
                Stream::Tls(Box::new(secured.ok_or_else(late)?))
            }
        };

        let op = Op::Hello(Hello {
            version: PROTOCOL_VERSION,
            name: options.name.clone(),
            token: options.token.clone(),
            encoding: options.encoding,
        });
        let mut out = Vec::new();
        Encoding::Json.encode(&Request { id: Some(Id::Integer(0)), op }, &mut out)?;
        if let Some(first) = first {
            Encoding::Json.encode(first, &mut out)?;
        }
        stream.send(&out).map_err(ClientError::from_io)?;
        if let Stream::Plain(socket) = &stream {
            answers_plainly(socket, deadline)?;
        }

        let mut splitter = new_splitter();
        let hello = loop {
            if let Some(line) = splitter.next_message() {
                break read_hello(line.map_err(|error| ClientError::Protocol(error.to_string()))?)?;
            }
            if !read_piece(&mut stream, &mut splitter, deadline)? {
                return Err(late());
            }
        };
        splitter.set_encoding(options.encoding);
        Ok(Self {
            stream,
            splitter,
            hello,
            timeout: options.timeout,
            events: VecDeque::new(),
            events_lost: 0,
            last_id: 0,
            out,
        })
    }
}

fn read_hello(line: &[u8]) -> Result<HelloOk, ClientError> {
    match ServerMessage::read(Encoding::Json, line).map_err(ClientError::Protocol)? {
        ServerMessage::Response(Response { result: Ok(body), .. }) => typed(body),
        ServerMessage::Response(Response { result: Err(error), .. }) => Err(ClientError::Server(error)),
        ServerMessage::Event(_) => Err(ClientError::Protocol("an event before the answer to hello".into())),
    }
}

/// Converts the body of an answer to the type `T`.
pub(super) fn typed<T: serde::de::DeserializeOwned>(body: Value) -> Result<T, ClientError> {
    serde_json::from_value(body).map_err(|error| ClientError::Protocol(error.to_string()))
}

/// Opens a TCP connection. Tries all addresses that the host name has: `localhost`, for example,
/// can have two, and a server may listen on only one of them.
fn open(address: &str, timeout: Duration) -> Result<TcpStream, ClientError> {
    let candidates = resolve(address)?;
    let mut last = io::Error::from(ErrorKind::AddrNotAvailable);
    for candidate in candidates {
        match TcpStream::connect_timeout(&candidate, timeout) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(match last.kind() {
        ErrorKind::ConnectionRefused => ClientError::NoServer { address: with_port(address) },
        _ => ClientError::Connect { address: address.into(), source: last },
    })
}

/// Returns the socket addresses that an address names. The form is checked first, because the
/// system's message about a wrong form does not say what is wrong.
fn resolve(address: &str) -> Result<Vec<SocketAddr>, ClientError> {
    let wrong = |reason: String| Err(ClientError::Address { address: address.into(), reason });
    let host = host(address);
    if host.is_empty() {
        return wrong("it has no host".to_owned());
    }
    if address.bytes().all(|byte| byte.is_ascii_digit()) {
        return wrong(format!("it is a port alone; on this machine it is 127.0.0.1:{address}"));
    }
    if let Some(c) = host.chars().find(|c| !c.is_alphanumeric() && !"-._:%".contains(*c)) {
        return wrong(format!("the name of a machine has no {c:?}"));
    }
    let found: io::Result<Vec<SocketAddr>> = if has_port(address) {
        let port = address.rsplit(':').next().unwrap_or_default();
        if port.parse::<u16>().is_err() {
            return wrong(format!("{port:?} is no port, which is a number up to 65535"));
        }
        address.to_socket_addrs().map(Iterator::collect)
    } else {
        (host, DEFAULT_PORT).to_socket_addrs().map(Iterator::collect)
    };
    found.map_err(|error| ClientError::UnknownHost { host: host.to_owned(), reason: error.to_string() })
}

/// Returns the error of a connection that ended before the answer to the hello.
fn unanswered(error: ClientError, address: &str) -> ClientError {
    match error {
        ClientError::Closed => ClientError::NoHello { address: with_port(address) },
        error => error,
    }
}

/// Returns an address with its port, for messages.
fn with_port(address: &str) -> String {
    if has_port(address) { address.to_owned() } else { format!("{address}:{DEFAULT_PORT}") }
}

/// Returns whether the address ends with a port. An IPv6 address without brackets contains colons
/// but has no port.
fn has_port(address: &str) -> bool {
    address.rsplit_once(':').is_some_and(|(host, _)| !host.contains(':') || host.ends_with(']'))
}

/// Returns the host in an address, without port and brackets. The server's certificate must be
/// valid for this host.
fn host(address: &str) -> &str {
    let host = match address.rsplit_once(':') {
        Some((host, _)) if has_port(address) => host,
        _ => address,
    };
    host.trim_start_matches('[').trim_end_matches(']')
}

/// Waits for the first byte from the server without consuming it. Fails if the byte begins a TLS
/// alert, because the server then requires encryption. Succeeds if no byte arrives or the
/// connection breaks, because the next read reports this.
fn answers_plainly(socket: &TcpStream, deadline: Instant) -> Result<(), ClientError> {
    let left = deadline.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
    socket.set_read_timeout(Some(left)).map_err(ClientError::from_io)?;
    let mut first = [0];
    match socket.peek(&mut first) {
        Ok(1) if first == [ALERT] => {
            Err(ClientError::Tls("the server encrypts: name its certificate, or its authority's".to_owned()))
        }
        _ => Ok(()),
    }
}
