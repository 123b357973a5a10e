//! One connection: bytes to requests, messages to bytes. What they mean is the hub's to say.

use std::io;
use std::pin::pin;
use std::time::Duration;

use hbot_api::{Encoding, ErrorBody, ErrorCode, Op, Refusal, Request, Response, Splitter};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, ReadHalf, WriteHalf, split};
use tokio::net::TcpStream;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, sleep, timeout, timeout_at};

use super::Bounds;
use super::outbox::Inbox;
use crate::tls::Encryption;

/// Bytes read or written at once.
const PIECE_BYTES: usize = 16 * 1024;
const BATCH_BYTES: usize = 64 * 1024;

/// How long, and for how many bytes, a connection that the server ends goes on listening: closing with unread bytes
/// would reset it, and the client might lose the answer that says why.
const LINGER: Duration = Duration::from_millis(300);
const LINGER_BYTES: usize = 4 << 20;

/// What a connection tells the hub.
pub(super) enum FromClient {
    /// The first message, hello or not. What comes back decides whether there will be others, and in which encoding.
    First { session: u64, message: Result<Request, Refusal>, verdict: oneshot::Sender<Option<Encoding>> },
    /// A later message.
    Message { session: u64, message: Result<Request, Refusal> },
    /// The connection has ended, or the client will say no more.
    Gone { session: u64, why: Gone },
}

/// Why a connection has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gone {
    /// Either side has ended it.
    Ended,
    /// It was given up because the client has not read.
    Stuck,
    /// It was to be encrypted, and never was.
    NoHandshake,
}

/// Serves one connection until either side ends it.
pub(super) async fn serve(
    stream: TcpStream,
    encryption: Option<Encryption>,
    session: u64,
    hub: mpsc::Sender<FromClient>,
    inbox: Inbox,
    bounds: Bounds,
) {
    let deadline = Instant::now() + bounds.hello;
    let Some(encryption) = encryption else {
        return converse(stream, deadline, session, hub, inbox, bounds).await;
    };
    match timeout_at(deadline, encryption.shake_hands(stream)).await {
        Ok(Ok(stream)) => converse(stream, deadline, session, hub, inbox, bounds).await,
        Ok(Err(_)) | Err(_) => {
            let _ = hub.send(FromClient::Gone { session, why: Gone::NoHandshake }).await;
        }
    }
}

/// The same once bytes are what they mean: who has not said hello by `deadline` is sent away.
async fn converse<S: AsyncRead + AsyncWrite + Unpin>(
    mut stream: S,
    deadline: Instant,
    session: u64,
    hub: mpsc::Sender<FromClient>,
    inbox: Inbox,
    bounds: Bounds,
) {
    let ended = {
        let (reader, writer) = split(&mut stream);
        let mut reading = pin!(read(reader, deadline, session, &hub, &bounds));
        let mut writing = pin!(write(writer, inbox, bounds.stuck));
        // The hub outlives its connections; where it does not, nobody is left to be told.
        tokio::select! {
            ended = &mut reading => {
                let _ = hub.send(FromClient::Gone { session, why: Gone::Ended }).await;
                // What has been asked for is answered, even to a client that has closed its own direction.
                if writing.await.is_ok() { ended } else { Ended::Broken }
            }
            written = &mut writing => {
                let stuck = written.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::TimedOut);
                let why = if stuck { Gone::Stuck } else { Gone::Ended };
                let _ = hub.send(FromClient::Gone { session, why }).await;
                if written.is_ok() { Ended::ByServer } else { Ended::Broken }
            }
        }
    };
    if ended == Ended::ByServer {
        linger(&mut stream).await;
    }
}

/// Refuses a connection without serving it.
pub(super) async fn turn_away(mut stream: TcpStream, error: ErrorBody) {
    let mut line = Vec::new();
    if Encoding::Json.encode(&Response::error(None, error), &mut line).is_ok()
        && matches!(timeout(LINGER, stream.write_all(&line)).await, Ok(Ok(())))
    {
        linger(&mut stream).await;
    }
}

