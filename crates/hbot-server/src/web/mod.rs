//! The web port: one page for a browser, and the API over WebSocket.
//!
//! ```text
//! browser -> head (one HTTP request) -> allowed (Host, Origin) -> page, or upgrade
//! upgrade -> socket (WebSocket frames <-> the bytes of TCP) -> the connection of the service
//! ```
//!
//! Everything after the upgrade is the code that serves TCP: hello, token, lease, limits and the
//! search for stops. Live viewers use the same head, checks and upgrade.

pub(crate) mod allowed;
mod frames;
pub(crate) mod head;
mod page;
mod socket;

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt as _};
#[cfg(feature = "live")]
use tungstenite::handshake::server::Request;
#[cfg(feature = "live")]
use tungstenite::http;
use tungstenite::http::{Response, StatusCode};

pub use self::allowed::AllowedHosts;
use self::allowed::Door;
use self::head::{Head, Refusal};
pub(crate) use self::socket::WebSocket;

/// Default port of the page, on loopback.
pub const DEFAULT_WEB_PORT: u16 = 4269;

/// The settings of the web port.
pub struct WebOptions {
    /// The socket on which the page and the API over WebSocket are served.
    pub listener: TcpListener,
    /// Which names of this machine a browser may use.
    pub hosts: Arc<AllowedHosts>,
}

/// How a visit to the web port continues after its first HTTP request.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Visit {
    /// The connection is now a WebSocket. `rest` are the bytes that came after the request.
    Upgraded { rest: Vec<u8> },
    /// The request was answered, and the connection ends.
    Answered,
    /// The request was refused and answered, and the connection ends.
    Refused,
}

/// Reads one HTTP request from `stream` and answers it: with a part of the page, an upgrade to
/// WebSocket at the path `/ws`, or a refusal.
///
/// # Errors
/// Fails if the connection fails, or ends before the request does.
pub(crate) async fn visit<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    door: &Door<'_>,
) -> std::io::Result<Visit> {
    let Head { request, rest } = match head::read(stream).await? {
        Ok(head) => head,
        Err(refusal) => return refuse(stream, &refusal).await,
    };
    if let Err(refusal) = door.check(&request) {
        return refuse(stream, &refusal).await;
    }
    let path = request.uri().path();
    if path == "/ws" {
        return match door.check_origin(&request).and_then(|()| head::accept(&request)) {
            Ok(response) => {
                send(stream, &response, "").await?;
                Ok(Visit::Upgraded { rest })
            }
            Err(refusal) => refuse(stream, &refusal).await,
        };
    }
    match page::part(path) {
        Some(part) => {
            respond(stream, StatusCode::OK, part.kind, part.body).await?;
            Ok(Visit::Answered)
        }
        None => refuse(stream, &Refusal::new(StatusCode::NOT_FOUND, "the page is at /")).await,
    }
}

/// Reads one HTTP request from `stream` and makes the connection a WebSocket, unless `check`
/// refuses the request. `check` can add a header to the answer. Returns the bytes that came after
/// the request, or `None` if it was refused.
///
/// # Errors
/// Fails if the connection fails, or ends before the request does.
#[cfg(feature = "live")]
pub(crate) async fn upgrade<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    check: impl FnOnce(&Request) -> Result<Option<(http::HeaderName, http::HeaderValue)>, Refusal>,
) -> std::io::Result<Option<Vec<u8>>> {
    let judged = head::read(stream).await?.and_then(|Head { request, rest }| {
        let more = check(&request)?;
        let mut response = head::accept(&request)?;
        response.headers_mut().extend(more);
        Ok((response, rest))
    });
    match judged {
        Ok((response, rest)) => {
            send(stream, &response, "").await?;
            Ok(Some(rest))
        }
        Err(refusal) => refuse(stream, &refusal).await.map(|_| None),
    }
}

async fn refuse<S: AsyncWrite + Unpin>(stream: &mut S, refusal: &Refusal) -> std::io::Result<Visit> {
    respond(stream, refusal.status, "text/plain; charset=utf-8", &format!("{}\n", refusal.why)).await?;
    Ok(Visit::Refused)
}

/// Sends an answer with the headers that every answer of the web port has.
async fn respond<S: AsyncWrite + Unpin>(
    stream: &mut S,
    status: StatusCode,
    kind: &str,
    body: &str,
) -> std::io::Result<()> {
    let response = Response::builder()
        .status(status)
        .header("Content-Type", kind)
        .header("Content-Length", body.len())
        .header("Content-Security-Policy", "default-src 'self'")
        .header("X-Frame-Options", "DENY")
        .header("X-Content-Type-Options", "nosniff")
        .header("Referrer-Policy", "no-referrer")
        .header("Cross-Origin-Resource-Policy", "same-origin")
        .header("Cache-Control", "no-store")
        .header("Connection", "close")
        .body(());
    let Ok(response) = response else { return Err(std::io::ErrorKind::InvalidData.into()) };
    send(stream, &response, body).await
}

async fn send<S: AsyncWrite + Unpin>(
    stream: &mut S,
    response: &Response<()>,
    body: &str,
) -> std::io::Result<()> {
    let mut bytes = head::bytes_of(response);
    bytes.extend_from_slice(body.as_bytes());
    stream.write_all(&bytes).await?;
    stream.flush().await
}

/// Returns the address as a browser writes it.
#[must_use]
pub fn url(at: SocketAddr, encrypted: bool) -> String {
    format!("{}://{at}", if encrypted { "https" } else { "http" })
}
