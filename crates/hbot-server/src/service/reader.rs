//! From a client's socket to the hub: bytes to requests, no more of them than the hub has time for.

use std::time::Duration;

use hbot_api::{Encoding, ErrorBody, ErrorCode, FrameError, Op, Refusal, Request, Splitter};
use tokio::io::{AsyncRead, AsyncReadExt as _, ReadHalf};
use tokio::task::yield_now;
use tokio::time::{Instant, sleep, timeout_at};

use super::Bounds;
use super::connection::{Ended, PIECE_BYTES};
use super::desk::Desk;

/// Ordinary requests of one client before others have their turn; of those that take longer one.
const REQUESTS_A_TURN: u32 = 16;

/// Takes in what a client says.
pub(super) struct Reader<S> {
    half: ReadHalf<S>,
    splitter: Splitter,
    session: u64,
    desk: Desk,
    /// Until when it must have said hello; `None` once it has.
    hello: Option<(Instant, Duration)>,
    pace: Pace,
    /// What it has taken of the hub's time since it was last charged.
    taken: u32,
}

/// What comes before the next turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pause {
    /// More bytes.
    Read,
    /// The turns of others.
    Yield,
}

impl<S: AsyncRead> Reader<S> {
    pub(super) fn new(
        half: ReadHalf<S>,
        deadline: Instant,
        session: u64,
        desk: Desk,
        bounds: &Bounds,
    ) -> Self {
        Self {
            half,
            splitter: Splitter::new(Encoding::Json),
            session,
            desk,
            hello: Some((deadline, bounds.hello)),
            pace: Pace::new(bounds.requests_per_s, Instant::now()),
            taken: 0,
        }
    }

    /// Has the hub do what has been read: what comes before there can be more, or how the connection ends.
    pub(super) fn turn(&mut self) -> Result<Pause, Ended> {
        while self.taken < REQUESTS_A_TURN {
            let encoding = self.splitter.encoding();
            let (request, lost) = match self.splitter.next_message() {
                None => return Ok(Pause::Read),
                Some(Ok(bytes)) => (Request::read(encoding, bytes), false),
                // A line or map too long is skipped to its end; JSON taken for a length of a gigabyte has none.
                Some(Err(error)) => (Err(error.into()), error == FrameError::LooksLikeJson),
            };
            if self.hello.is_some() {
                self.first(request)?;
                continue;
            }
            self.taken += request.as_ref().map_or(1, |request| weight(&request.op));
            if !self.desk.message(self.session, request) || lost {
                return Err(Ended::ByServer);
            }
        }
        Ok(Pause::Yield)
    }

    /// The first message, hello or not, decides whether there will be others, and in which encoding.
    fn first(&mut self, message: Result<Request, Refusal>) -> Result<(), Ended> {
        let encoding = self.desk.first(self.session, message).ok_or(Ended::ByServer)?;
        self.splitter.set_encoding(encoding);
        self.hello = None;
        Ok(())
    }

    /// Waits until there may be another turn: first a client that asks too fast.
    pub(super) async fn wait(&mut self, pause: Pause) -> Result<(), Ended> {
        if let Some(time) = self.pace.take(std::mem::take(&mut self.taken), Instant::now()) {
            sleep(time).await;
        }
        match (pause, self.hello) {
            (Pause::Read, None) => self.read().await,
            (Pause::Read, Some((deadline, time))) => match timeout_at(deadline, self.read()).await {
                Ok(read) => read,
                Err(_) => {
                    let message = format!("no hello within {} s", time.as_secs_f64());
                    let error = ErrorBody::new(ErrorCode::BadRequest, message);
                    self.first(Err(Refusal { id: None, op: None, error }))
                }
            },
            (Pause::Yield, _) => {
                yield_now().await;
                Ok(())
            }
        }
    }

    async fn read(&mut self) -> Result<(), Ended> {
        match self.half.read_buf(self.splitter.space(PIECE_BYTES)).await {
            Ok(0) => Err(Ended::ByClient),
            Ok(_) => Ok(()),
            Err(_) => Err(Ended::Broken),
        }
    }
}

/// How many ordinary requests' worth of the hub's time one takes.
fn weight(op: &Op) -> u32 {
    match op {
        Op::Info => 500,
        Op::LoadScene { .. } => 250,
        // The lease is told to all.
        Op::Stats | Op::Set { .. } | Op::Acquire { .. } | Op::Release => 100,
        _ => 1,
    }
}

/// Bounds the rate of requests: a bucket of a tenth of a second's worth.
struct Pace {
    per_s: f64,
    left: f64,
    at: Instant,
}

impl Pace {
    fn new(per_s: u32, now: Instant) -> Self {
        let per_s = f64::from(per_s.max(1));
        Self { per_s, left: 0.1 * per_s, at: now }
    }

    /// Takes so much out: how long it takes until as much has come in, where it was not there.
    fn take(&mut self, weight: u32, now: Instant) -> Option<Duration> {
        let gained = now.duration_since(self.at).as_secs_f64() * self.per_s;
        self.at = now;
        self.left = (self.left + gained).min(0.1 * self.per_s) - f64::from(weight);
        (self.left < 0.0).then(|| Duration::from_secs_f64(-self.left / self.per_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_a_second_s_worth_comes_at_once_and_the_rest_in_time() {
        let start = Instant::now();
        let (mut pace, mut now) = (Pace::new(1000, start), start);
        let at_once = |pace: &mut Pace, now| (0..1000).take_while(|_| pace.take(1, now).is_none()).count();
        assert_eq!(at_once(&mut pace, now), 100);
        for weight in [1, 1, 50, 1, 100].repeat(20) {
            now += pace.take(weight, now).expect("the bucket is empty");
        }
        // The one that found it empty, and twenty times 153.
        assert!(((now - start).as_secs_f64() - 3.061).abs() < 1e-6, "{:?}", now - start);
        // However long it rests, no more than that is saved up.
        now += Duration::from_secs(60);
        assert_eq!(at_once(&mut pace, now), 100);
    }
}