async fn linger<S: AsyncRead + AsyncWrite + Unpin>(stream: &mut S) {
    let deadline = Instant::now() + LINGER;
    if stream.shutdown().await.is_err() {
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

/// How a connection ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ended {
    ByClient,
    ByServer,
    Broken,
}

/// Messages from the client to the hub.
async fn read<S: AsyncRead>(
    mut half: ReadHalf<S>,
    deadline: Instant,
    session: u64,
    hub: &mpsc::Sender<FromClient>,
    bounds: &Bounds,
) -> Ended {
    let mut splitter = Splitter::new(Encoding::Json);
    let mut piece = vec![0; PIECE_BYTES];
    let first = match timeout_at(deadline, next(&mut half, &mut splitter, &mut piece)).await {
        Ok(Next::Message(message, _)) => message,
        Ok(Next::End(ended)) => return ended,
        Err(_) => {
            let message = format!("no hello within {} s", bounds.hello.as_secs_f64());
            Err(Refusal { id: None, op: None, error: ErrorBody::new(ErrorCode::BadRequest, message) })
        }
    };
    let (verdict, answer) = oneshot::channel();
    if hub.send(FromClient::First { session, message: first, verdict }).await.is_err() {
        return Ended::ByServer;
    }
    let Ok(Some(encoding)) = answer.await else { return Ended::ByServer };
    splitter.set_encoding(encoding);

    let mut pace = Pace::new(bounds.requests_per_s);
    loop {
        let (message, lost) = match next(&mut half, &mut splitter, &mut piece).await {
            Next::Message(message, lost) => (message, lost),
            Next::End(ended) => return ended,
        };
        pace.take(message.as_ref().map_or(1, |request| weight(&request.op))).await;
        if hub.send(FromClient::Message { session, message }).await.is_err() || lost {
            return Ended::ByServer;
        }
    }
}

enum Next {
    /// A message, and whether nothing after it can be read.
    Message(Result<Request, Refusal>, bool),
    End(Ended),
}

async fn next<S: AsyncRead>(half: &mut ReadHalf<S>, splitter: &mut Splitter, piece: &mut [u8]) -> Next {
    loop {
        let encoding = splitter.encoding();
        match splitter.next_message() {
            Some(Ok(message)) => return Next::Message(Request::read(encoding, message), false),
            Some(Err(error)) => {
                // A line or map too long is skipped to its end; JSON taken for a length of a gigabyte has none.
                let lost = error == hbot_api::FrameError::LooksLikeJson;
                return Next::Message(Err(error.into()), lost);
            }
            None => {}
        }
        match half.read(piece).await {
            Ok(0) => return Next::End(Ended::ByClient),
            Ok(n) => splitter.push(&piece[..n]),
            Err(_) => return Next::End(Ended::Broken),
        }
    }
}

/// How many ordinary requests' worth of the hub's time one takes.
fn weight(op: &Op) -> u32 {
    match op {
        Op::Info => 100,
        Op::LoadScene { .. } => 50,
        Op::Stats | Op::Set { .. } => 20,
        _ => 1,
    }
}

/// Bounds the rate of requests by not reading on: a bucket of a tenth of a second's worth.
struct Pace {
    per_s: f64,
    left: f64,
    at: Instant,
}

impl Pace {
    fn new(per_s: u32) -> Self {
        let per_s = f64::from(per_s.max(1));
        Self { per_s, left: 0.1 * per_s, at: Instant::now() }
    }

    async fn take(&mut self, weight: u32) {
        let now = Instant::now();
        let gained = now.duration_since(self.at).as_secs_f64() * self.per_s;
        self.at = now;
        self.left = (self.left + gained).min(0.1 * self.per_s) - f64::from(weight);
        if self.left < 0.0 {
            sleep(Duration::from_secs_f64(-self.left / self.per_s)).await;
        }
    }
}

/// Messages from the hub to the client, until the hub lets go. Fails where the connection is broken, or has taken no byte
/// for so long that it counts as such.
async fn write<S: AsyncWrite>(mut half: WriteHalf<S>, mut inbox: Inbox, stuck: Duration) -> io::Result<()> {
    let mut batch = Vec::with_capacity(BATCH_BYTES);
    while let Some(frame) = inbox.next().await {
        batch.clear();
        batch.extend_from_slice(&frame);
        while batch.len() < BATCH_BYTES {
            let Some(frame) = inbox.try_next() else { break };
            batch.extend_from_slice(&frame);
        }
        let mut rest = &batch[..];
        while !rest.is_empty() {
            let written = timeout(stuck, half.write(rest)).await.map_err(|_| io::ErrorKind::TimedOut)??;
            if written == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            rest = &rest[written..];
        }
        // What encryption has taken and the socket has not yet.
        timeout(stuck, half.flush()).await.map_err(|_| io::ErrorKind::TimedOut)??;
    }
    Ok(())
}
