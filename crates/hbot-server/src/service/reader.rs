//! From a client's socket to the hub: bytes to requests, no more of them than the hub has time for.
//!
//! Stops are looked for in the bytes as they come, before they are split or parsed, and an `estop` stops the loop right there. The
//! connection goes on to read while requests wait for their time, up to [`READ_AHEAD`] bytes, so that a stop behind them is found.

use std::future::{Future as _, poll_fn};
use std::pin::pin;
use std::task::Poll;
use std::time::Duration;

use hbot_api::{
    Encoding, ErrorBody, ErrorCode, MAX_REQUEST_BYTES, MAX_SHORT_REQUEST_BYTES, Op, Request, RequestRefusal,
    SplitError, Splitter, Stop, StopFinder, asks_estop,
};
use hbot_core::inputs::Command;
use tokio::io::{AsyncRead, AsyncReadExt as _, ReadHalf};
use tokio::task::yield_now;
use tokio::time::{Instant, sleep_until, timeout_at};

use super::Bounds;
use super::bucket::{Bucket, weight, weight_of};
use super::desk::Desk;
use super::hub::First;
use hbot_host::bridge::EmergencyStop;

/// Ordinary requests of one client before others have their turn; of those that take longer one.
const REQUESTS_A_TURN: u32 = 16;
/// Room for so many bytes that come at once.
pub(super) const PIECE_BYTES: usize = 16 * 1024;
/// Bytes read that count as one of these: a full piece ends the turn.
const BYTES_A_REQUEST: usize = PIECE_BYTES / REQUESTS_A_TURN as usize;
/// Bytes that are read while requests before them wait for their time.
pub(super) const READ_AHEAD: usize = 256 * 1024;

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    ByClient,
    ByServer,
    Broken,
}

/// Takes in what a client says.
pub(super) struct Reader<S> {
    half: ReadHalf<S>,
    splitter: Splitter,
    session: u64,
    desk: Desk,
    /// Until when it must have said hello; `None` once it has.
    hello: Option<(Instant, Duration)>,
    wrong_token: Duration,
    bucket: Bucket,
    /// What it has taken of the hub's time since the bucket was last charged.
    taken: u32,
    /// The same since others had their turn.
    turn: u32,
    /// A message that takes long to read, until its time comes.
    long: Option<Vec<u8>>,
    stops: StopFinder,
    stop: EmergencyStop,
    /// Bytes read so far, and the end of the last stop among them.
    read: u64,
    stop_at: u64,
    /// The client will say no more.
    closed: bool,
}

/// What comes before the next turn.
#[derive(Debug)]
pub(super) enum Pause {
    /// More bytes.
    Read,
    /// The turns of others.
    Yield,
    /// The time at which a long message may be read.
    Until(Instant),
    /// The answer to a wrong token.
    Refuse(RequestRefusal),
}

impl<S: AsyncRead> Reader<S> {
    pub(super) fn new(
        half: ReadHalf<S>,
        deadline: Instant,
        session: u64,
        desk: Desk,
        bounds: &Bounds,
    ) -> Self {
        let stop = desk.hub().emergency_stop();
        Self {
            half,
            splitter: Splitter::with_limit(Encoding::Json, MAX_SHORT_REQUEST_BYTES),
            session,
            desk,
            hello: Some((deadline, bounds.hello)),
            wrong_token: bounds.wrong_token,
            bucket: Bucket::new(bounds.requests_per_s, Instant::now()),
            taken: 0,
            turn: 0,
            long: None,
            stops: StopFinder::default(),
            stop,
            read: 0,
            stop_at: 0,
            closed: false,
        }
    }

