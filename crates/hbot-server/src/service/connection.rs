//! One connection: runs its `reader` and its `writer`, from the TLS handshake to the end.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use rustix::net::sockopt;

use hbot_api::{Encoding, ErrorBody, ErrorCode, Response};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, split};
use tokio::net::TcpStream;
use tokio::time::{Instant, timeout, timeout_at};

use super::Bounds;
use super::hub::Gone;
use super::outbox::Inbox;
use super::reader::{Ended, PIECE_BYTES, Reader};
use super::shared_hub::SharedHub;
use super::writer::Writer;
use crate::tls::Encryption;
use crate::web::allowed::Door;
use crate::web::{AllowedHosts, Visit, WebSocket, visit};

/// Longest time for which a connection is still read after the server has ended it. Closing it with
/// unread bytes would reset it, and the client could lose the answer that gives the reason.
const LINGER: Duration = Duration::from_millis(300);
/// Largest number of bytes that are read after the server has ended a connection.
const LINGER_BYTES: usize = 4 << 20;

/// Idle time of a connection after which the operating system begins to send TCP keepalive probes.
const KEEP_IDLE: Duration = Duration::from_secs(5);
/// Time between two TCP keepalive probes.
const KEEP_EVERY: Duration = Duration::from_secs(1);
/// Number of TCP keepalive probes without an answer after which a connection is given up.
const KEEP_TIMES: u32 = 5;

/// Serves one connection, including its TLS handshake, until either side ends it.
pub(super) async fn serve(
    stream: TcpStream,
    encryption: Option<Encryption>,
    session: u64,
    hub: SharedHub,
    inbox: Inbox,
    bounds: Bounds,
) {
    let deadline = Instant::now() + bounds.hello;
    let Some(encryption) = encryption else {
        return converse(stream, deadline, session, hub, inbox, bounds).await;
    };
    match timeout_at(deadline, encryption.shake_hands(stream)).await {
        Ok(Ok(stream)) => converse(stream, deadline, session, hub, inbox, bounds).await,
        Ok(Err(_)) | Err(_) => hub.gone(session, Gone::NoHandshake),
    }
}

/// Serves one connection to the web port, including its TLS handshake: one request for a part of
/// the page, or a WebSocket until either side ends it.
pub(super) async fn serve_web(
    stream: TcpStream,
    hosts: Arc<AllowedHosts>,
    session: u64,
    hub: SharedHub,
    inbox: Inbox,
) {
    let (bounds, encryption, has_token) = {
        let hub = hub.lock();
        (*hub.bounds(), hub.encryption().cloned(), hub.has_token())
    };
    let deadline = Instant::now() + bounds.hello;
    let Ok(at) = stream.local_addr() else { return hub.gone(session, Gone::Ended) };
    let door = Door { hosts: &hosts, at, encrypted: encryption.is_some(), without_origin: has_token };
    let Some(encryption) = encryption else {
        return enter(stream, &door, deadline, session, hub, inbox).await;
    };
    match timeout_at(deadline, encryption.shake_hands(stream)).await {
        Ok(Ok(stream)) => enter(stream, &door, deadline, session, hub, inbox).await,
        Ok(Err(_)) | Err(_) => hub.gone(session, Gone::NoHandshake),
    }
}

/// Serves a connection to the web port after the TLS handshake, if any.
async fn enter<S: AsyncRead + AsyncWrite + Unpin>(
    mut stream: S,
    door: &Door<'_>,
    deadline: Instant,
    session: u64,
    hub: SharedHub,
    inbox: Inbox,
) {
    let visit = timeout_at(deadline, visit(&mut stream, door)).await;
    if let Ok(Ok(Visit::Upgraded { rest })) = visit {
        let bounds = *hub.lock().bounds();
        let agreed = hub.clone();
        let encoding = move || agreed.lock().encoding(session);
        let socket = WebSocket::new(stream, &rest, bounds.silence, encoding);
        return converse(socket, deadline, session, hub, inbox, bounds).await;
    }
    if let Ok(Ok(Visit::Refused)) = visit {
        hub.lock().refused(ErrorCode::BadRequest);
    }
    hub.gone(session, Gone::Ended);
    linger(&mut stream).await;
}

