//! Reads a client's requests from its socket and passes them to the hub, limited to the rate that
//! the client may use.
//!
//! Stops are searched for in the bytes as they arrive, before they are split or parsed. An `estop`
//! stops the loop at that moment. While requests wait because of the rate limit, the connection
//! reads ahead up to [`READ_AHEAD`] bytes, so that a stop behind them is found.

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
use tokio::time::{Instant, sleep_until};

use super::Bounds;
use super::bucket::{Bucket, weight, weight_of};
use super::hub::First;
use super::orders::Own;
use super::shared_hub::SharedHub;
use hbot_host::run_loop::bridge::EmergencyStop;

/// Total weight of the requests that one client's task executes before other tasks get a turn. A
/// request heavier than this ends the turn by itself.
const REQUESTS_A_TURN: u32 = 16;
/// Largest number of bytes that are read from a socket at once.
pub(super) const PIECE_BYTES: usize = 16 * 1024;
/// Number of bytes read that count as one request in a turn. A full read of [`PIECE_BYTES`] ends
/// the turn.
const BYTES_A_REQUEST: usize = PIECE_BYTES / REQUESTS_A_TURN as usize;
/// Number of waiting bytes that hold few requests.
const NEXT_BYTES: usize = 128;
/// Largest number of bytes that a connection reads ahead while earlier requests wait for the rate
/// limit.
pub(super) const READ_AHEAD: usize = 256 * 1024;

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    ByClient,
    ByServer,
    Broken,
}

/// Reads the messages of one client from its socket, splits them, and passes them to the hub.
pub(super) struct Reader<S> {
    half: ReadHalf<S>,
    splitter: Splitter,
    session: u64,
    hub: SharedHub,
    /// The deadline for the client's hello, and the time that the client had for it. `None` after
    /// the hello.
    hello: Option<(Instant, Duration)>,
    wrong_token: Duration,
    bucket: Bucket,
    /// Total weight of the requests since the token bucket was last charged.
    taken: u32,
    /// Total weight of the requests since other tasks last had a turn.
    turn: u32,
    /// A request that takes long to parse and waits for the time when it may be parsed.
    long: Option<Vec<u8>>,
    stops: StopFinder,
    stop: EmergencyStop,
    /// Number of bytes read from the client so far.
    read: u64,
    /// Position after the last stop request in the bytes read so far.
    stop_at: u64,
    /// True if the client has closed its sending direction.
    closed: bool,
}

/// What a reader waits for before its next turn.
#[derive(Debug)]
pub(super) enum Pause {
    /// The reader waits for more bytes from the client.
    Read,
    /// The reader gives other tasks a turn.
    Yield,
    /// The reader waits until this time, from which a long message can be parsed.
    Until(Instant),
    /// The reader delays this refusal of a wrong token.
    Refuse(RequestRefusal),
}