    /// Has the hub do what has been read: what comes before there can be more, or how the connection ends.
    pub(super) fn turn(&mut self) -> Result<Pause, Ended> {
        if self.long.is_some() {
            return self.read_long();
        }
        while self.turn < REQUESTS_A_TURN {
            let before = self.splitter.pending();
            let encoding = self.splitter.encoding();
            // A stop that was found in the bytes, and obeyed then.
            let mut found = false;
            let (request, lost) = match self.splitter.next_message() {
                None => {
                    // Blank lines, and what is left of messages too long.
                    let skipped = before - self.splitter.pending();
                    self.charge(weight_of(skipped));
                    return if self.closed { Err(Ended::ByClient) } else { Ok(Pause::Read) };
                }
                Some(Ok(line)) if self.hello.is_some() => (Request::read_first(line), false),
                Some(Ok(message)) if is_short(encoding, message) || asks_estop(message) => {
                    let request = Request::read(encoding, message);
                    found = is_estop(&request) && asks_estop(message);
                    (request, false)
                }
                Some(Ok(message)) => {
                    let allowed = self.desk.hub().may_send(self.session, message);
                    match allowed {
                        Ok(()) => {
                            self.long = Some(message.to_vec());
                            self.charge(weight_of(before - self.splitter.pending()));
                            return self.read_long();
                        }
                        Err(error) => (Err(RequestRefusal { id: None, op: None, error }), false),
                    }
                }
                // A line or map too long is skipped to its end; JSON taken for a length of a gigabyte has none.
                Some(Err(error)) => (Err(error.into()), error == SplitError::LooksLikeJson),
            };
            if self.hello.is_some() {
                match self.first(request)? {
                    None => continue,
                    Some(refused) => return Ok(refused),
                }
            }
            let bytes = before - self.splitter.pending();
            self.charge(weight(request.as_ref().ok().map(|request| request.op.name()), bytes));
            let request = request.and_then(|request| self.unless_stopped(request));
            let goes_on = match request {
                Ok(Request { id, .. }) if found => self.desk.stopped(self.session, id),
                request => self.desk.message(self.session, request),
            };
            if !goes_on || lost {
                return Err(Ended::ByServer);
            }
        }
        Ok(Pause::Yield)
    }

    /// Has the hub do what a long message asks, once it is time for one.
    fn read_long(&mut self) -> Result<Pause, Ended> {
        let start = Instant::now();
        if let Some(at) = self.desk.hub().long_messages().not_before(start) {
            return Ok(Pause::Until(at));
        }
        let Some(message) = self.long.take() else { return Ok(Pause::Yield) };
        let request = Request::read(self.splitter.encoding(), &message);
        self.charge(weight(request.as_ref().ok().map(|request| request.op.name()), 0));
        let goes_on = self.desk.message(self.session, request);
        self.desk.hub().long_messages().took(start, Instant::now());
        if goes_on { Ok(Pause::Yield) } else { Err(Ended::ByServer) }
    }

    fn charge(&mut self, weight: u32) {
        self.taken = self.taken.saturating_add(weight);
        self.turn = self.turn.saturating_add(weight);
    }

    /// Refuses what would give the motors torque again if a stop of the same client came after it.
    fn unless_stopped(&self, request: Request) -> Result<Request, RequestRefusal> {
        let done = self.read - self.splitter.pending() as u64;
        if done >= self.stop_at || !request.op.name().row().rearms {
            return Ok(request);
        }
        let op = request.op.name();
        let message = format!("op {op}: a stop of the same client came after it");
        Err(RequestRefusal {
            id: request.id,
            op: Some(op),
            error: ErrorBody::new(ErrorCode::Faulted, message),
        })
    }

    /// The first message, hello or not, decides whether there will be others, and in which encoding.
    fn first(&mut self, message: Result<Request, RequestRefusal>) -> Result<Option<Pause>, Ended> {
        match self.desk.first(self.session, message) {
            First::Greeted(encoding) => {
                self.splitter.set_encoding(encoding);
                self.splitter.set_limit(MAX_REQUEST_BYTES);
                self.hello = None;
                // What has come with the hello.
                self.look(self.splitter.pending());
                Ok(None)
            }
            First::WrongToken(refusal) => Ok(Some(Pause::Refuse(refusal))),
            First::Refused => Err(Ended::ByServer),
        }
    }

    /// Waits until there may be another turn: first a client that asks too fast. Reads ahead meanwhile.
    pub(super) async fn wait(&mut self, pause: Pause) -> Result<(), Ended> {
        let now = Instant::now();
        if let Some(time) = self.bucket.take(std::mem::take(&mut self.taken), now) {
            self.read_until(now + time).await?;
        }
        match pause {
            Pause::Read => match self.hello {
                None => self.read().await,
                Some((deadline, time)) => match timeout_at(deadline, self.read()).await {
                    Ok(read) => read,
                    Err(_) => {
                        let message = format!("no hello within {} s", time.as_secs_f64());
                        let error = ErrorBody::new(ErrorCode::BadRequest, message);
                        self.first(Err(RequestRefusal { id: None, op: None, error })).map(drop)
                    }
                },
            },
            Pause::Yield => {
                self.read_what_is_there().await?;
                self.let_others().await;
                Ok(())
            }
            Pause::Until(at) => self.read_until(at).await,
            Pause::Refuse(refusal) => {
                sleep_until(Instant::now() + self.wrong_token).await;
                self.desk.refuse_first(self.session, refusal);
                Err(Ended::ByServer)
            }
        }
    }

