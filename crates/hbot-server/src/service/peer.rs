//! One client, as the hub knows it.

use std::net::IpAddr;
use std::time::Duration;

use hbot_api::{DroppedEvent, Encoding, ErrorBody, Event, MessageEncodeError, OpName, RefusedEvent};
use serde::Serialize;
use tokio::task::AbortHandle;
use tokio::time::Instant;

use super::outbox::Outbox;

/// Minimum time between two `refused` events to one client.
const REFUSED_EVERY: Duration = Duration::from_secs(1);

/// A port at which clients connect. Each has its own places for connections, so that one cannot be
/// shut by connections to the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ServicePort {
    /// Messages over TCP.
    Tcp,
    /// The page, and messages over WebSocket.
    Web,
}

/// The state of one client, as the hub keeps it.
pub(super) struct Peer {
    /// The name that the client gave in its hello. `None` before the hello.
    pub(super) name: Option<String>,
    /// The IP address of the client.
    pub(super) address: IpAddr,
    pub(super) port: ServicePort,
    /// True if the client has sent a wrong token and its refusal is being delayed.
    pub(super) sent_wrong_token: bool,
    pub(super) encoding: Encoding,
    pub(super) outbox: Outbox,
    pub(super) task: AbortHandle,
    /// Number of ticks between two states sent to the client. 0 if it is not subscribed.
    pub(super) every: u64,
    /// Number of answers that are pending from the loop or from other threads.
    pub(super) pending: u32,
    /// True if the client sends no more. It stays known only until its pending answers are sent.
    pub(super) gone: bool,
    dropped: Tally,
    refused: Tally,
    last_refused: Option<Refused>,
    refused_told: Option<Instant>,
}

/// The last refused stream message that has not been reported to the client.
struct Refused {
    op: Option<OpName>,
    error: ErrorBody,
}

/// The number of events of one kind, such as lost states: since the last report to the client, and
/// in total.
#[derive(Default)]
struct Tally {
    untold: u64,
    total: u64,
}

impl Tally {
    fn add(&mut self) {
        self.untold += 1;
        self.total += 1;
    }
}

impl Peer {
    pub(super) fn new(outbox: Outbox, task: AbortHandle, address: IpAddr) -> Self {
        Self {
            name: None,
            address,
            port: ServicePort::Tcp,
            sent_wrong_token: false,
            encoding: Encoding::Json,
            outbox,
            task,
            every: 0,
            pending: 0,
            gone: false,
            dropped: Tally::default(),
            refused: Tally::default(),
            last_refused: None,
            refused_told: None,
        }
    }

    /// Returns the client as one that has connected to `port`.
    pub(super) fn at(self, port: ServicePort) -> Self {
        Self { port, ..self }
    }

    /// Returns whether the client has sent its hello and is still connected.
    pub(super) fn listens(&self) -> bool {
        self.name.is_some() && !self.gone
    }

    pub(super) fn wants(&self, tick: u64) -> bool {
        self.every != 0 && tick.is_multiple_of(self.every)
    }

    /// Counts a state that is not sent to the client, because the client reads too slowly.
    pub(super) fn drop_state(&mut self) {
        self.dropped.add();
    }

    /// Returns the event that reports lost states, if states were lost and the queue has room
    /// again.
    pub(super) fn dropped_event(&mut self) -> Option<Event> {
        if self.dropped.untold == 0 || !self.outbox.takes_samples() {
            return None;
        }
        let count = std::mem::take(&mut self.dropped.untold);
        Some(Event::Dropped(DroppedEvent { count, total: self.dropped.total }))
    }

    /// Records a refused stream message, which the next `refused` event reports to the client.
    pub(super) fn refuse(&mut self, op: Option<OpName>, error: ErrorBody) {
        self.refused.add();
        self.last_refused = Some(Refused { op, error });
    }

    /// Returns the event that reports refused stream messages. Returns `None` if there were none,
    /// or if the last such event is less than one second old.
    pub(super) fn refused_event(&mut self, now: Instant) -> Option<Event> {
        if self.refused_told.is_some_and(|told| now < told + REFUSED_EVERY) {
            return None;
        }
        let Refused { op, error } = self.last_refused.take()?;
        self.refused_told = Some(now);
        Some(Event::Refused(RefusedEvent {
            count: std::mem::take(&mut self.refused.untold),
            total: self.refused.total,
            op: op.map(|op| op.to_string()),
            code: error.code,
            message: error.message,
        }))
    }