impl<S: AsyncRead> Reader<S> {
    pub(super) fn new(
        half: ReadHalf<S>,
        deadline: Instant,
        session: u64,
        hub: SharedHub,
        bounds: &Bounds,
    ) -> Self {
        let stop = hub.lock().emergency_stop();
        Self {
            half,
            splitter: Splitter::with_limit(Encoding::Json, MAX_SHORT_REQUEST_BYTES),
            session,
            hub,
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

    /// Passes the messages that have been read to the hub. Returns what to wait for before the next
    /// turn, or how the connection ended.
    pub(super) fn turn(&mut self) -> Result<Pause, Ended> {
        if self.long.is_some() {
            return self.read_long();
        }
        while self.turn < REQUESTS_A_TURN {
            let before = self.splitter.pending();
            let encoding = self.splitter.encoding();
            // Whether this message is an `estop` that was already obeyed when its bytes arrived.
            let mut found = false;
            let (request, lost) = match self.splitter.next_message() {
                None => {
                    // Charge for blank lines and for the remains of messages that were too long.
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
                    let allowed = self.hub.lock().may_send(self.session, message);
                    match allowed {
                        Ok(()) => {
                            self.long = Some(message.to_vec());
                            self.charge(weight_of(before - self.splitter.pending()));
                            return self.read_long();
                        }
                        Err(error) => (Err(RequestRefusal { id: None, op: None, error }), false),
                    }
                }
                // A line or map that is too long is skipped to its end. JSON bytes that were read
                // as a length of about a gigabyte have no end, so that connection is closed.
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
                Ok(Request { id, .. }) if found => self.hub.stopped(self.session, id),
                request => self.hub.message(self.session, request),
            };
            if !goes_on || lost {
                return Err(Ended::ByServer);
            }
        }
        Ok(Pause::Yield)
    }

    /// Parses the waiting long message and passes it to the hub, if long messages may be parsed
    /// now. Otherwise returns the time to wait for.
    fn read_long(&mut self) -> Result<Pause, Ended> {
        let start = Instant::now();
        if let Some(at) = self.hub.lock().long_messages().not_before(start) {
            return Ok(Pause::Until(at));
        }
        let Some(message) = self.long.take() else { return Ok(Pause::Yield) };
        let request = Request::read(self.splitter.encoding(), &message);
        self.charge(weight(request.as_ref().ok().map(|request| request.op.name()), 0));
        let goes_on = self.hub.message(self.session, request);
        self.hub.lock().long_messages().took(start, Instant::now());
        if goes_on { Ok(Pause::Yield) } else { Err(Ended::ByServer) }
    }

    fn charge(&mut self, weight: u32) {
        self.taken = self.taken.saturating_add(weight);
        self.turn = self.turn.saturating_add(weight);
    }

    /// Refuses a request that would let the motors produce torque again, if a stop by this client
    /// came after it.
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

    /// Handles the first message of a connection, which decides whether the connection continues
    /// and in which encoding.
    fn first(&mut self, message: Result<Request, RequestRefusal>) -> Result<Option<Pause>, Ended> {
        match self.hub.first(self.session, message) {
            First::Greeted(encoding) => {
                self.splitter.set_encoding(encoding);
                self.splitter.set_limit(MAX_REQUEST_BYTES);
                self.hello = None;
                // Search for stops in the bytes that arrived together with the hello.
                self.look(self.splitter.pending());
                Ok(None)
            }
            First::WrongToken(refusal) => Ok(Some(Pause::Refuse(refusal))),
            First::Refused => Err(Ended::ByServer),
        }
    }

    /// Waits until the next turn, longer if the client has exceeded its request rate. Reads ahead
    /// meanwhile.
    pub(super) async fn wait(&mut self, pause: Pause) -> Result<(), Ended> {
        let now = Instant::now();
        if let Some(time) = self.bucket.take(std::mem::take(&mut self.taken), now) {
            let before = self.read;
            self.read_until(now + time).await?;
            if self.read > before && matches!(pause, Pause::Read) {
                return Ok(());
            }
        }
        match pause {
            Pause::Read => match self.hello {
                None => self.read().await,
                // The deadline comes first, since there is always something to read from a flood.
                Some((deadline, time)) => tokio::select! {
                    biased;
                    () = sleep_until(deadline) => {
                        let message = format!("no hello within {} s", time.as_secs_f64());
                        let error = ErrorBody::new(ErrorCode::BadRequest, message);
                        self.first(Err(RequestRefusal { id: None, op: None, error })).map(drop)
                    }
                    read = self.read() => read,
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
                self.hub.refuse_first(self.session, refusal);
                Err(Ended::ByServer)
            }
        }
    }

    async fn let_others(&mut self) {
        yield_now().await;
        self.turn = 0;
    }

    /// Waits until `at`. Reads ahead meanwhile, as far as the limit allows.
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

    /// Returns whether another piece can be read ahead. Nothing is read ahead before the hello.
    fn has_room(&self) -> bool {
        self.hello.is_none() && !self.closed && self.splitter.pending() + PIECE_BYTES <= READ_AHEAD
    }

    /// Returns the largest number of bytes that can be read at once.
    fn piece(&self) -> usize {
        if self.hello.is_some() { MAX_SHORT_REQUEST_BYTES } else { PIECE_BYTES }
    }

    /// Waits for bytes from the client and reads them. Other tasks run meanwhile. Cancel safe.
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

    /// Reads bytes that have already arrived, without waiting.
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

    /// Handles the result of a read. `before` is the number of bytes that waited to be processed
    /// before the read.
    fn came(&mut self, before: usize, read: std::io::Result<usize>) -> Result<(), Ended> {
        match read {
            // The requests that have arrived are still executed.
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

    /// Searches for stops (`estop` or `disable`) in the last `bytes` bytes that have arrived, and
    /// carries them out at once. Their answers are sent in the usual order.
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
            self.hub.lock().stopped_by(self.session);
        }
        // A `disable` before which hardly anything waits is executed in a moment anyway.
        if disable.is_some_and(|end| first + end > NEXT_BYTES) {
            self.hub.turn(|hub| hub.order_internally(Own::Disable, Command::Disable));
        }
        self.stop_at = self.read - bytes as u64 + last as u64;
    }
}

fn is_estop(request: &Result<Request, RequestRefusal>) -> bool {
    matches!(request, Ok(Request { op: Op::Estop, .. }))
}

/// Returns whether a message is as short as an ordinary request must be. `message` is without its
/// newline or length prefix.
fn is_short(encoding: Encoding, message: &[u8]) -> bool {
    message.len() + usize::from(encoding == Encoding::Json) <= MAX_SHORT_REQUEST_BYTES
}