    async fn let_others(&mut self) {
        yield_now().await;
        self.turn = 0;
    }

    /// Reads on until `at`, as far as that is allowed.
    async fn read_until(&mut self, at: Instant) -> Result<(), Ended> {
        let mut time = pin!(sleep_until(at));
        while self.has_room() {
            tokio::select! {
                biased;
                () = &mut time => {
                    self.turn = 0;
                    return Ok(());
                }
                read = self.read() => read?,
            }
            if self.turn >= REQUESTS_A_TURN {
                self.let_others().await;
            }
        }
        time.await;
        self.turn = 0;
        Ok(())
    }

    /// Whether another piece may be read before what waits is done. A stranger's is not.
    fn has_room(&self) -> bool {
        self.hello.is_none() && !self.closed && self.splitter.pending() + PIECE_BYTES <= READ_AHEAD
    }

    /// Bytes that may be read at once.
    fn piece(&self) -> usize {
        if self.hello.is_some() { MAX_SHORT_REQUEST_BYTES } else { PIECE_BYTES }
    }

    /// Waits for bytes. Others have their turn meanwhile. Cancel safe.
    async fn read(&mut self) -> Result<(), Ended> {
        let (before, piece) = (self.splitter.pending(), self.piece());
        let mut half = (&mut self.half).take(piece as u64);
        let mut waited = false;
        let read = {
            let mut read = pin!(half.read_buf(self.splitter.space(piece)));
            poll_fn(|context| {
                let polled = read.as_mut().poll(context);
                waited |= polled.is_pending();
                polled
            })
            .await
        };
        if waited {
            self.turn = 0;
        }
        self.came(before, read)
    }

    /// Reads a piece that has come already.
    async fn read_what_is_there(&mut self) -> Result<(), Ended> {
        if !self.has_room() {
            return Ok(());
        }
        let (before, piece) = (self.splitter.pending(), self.piece());
        let mut half = (&mut self.half).take(piece as u64);
        let read = {
            let mut read = pin!(half.read_buf(self.splitter.space(piece)));
            poll_fn(|context| Poll::Ready(read.as_mut().poll(context))).await
        };
        match read {
            Poll::Ready(read) => self.came(before, read),
            Poll::Pending => Ok(()),
        }
    }

    /// Takes note of bytes that have come behind those that were waiting `before`.
    fn came(&mut self, before: usize, read: std::io::Result<usize>) -> Result<(), Ended> {
        match read {
            // What it has asked for is still done.
            Ok(0) => self.closed = true,
            Ok(bytes) => {
                self.read += bytes as u64;
                self.turn =
                    self.turn.saturating_add(u32::try_from(bytes / BYTES_A_REQUEST).unwrap_or(u32::MAX));
                if self.hello.is_none() {
                    self.look(self.splitter.pending() - before);
                }
            }
            Err(_) => return Err(Ended::Broken),
        }
        Ok(())
    }

    /// Looks for stops in the last bytes that have come, and obeys them before anything else. They are answered in their turn.
    fn look(&mut self, bytes: usize) {
        let waiting = self.splitter.waiting();
        let first = waiting.len() - bytes;
        let (mut estop, mut disable) = (None, None);
        self.stops.push(&waiting[first..], |stop, end| match stop {
            Stop::Estop => estop = Some(end),
            Stop::Disable => disable = Some(end),
        });
        let Some(last) = estop.max(disable) else { return };
        if estop.is_some() {
            self.stop.stop();
            self.desk.hub().stopped_by(self.session);
        }
        // One that no other request waits before is done in a moment anyway.
        if disable.is_some_and(|end| first + end > MAX_SHORT_REQUEST_BYTES) {
            self.desk.turn(|hub| hub.order_internally("disable", Command::Disable));
        }
        self.stop_at = self.read - bytes as u64 + last as u64;
    }
}

fn is_estop(request: &Result<Request, RequestRefusal>) -> bool {
    matches!(request, Ok(Request { op: Op::Estop, .. }))
}

/// Whether a message, without its newline or length, is no longer than ordinary ones may be.
fn is_short(encoding: Encoding, message: &[u8]) -> bool {
    message.len() + usize::from(encoding == Encoding::Json) <= MAX_SHORT_REQUEST_BYTES
}
