//! One connection: bytes to requests, messages to bytes. What they mean is the hub's to say.

use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use rustix::net::sockopt;

use hbot_api::{Encoding, ErrorBody, ErrorCode, Op, Refusal, Request, Response, Splitter};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, ReadHalf, WriteHalf, split};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, oneshot};
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

/// The way to the hub.
#[derive(Clone)]
pub(super) struct ToHub {
    pub(super) queue: mpsc::Sender<FromClient>,
    /// Bytes of requests that may be there between their being read and their being done. What a request becomes when it is read takes a
    /// hundred times its bytes and more where it is made for that.
    pub(super) room: Arc<Semaphore>,
}

/// The place of a request among those that wait, until it is dropped; `None` for what was refused unread.
pub(super) type Place = Option<OwnedSemaphorePermit>;

/// A client of which nothing has been heard for so long is asked so often whether it is there.
const KEEP_IDLE: Duration = Duration::from_secs(5);
const KEEP_EVERY: Duration = Duration::from_secs(1);
const KEEP_TIMES: u32 = 5;

/// What a connection tells the hub.
pub(super) enum FromClient {
    /// The first message, hello or not. What comes back decides whether there will be others, and in which encoding.
    First {
        session: u64,
        message: Result<Request, Refusal>,
        place: Place,
        verdict: oneshot::Sender<Option<Encoding>>,
    },
    /// A later message.
    Message { session: u64, message: Result<Request, Refusal>, place: Place },
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
    hub: ToHub,
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
            let _ = hub.queue.send(FromClient::Gone { session, why: Gone::NoHandshake }).await;
        }
    }
}

/// The same once bytes are what they mean: who has not said hello by `deadline` is sent away.
async fn converse<S: AsyncRead + AsyncWrite + Unpin>(
    mut stream: S,
    deadline: Instant,
    session: u64,
    hub: ToHub,
    inbox: Inbox,
    bounds: Bounds,
) {
    let stuck = |error: &io::Error| error.kind() == io::ErrorKind::TimedOut;
    let ended = {
        let (reader, writer) = split(&mut stream);
        let mut reading = pin!(read(reader, deadline, session, &hub, &bounds));
        let mut writing = pin!(write(writer, inbox, bounds.stuck));
        // The hub outlives its connections; where it does not, nobody is left to be told.
        tokio::select! {
            ended = &mut reading => {
                let _ = hub.queue.send(FromClient::Gone { session, why: Gone::Ended }).await;
                // What has been asked for is answered, even to a client that has closed its own direction.
                let written = writing.await;
                if written.as_ref().is_err_and(stuck) {
                    let _ = hub.queue.send(FromClient::Gone { session, why: Gone::Stuck }).await;
                }
                if written.is_ok() { ended } else { Ended::Broken }
            }
            written = &mut writing => {
                let why = if written.as_ref().is_err_and(stuck) { Gone::Stuck } else { Gone::Ended };
                let _ = hub.queue.send(FromClient::Gone { session, why }).await;
                if written.is_ok() { Ended::ByServer } else { Ended::Broken }
            }
        }
    };
    if ended == Ended::ByServer {
        linger(&mut stream).await;
    }
}

/// Has the system look whether the other machine is still there, so that one that has vanished without a word is missed after ten
/// seconds: its place, its lease and what is to happen without it wait for no more than that.
pub(super) fn watch_over(stream: &TcpStream) -> rustix::io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, KEEP_IDLE)?;
    sockopt::set_tcp_keepintvl(stream, KEEP_EVERY)?;
    sockopt::set_tcp_keepcnt(stream, KEEP_TIMES)?;
    // Where something is on its way, that is what is not acknowledged.
    let all = KEEP_IDLE + KEEP_EVERY * KEEP_TIMES;
    sockopt::set_tcp_user_timeout(stream, u32::try_from(all.as_millis()).unwrap_or(u32::MAX))
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
    hub: &ToHub,
    bounds: &Bounds,
) -> Ended {
    let mut splitter = Splitter::new(Encoding::Json);
    let mut piece = vec![0; PIECE_BYTES];
    let first = timeout_at(deadline, next(&mut half, &mut splitter, &mut piece, &hub.room)).await;
    let (message, place) = match first {
        Ok(Next::Message { message, place, .. }) => (message, place),
        Ok(Next::End(ended)) => return ended,
        Err(_) => {
            let message = format!("no hello within {} s", bounds.hello.as_secs_f64());
            let error = ErrorBody::new(ErrorCode::BadRequest, message);
            (Err(Refusal { id: None, op: None, error }), None)
        }
    };
    let (verdict, answer) = oneshot::channel();
    if hub.queue.send(FromClient::First { session, message, place, verdict }).await.is_err() {
        return Ended::ByServer;
    }
    let Ok(Some(encoding)) = answer.await else { return Ended::ByServer };
    splitter.set_encoding(encoding);

    let mut pace = Pace::new(bounds.requests_per_s);
    loop {
        let (message, place, lost) = match next(&mut half, &mut splitter, &mut piece, &hub.room).await {
            Next::Message { message, place, lost } => (message, place, lost),
            Next::End(ended) => return ended,
        };
        let weight = message.as_ref().map_or(1, |request| weight(&request.op));
        if hub.queue.send(FromClient::Message { session, message, place }).await.is_err() || lost {
            return Ended::ByServer;
        }
        // Who waits holds no place.
        pace.take(weight).await;
    }
}