    /// Queues a message in this client's encoding. Returns `Ok(false)` if the queue has no room or
    /// the connection is gone.
    ///
    /// # Errors
    /// Fails if the message holds a number that is not finite. Nothing is queued then.
    pub(super) fn try_send(&self, message: &impl Serialize) -> Result<bool, MessageEncodeError> {
        self.outbox.send_with(|out| self.encoding.encode(message, out))
    }

    /// Queues a message in this client's encoding. Returns false if the queue has no room. A
    /// message that cannot be encoded is logged and skipped.
    #[must_use]
    pub(super) fn send(&self, message: &impl Serialize) -> bool {
        // A message that cannot be encoded is no reason to end the connection.
        self.try_send(message).inspect_err(unsaid).unwrap_or(true)
    }
}

/// One message for many clients, encoded at most once in each encoding. Its memory is reused for
/// the next message.
#[derive(Default)]
pub(super) struct Frames {
    bytes: [Vec<u8>; Encoding::ALL.len()],
    made: [bool; Encoding::ALL.len()],
}

impl Frames {
    /// Discards the encoded message, so that another one can be encoded.
    pub(super) fn clear(&mut self) {
        self.made = [false; Encoding::ALL.len()];
    }

    /// Returns the encoded message. It is empty if the message contains a number that is not
    /// finite.
    pub(super) fn of(&mut self, encoding: Encoding, message: &impl Serialize) -> &[u8] {
        let (bytes, made) = (&mut self.bytes[encoding as usize], &mut self.made[encoding as usize]);
        if !std::mem::replace(made, true) {
            bytes.clear();
            // A failed encoding leaves no bytes behind.
            let _ = encoding.encode(message, bytes).inspect_err(unsaid);
        }
        bytes
    }
}

fn unsaid(error: &MessageEncodeError) {
    tracing::debug!(%error, "a message was not sent");
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;
    use std::task::{Context, Poll, Waker};

    use hbot_api::ErrorCode;

    use super::super::outbox::outbox;
    use super::*;

    #[tokio::test]
    async fn refusals_are_told_at_most_once_a_second() {
        let (out, _inbox) = outbox(8);
        let mut peer = Peer::new(out, tokio::spawn(async {}).abort_handle(), Ipv4Addr::LOCALHOST.into());
        let error = || ErrorBody::new(ErrorCode::NotHolder, "no");
        let counts = |event: Option<Event>| match event {
            Some(Event::Refused(refused)) => Some((refused.count, refused.total)),
            _ => None,
        };
        let start = Instant::now();
        assert_eq!(counts(peer.refused_event(start)), None, "nothing to tell");
        peer.refuse(Some(OpName::Torque), error());
        assert_eq!(counts(peer.refused_event(start)), Some((1, 1)));
        peer.refuse(Some(OpName::Torque), error());
        peer.refuse(Some(OpName::Torque), error());
        assert_eq!(counts(peer.refused_event(start + REFUSED_EVERY / 2)), None);
        assert_eq!(counts(peer.refused_event(start + REFUSED_EVERY)), Some((2, 3)));
        assert_eq!(counts(peer.refused_event(start + 2 * REFUSED_EVERY)), None, "told already");
    }

    #[tokio::test]
    async fn lost_states_are_told_once_the_client_reads_again() {
        let (out, mut inbox) = outbox(4);
        let mut sent = || {
            while inbox.poll_take(&Context::from_waker(Waker::noop()), &mut Vec::new()) == Poll::Ready(true) {
            }
        };
        let mut peer = Peer::new(out, tokio::spawn(async {}).abort_handle(), Ipv4Addr::LOCALHOST.into());
        while peer.outbox.takes_samples() {
            assert!(peer.outbox.send(&[0]));
        }
        peer.drop_state();
        peer.drop_state();
        assert_eq!(peer.dropped_event(), None);
        sent();
        let told = Event::Dropped(DroppedEvent { count: 2, total: 2 });
        assert_eq!(peer.dropped_event(), Some(told));
        assert_eq!(peer.dropped_event(), None);
    }
}