/// Serves a connection after the TLS handshake, if any. Closes it if no hello arrives by
/// `deadline`.
pub(super) async fn converse<S: AsyncRead + AsyncWrite + Unpin>(
    mut stream: S,
    deadline: Instant,
    session: u64,
    hub: SharedHub,
    inbox: Inbox,
    bounds: Bounds,
) {
    let stuck = |error: &io::Error| error.kind() == io::ErrorKind::TimedOut;
    let (reader, writer) = split(&mut stream);
    let mut reader = Reader::new(reader, deadline, session, hub.clone(), &bounds);
    let mut writer = Writer::new(writer, inbox, bounds.stuck);
    let ended = match exchange(&mut reader, &mut writer).await {
        Over::Reading(ended) => {
            hub.gone(session, Gone::Ended);
            // Answer all requests, even if the client has closed its sending direction.
            let written = writer.run().await;
            if written.as_ref().is_err_and(stuck) {
                hub.gone(session, Gone::Stuck);
            }
            if written.is_ok() { ended } else { Ended::Broken }
        }
        Over::Writing(written) => {
            hub.gone(session, if written.as_ref().is_err_and(stuck) { Gone::Stuck } else { Gone::Ended });
            if written.is_ok() { Ended::ByServer } else { Ended::Broken }
        }
    };
    drop((reader, writer));
    if ended != Ended::Broken {
        linger(&mut stream).await;
    }
}

/// Which direction of a connection ended first, and how it ended.
enum Over {
    Reading(Ended),
    Writing(io::Result<()>),
}

/// Reads requests from a connection and writes messages to it, until one of the two directions
/// ends. Returns which one ended, and how.
async fn exchange<S: AsyncRead + AsyncWrite>(reader: &mut Reader<S>, writer: &mut Writer<S>) -> Over {
    loop {
        // The answers of this turn are sent right after it. A wake-up for them would only run the
        // task once more.
        writer.hush();
        let pause = match reader.turn() {
            Ok(pause) => pause,
            Err(ended) => return Over::Reading(ended),
        };
        tokio::select! {
            // In this order: first send the answers of the turn, then read on.
            biased;
            written = writer.run() => return Over::Writing(written),
            waited = reader.wait(pause) => if let Err(ended) = waited {
                return Over::Reading(ended);
            },
        }
    }
}

/// Makes the operating system check that the client's machine is still there. If it disappears, the
/// connection ends after ten seconds. That bounds the time until its place and its lease are freed
/// and the policy for a lost client is applied.
pub(super) fn watch_over(stream: &TcpStream) -> rustix::io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, KEEP_IDLE)?;
    sockopt::set_tcp_keepintvl(stream, KEEP_EVERY)?;
    sockopt::set_tcp_keepcnt(stream, KEEP_TIMES)?;
    // While sent data is not acknowledged, this timeout applies instead of keepalive.
    let all = KEEP_IDLE + KEEP_EVERY * KEEP_TIMES;
    sockopt::set_tcp_user_timeout(stream, u32::try_from(all.as_millis()).unwrap_or(u32::MAX))
}

/// Refuses a new connection: sends an error message and closes it.
pub(super) async fn turn_away(mut stream: TcpStream, error: ErrorBody) {
    let mut line = Vec::new();
    if Encoding::Json.encode(&Response::error(None, error), &mut line).is_ok() {
        send_off(&mut stream, &line).await;
    }
}

/// Refuses a new connection to the web port: sends an HTTP answer and closes it.
pub(super) async fn turn_away_visitor(mut stream: TcpStream, error: ErrorBody) {
    let why = error.message;
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: {}\r\nRetry-After: 1\r\n\
         Connection: close\r\n\r\n{why}",
        why.len()
    );
    send_off(&mut stream, answer.as_bytes()).await;
}

async fn send_off(stream: &mut TcpStream, bytes: &[u8]) {
    if matches!(timeout(LINGER, stream.write_all(bytes)).await, Ok(Ok(()))) {
        linger(stream).await;
    }
}

async fn linger<S: AsyncRead + AsyncWrite + Unpin>(stream: &mut S) {
    let deadline = Instant::now() + LINGER;
    if !matches!(timeout_at(deadline, stream.shutdown()).await, Ok(Ok(()))) {
        return;
    }
    let mut piece = vec![0; PIECE_BYTES];
    let mut left = LINGER_BYTES;
    while let Ok(Ok(n)) = timeout_at(deadline, stream.read(&mut piece)).await {
        left = left.saturating_sub(n);
        if n == 0 || left == 0 {
            return;
        }
    }
}