enum Next {
    /// A message with its place, and whether nothing after it can be read.
    Message {
        message: Result<Request, Refusal>,
        place: Place,
        lost: bool,
    },
    End(Ended),
}

async fn next<S: AsyncRead>(
    half: &mut ReadHalf<S>,
    splitter: &mut Splitter,
    piece: &mut [u8],
    room: &Arc<Semaphore>,
) -> Next {
    loop {
        let encoding = splitter.encoding();
        match splitter.next_message() {
            Some(Ok(bytes)) => {
                // At most MAX_REQUEST_BYTES. The semaphore is never closed.
                let wanted = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
                let place = Arc::clone(room).acquire_many_owned(wanted).await.ok();
                return Next::Message { message: Request::read(encoding, bytes), place, lost: false };
            }
            Some(Err(error)) => {
                // A line or map too long is skipped to its end; JSON taken for a length of a gigabyte has none.
                let lost = error == hbot_api::FrameError::LooksLikeJson;
                return Next::Message { message: Err(error.into()), place: None, lost };
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
        // The lease is told to all.
        Op::Stats | Op::Set { .. } | Op::Acquire { .. } | Op::Release => 20,
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

#[cfg(test)]
mod tests {
    use tokio::io::{DuplexStream, duplex};

    use super::super::outbox::{Outbox, outbox};
    use super::*;

    const ROOM: usize = 4 * hbot_api::MAX_REQUEST_BYTES;

    /// A connection whose other end and hub are the test's; hello has been said.
    async fn greeted(
        session: u64,
        hub: &ToHub,
        from: &mut mpsc::Receiver<FromClient>,
    ) -> (DuplexStream, Outbox) {
        let (mut client, server) = duplex(128 * 1024);
        let (out, inbox) = outbox(8);
        let bounds = Bounds { stuck: Duration::from_millis(50), ..Bounds::default() };
        let deadline = Instant::now() + Duration::from_secs(600);
        tokio::spawn(converse(server, deadline, session, hub.clone(), inbox, bounds));
        client.write_all(b"{\"op\": \"hello\", \"version\": 1, \"name\": \"x\"}\n").await.unwrap();
        let Some(FromClient::First { verdict, .. }) = from.recv().await else { panic!("no hello") };
        verdict.send(Some(Encoding::Msgpack)).unwrap();
        (client, out)
    }

    /// A request that takes 200 times its bytes once it is read.
    fn swelling() -> Vec<u8> {
        let mut map = b"\x82\xa2op\xa4ping\xa4data\xdc\x50\x00".to_vec();
        map.extend(b"\x81\xa0\x00".repeat(0x5000));
        let mut frame = u32::try_from(map.len()).unwrap().to_be_bytes().to_vec();
        frame.extend(map);
        frame
    }

    #[test]
    fn requests_that_swell_are_not_all_read_at_once() {
        const CLIENTS: u64 = 24;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let used = allocation_counter::measure(|| {
            runtime.block_on(async {
                let (queue, mut from) = mpsc::channel(256);
                let hub = ToHub { queue, room: Arc::new(Semaphore::new(ROOM)) };
                let mut clients = Vec::new();
                for session in 0..CLIENTS {
                    clients.push(greeted(session, &hub, &mut from).await);
                }
                for (client, _) in &mut clients {
                    client.write_all(&swelling()).await.unwrap();
                }
                // The hub is busy elsewhere; connections read what they may.
                for _ in 0..10_000 {
                    tokio::task::yield_now().await;
                }
                for _ in 0..CLIENTS {
                    let Some(FromClient::Message { message, place, .. }) = from.recv().await else {
                        panic!("a request is missing")
                    };
                    assert!(message.is_ok() && place.is_some());
                }
                assert_eq!(hub.room.available_permits(), ROOM, "every place has been given back");
            });
        });
        // Four of the largest, some 10 MB each, against 24; and the pipes of the test.
        assert!(used.bytes_max < 100 << 20, "{} MiB", used.bytes_max >> 20);
    }

    #[tokio::test]
    async fn one_that_says_no_more_and_reads_no_more_is_counted_as_cut() {
        let (queue, mut from) = mpsc::channel(256);
        let hub = ToHub { queue, room: Arc::new(Semaphore::new(ROOM)) };
        let (mut client, out) = greeted(7, &hub, &mut from).await;
        // More than the pipe takes.
        assert!(out.send(vec![0; 500_000].into()));
        client.shutdown().await.unwrap();
        let mut why = Vec::new();
        while why.last() != Some(&Gone::Stuck) {
            match timeout(Duration::from_secs(30), from.recv()).await.ok().flatten() {
                Some(FromClient::Gone { session: 7, why: gone }) => why.push(gone),
                _ => panic!("{why:?}"),
            }
        }
        assert_eq!(why, [Gone::Ended, Gone::Stuck]);
        drop((client, out));
    }
}
