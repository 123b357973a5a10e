//! The head of an HTTP request, and the answer that makes a connection a WebSocket.

use tokio::io::{AsyncRead, AsyncReadExt as _};
use tungstenite::error::ProtocolError;
use tungstenite::handshake::machine::TryParse as _;
use tungstenite::handshake::server::{Request, create_response, write_response};
use tungstenite::http::{Response, StatusCode};
use tungstenite::{Error, handshake::server};

/// Largest size of a request's head, bytes.
const HEAD: usize = 8 * 1024;
/// Number of bytes that are read at once.
const PIECE: usize = 1024;

/// A request for a page or for a WebSocket.
#[derive(Debug)]
pub(crate) struct Head {
    /// The method is GET and the version HTTP/1.1.
    pub(crate) request: Request,
    /// The bytes that were read after the head.
    pub(crate) rest: Vec<u8>,
}

/// Why a request is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    pub(crate) status: StatusCode,
    /// A sentence for people, without a newline.
    pub(crate) why: String,
}

impl Refusal {
    pub(crate) fn new(status: StatusCode, why: impl Into<String>) -> Self {
        Self { status, why: why.into() }
    }
}

/// Reads the head of an HTTP request. The inner error is a request that cannot be served.
///
/// # Errors
/// Fails if the connection fails or ends before the end of the head.
pub(crate) async fn read<S: AsyncRead + Unpin>(stream: &mut S) -> std::io::Result<Result<Head, Refusal>> {
    Ok(bytes(stream).await?.and_then(|bytes| parse(&bytes)))
}

/// Reads the bytes of an HTTP request up to the end of its head or further, as [`read`] does.
pub(crate) async fn bytes<S: AsyncRead + Unpin>(stream: &mut S) -> std::io::Result<Result<Vec<u8>, Refusal>> {
    let mut bytes = Vec::with_capacity(PIECE);
    loop {
        let searched = bytes.len().saturating_sub(3);
        bytes.reserve(PIECE);
        if (&mut *stream).take(PIECE as u64).read_buf(&mut bytes).await? == 0 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
        let within = &bytes[..bytes.len().min(HEAD)];
        if within[searched..].windows(4).any(|end| end == b"\r\n\r\n") {
            return Ok(Ok(bytes));
        }
        if bytes.len() >= HEAD {
            let why = format!("the head of a request has at most {HEAD} bytes");
            return Ok(Err(Refusal::new(StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE, why)));
        }
    }
}

fn parse(bytes: &[u8]) -> Result<Head, Refusal> {
    match Request::try_parse(bytes) {
        Ok(Some((length, request))) => Ok(Head { request, rest: bytes[length..].to_vec() }),
        Ok(None) => Err(Refusal::new(StatusCode::BAD_REQUEST, "the request has no end")),
        Err(Error::Protocol(ProtocolError::WrongHttpMethod)) => {
            Err(Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "only GET is served here"))
        }
        Err(error) => Err(Refusal::new(StatusCode::BAD_REQUEST, error.to_string())),
    }
}

/// Returns the answer that accepts an upgrade to WebSocket. It accepts no extension, so frames are
/// never compressed.
///
/// # Errors
/// Fails if the request asks for no upgrade or for an illegal one.
pub(crate) fn accept(request: &Request) -> Result<server::Response, Refusal> {
    create_response(request).map_err(|error| Refusal::new(StatusCode::UPGRADE_REQUIRED, error.to_string()))
}

/// Returns the bytes of an answer's head.
pub(crate) fn bytes_of<T>(response: &Response<T>) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail, and all headers are text.
    let _ = write_response(&mut bytes, response);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn read_from(bytes: &[u8]) -> Result<Head, Refusal> {
        read(&mut &bytes[..]).await.unwrap()
    }

    #[tokio::test]
    async fn a_head_ends_at_its_blank_line() {
        let head = read_from(b"GET /a?b HTTP/1.1\r\nHost: h\r\n\r\nrest").await.unwrap();
        assert_eq!((head.request.uri().path(), &head.rest[..]), ("/a", &b"rest"[..]));
    }

    #[tokio::test]
    async fn what_is_no_get_or_too_long_is_refused() {
        let status = |refusal: Result<Head, Refusal>| refusal.unwrap_err().status.as_u16();
        assert_eq!(status(read_from(b"POST / HTTP/1.1\r\nHost: h\r\n\r\n").await), 405);
        assert_eq!(status(read_from(b"GET / HTTP/1.0\r\nHost: h\r\n\r\n").await), 400);
        assert_eq!(status(read_from(b"{\"op\":\"estop\"}\r\n\r\n").await), 400);
        let long = format!("GET / HTTP/1.1\r\nX: {}\r\n\r\n", "x".repeat(HEAD));
        assert_eq!(status(read_from(long.as_bytes()).await), 431);
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(200));
        assert_eq!(status(read_from(many.as_bytes()).await), 400);
        assert!(read(&mut &b"GET / HTTP/1.1\r\n"[..]).await.is_err(), "it ends before its blank line");
    }
}
