//! Sends answers, events and subscribed states to clients.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::Arc;

use hbot_api::{Encoding, ErrorBody, Event, MessageEncodeError, OpName, Requester, StateEvent};
use serde::Serialize;
use tokio::sync::Notify;
use tokio::time::Instant;

use super::convert;
use super::peer::{Frames, Peer, ServicePort};
use crate::recording::Notes;
use hbot_host::run_loop::sample::Sample;

/// All connected clients, and the messages to them.
pub(super) struct Publisher {
    peers: BTreeMap<u64, Peer>,
    /// Number of clients that are subscribed to states.
    subscribers: usize,
    /// A state event whose memory is reused for each sample, so that a sample allocates memory only
    /// for its messages.
    state: Event,
    frames: Frames,
    /// Whether the last stream message that the loop has accepted is that of an earlier holder of
    /// the lease. States do not report it.
    foreign_stream: bool,
    /// Clients that must be disconnected, because their queue had no room for a message.
    unresponsive: Vec<u64>,
    /// Wakes the service's task when the number of subscribers may have changed.
    changed: Arc<Notify>,
    /// Passes events to the recorder.
    notes: Notes,
}

/// Stores the state of `sample` in `event`, without its stream message if that is `foreign`. `hand`
/// returns the torque of the simulated hand, N m, if there is one.
fn fill(event: &mut StateEvent, sample: &Sample, foreign: bool, hand: impl Fn() -> Option<[f64; 3]>) {
    convert::fill(event, sample);
    event.hand = hand();
    if foreign {
        event.client = None;
    }
}

impl Publisher {
    pub(super) fn new(changed: Arc<Notify>, notes: Notes) -> Self {
        Self {
            peers: BTreeMap::new(),
            subscribers: 0,
            state: Event::State(StateEvent::default()),
            frames: Frames::default(),
            foreign_stream: false,
            unresponsive: Vec::new(),
            changed,
            notes,
        }
    }

    /// Adds a client that has not sent its hello yet.
    pub(super) fn admit(&mut self, session: u64, peer: Peer) {
        self.peers.insert(session, peer);
    }

    /// Records the name and encoding of a client that has sent its hello. Returns false if the
    /// client is not known.
    pub(super) fn greet(&mut self, session: u64, name: String, encoding: Encoding) -> bool {
        let Some(peer) = self.peers.get_mut(&session) else { return false };
        peer.encoding = encoding;
        peer.name = Some(name);
        true
    }

    /// Removes a client that has not sent its hello. Its connection ends after its queued messages
    /// are sent.
    pub(super) fn dismiss(&mut self, session: u64) {
        self.peers.remove(&session);
    }

    /// Removes all clients. Their connections end after their queued messages are sent.
    pub(super) fn dismiss_all(&mut self) {
        self.peers.clear();
    }

    /// Records that a client has sent a wrong token. Returns the client's address.
    pub(super) fn sent_wrong_token(&mut self, session: u64) -> Option<IpAddr> {
        let peer = self.peers.get_mut(&session)?;
        peer.sent_wrong_token = true;
        Some(peer.address)
    }

    /// Closes the connection to `port` that has waited longest for the refusal of its wrong token,
    /// and returns its session. Returns `None` if there is no such connection.
    pub(super) fn close_wrong_token(&mut self, port: ServicePort) -> Option<u64> {
        let mut guesses = self.peers.iter().filter(|(_, peer)| peer.sent_wrong_token && peer.port == port);
        let session = guesses.next().map(|(session, _)| *session)?;
        self.peers.remove(&session)?.task.abort();
        Some(session)
    }

    pub(super) fn knows(&self, session: u64) -> bool {
        self.peers.contains_key(&session)
    }

    /// Returns the name that a client gave in its hello.
    pub(super) fn name(&self, session: u64) -> Option<&str> {
        self.peers.get(&session)?.name.as_deref()
    }

    /// Returns a client as events name it. `None` if it is not known or has not sent its hello.
    pub(super) fn requester(&self, session: u64) -> Option<Requester> {
        self.name(session).map(|name| Requester { name: name.to_owned(), session: Some(session) })
    }

    /// Returns the encoding that a client has asked for in its hello. JSON before that.
    pub(super) fn encoding(&self, session: u64) -> Encoding {
        self.peers.get(&session).map_or(Encoding::Json, |peer| peer.encoding)
    }

    /// Returns the number of clients connected to `port` that have not sent their hello yet.
    pub(super) fn unauthenticated(&self, port: ServicePort) -> usize {
        self.peers.values().filter(|peer| peer.name.is_none() && peer.port == port).count()
    }

    /// Returns the number of connected clients that have sent their hello.
    pub(super) fn listeners(&self) -> usize {
        self.peers.values().filter(|peer| peer.listens()).count()
    }

    /// Subscribes a client to one state every `every` ticks. 0 ends the subscription.
    pub(super) fn subscribe(&mut self, session: u64, every: u64) {
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.every = every;
        }
        self.count_subscribers();
    }

    fn count_subscribers(&mut self) {
        self.subscribers = self.peers.values().filter(|peer| peer.every != 0).count();
        self.changed.notify_one();
    }

    /// Returns whether any client is subscribed to states.
    pub(super) fn is_watched(&self) -> bool {
        self.subscribers > 0
    }

    /// Records whether the last stream message that the loop has accepted is that of an earlier
    /// holder of the lease, and so stays out of all states.
    pub(super) fn stream_is_foreign(&mut self, is: bool) {
        self.foreign_stream = is;
    }

    /// Sends a state to the clients that are subscribed to this tick. `hand` returns the torque of
    /// the simulated hand, N m, if there is one. Returns how many clients did not get the state
    /// because they read too slowly.
    pub(super) fn publish(&mut self, sample: &Sample, hand: impl Fn() -> Option<[f64; 3]>) -> u64 {
        let (mut filled, mut dropped) = (false, 0);
        let Self { peers, state, frames, foreign_stream, .. } = self;
        frames.clear();
        for peer in peers.values_mut().filter(|peer| peer.wants(sample.state.tick)) {
            if !peer.outbox.takes_samples() {
                peer.drop_state();
                dropped += 1;
                continue;
            }
            if !filled {
                filled = true;
                if let Event::State(event) = state {
                    fill(event, sample, *foreign_stream, &hand);
                }
            }
            if let Some(event) = peer.dropped_event() {
                // This cannot fail: the queue has room for samples, so it has room for this event.
                let _ = peer.send(&event);
            }
            // This fails only if the connection has just broken, which its task will report.
            let _ = peer.outbox.send(frames.of(peer.encoding, state));
        }
        dropped
    }

    /// Returns the state of `sample`, as [`publish`](Self::publish) sends it.
    pub(super) fn state(&self, sample: &Sample, hand: impl Fn() -> Option<[f64; 3]>) -> StateEvent {
        let mut event = StateEvent::default();
        fill(&mut event, sample, self.foreign_stream, hand);
        event
    }

    /// Sends a message to one client. If there is no room for the message, the client will be
    /// disconnected.
    pub(super) fn send(&mut self, session: u64, message: &impl Serialize) {
        let Some(peer) = self.peers.get(&session) else { return };
        if !peer.send(message) {
            self.unresponsive.push(session);
        }
    }

    /// Sends a message to one client. If there is no room for the message, the client will be
    /// disconnected.
    ///
    /// # Errors
    /// Fails if the message holds a number that is not finite. The message is not sent then.
    pub(super) fn try_send(
        &mut self,
        session: u64,
        message: &impl Serialize,
    ) -> Result<(), MessageEncodeError> {
        let Some(peer) = self.peers.get(&session) else { return Ok(()) };
        if !peer.try_send(message)? {
            self.unresponsive.push(session);
        }
        Ok(())
    }

    /// Sends an event to all clients that have sent their hello, and to the recorder.
    pub(super) fn broadcast(&mut self, event: &Event) {
        self.notes.event(event);
        self.frames.clear();
        for (session, peer) in self.peers.iter().filter(|(_, peer)| peer.listens()) {
            if !peer.outbox.send(self.frames.of(peer.encoding, event)) {
                self.unresponsive.push(*session);
            }
        }
    }

    /// Counts a stream message that is refused without an answer, and notifies its client at most
    /// once a second.
    pub(super) fn refuse_stream(&mut self, session: u64, op: Option<OpName>, error: ErrorBody) {
        let Some(peer) = self.peers.get_mut(&session) else { return };
        peer.refuse(op, error);
        if let Some(event) = peer.refused_event(Instant::now()) {
            self.send(session, &event);
        }
    }

    /// Notifies each client of its dropped states and refused stream messages since the last such
    /// notice.
    pub(super) fn tell_losses(&mut self, now: Instant) {
        let mut events = Vec::new();
        for (session, peer) in self.peers.iter_mut().filter(|(_, peer)| peer.listens()) {
            events.extend(peer.dropped_event().map(|event| (*session, event)));
            events.extend(peer.refused_event(now).map(|event| (*session, event)));
        }
        for (session, event) in events {
            self.send(session, &event);
        }
    }

    /// Records that an answer to a client is pending. The client stays known until
    /// [`answered`](Self::answered).
    pub(super) fn expect_answer(&mut self, session: u64) {
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.pending += 1;
        }
    }

    /// Records that a pending answer to a client has been given. Removes the client if it has gone
    /// and no further answer is pending.
    pub(super) fn answered(&mut self, session: u64) {
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.pending = peer.pending.saturating_sub(1);
            if peer.gone && peer.pending == 0 {
                self.peers.remove(&session);
            }
        }
    }

    /// Records that a client sends no more. It stays known while answers to it are pending. Returns
    /// false if this was already recorded.
    pub(super) fn gone(&mut self, session: u64) -> bool {
        let Some(peer) = self.peers.get_mut(&session) else { return false };
        let again = std::mem::replace(&mut peer.gone, true);
        let name = peer.name.clone().filter(|_| !again);
        peer.every = 0;
        if peer.pending == 0 {
            self.peers.remove(&session);
        }
        if again {
            return false;
        }
        self.count_subscribers();
        if let Some(name) = &name {
            tracing::info!(session, name, "disconnected");
        }
        true
    }

    /// Closes the next connection whose client does not read, and returns its session. The caller
    /// must still record that the client is gone.
    pub(super) fn cut_next(&mut self) -> Option<u64> {
        while let Some(session) = self.unresponsive.pop() {
            let Some(peer) = self.peers.get_mut(&session) else { continue };
            if peer.outbox.is_closed() {
                // The connection has ended by itself, and its task is about to report that.
                continue;
            }
            tracing::warn!(session, name = peer.name.as_deref(), "cut: the client does not read");
            peer.task.abort();
            peer.pending = 0;
            return Some(session);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;
    use std::task::{Context, Waker};

    use hbot_api::{Response, ServerMessage, StoppingEvent};

    use super::super::outbox::{Inbox, outbox};
    use super::*;

    fn publisher() -> Publisher {
        Publisher::new(Arc::default(), Notes::default())
    }

    /// Adds a client whose queue has room for `messages` messages. Returns the connection's end of
    /// this queue.
    fn admit(publisher: &mut Publisher, session: u64, messages: usize) -> Inbox {
        let (out, inbox) = outbox(messages);
        publisher.admit(
            session,
            Peer::new(out, tokio::spawn(async {}).abort_handle(), Ipv4Addr::LOCALHOST.into()),
        );
        inbox
    }

    #[tokio::test]
    async fn a_client_stays_until_it_has_its_pending_answer() {
        let mut publisher = publisher();
        let _inboxes = [admit(&mut publisher, 1, 8), admit(&mut publisher, 2, 8)];
        publisher.expect_answer(1);
        assert!(publisher.gone(1) && publisher.knows(1));
        assert!(!publisher.gone(1), "once");
        publisher.answered(1);
        assert!(!publisher.knows(1) && publisher.knows(2));
        publisher.answered(2);
        assert!(publisher.knows(2), "it is still there");
    }

    #[tokio::test]
    async fn states_go_to_those_who_want_this_tick() {
        let mut publisher = publisher();
        let (mut first, _second) = (admit(&mut publisher, 1, 8), admit(&mut publisher, 2, 2));
        assert!(!publisher.is_watched());
        publisher.subscribe(1, 2);
        publisher.subscribe(2, 1);
        assert!(publisher.is_watched());
        // The second client has room for two messages and reads none.
        let dropped: Vec<u64> =
            (1..=3).map(|tick| publisher.publish(&crate::still::still(tick), || None)).collect();
        assert_eq!(dropped, [0, 0, 1]);
        publisher.subscribe(2, 0);
        assert_eq!(publisher.publish(&crate::still::still(4), || None), 0);
        let mut sent = Vec::new();
        assert!(first.poll_take(&Context::from_waker(Waker::noop()), &mut sent).is_ready());
        let states =
            sent.split_inclusive(|byte| *byte == b'\n').map(|line| ServerMessage::read(Encoding::Json, line));
        let ticks: Vec<_> = states
            .map(|state| match state {
                Ok(ServerMessage::Event(Event::State(state))) => state.tick,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(ticks, [2, 4]);
        publisher.gone(1);
        assert!(!publisher.is_watched());
    }

    #[tokio::test]
    async fn only_those_who_have_said_hello_hear_events_and_those_who_do_not_read_are_cut() {
        let mut publisher = publisher();
        let _inboxes = [admit(&mut publisher, 1, 1), admit(&mut publisher, 2, 1)];
        assert!(publisher.greet(1, "ann".to_owned(), Encoding::Json));
        assert_eq!(
            (publisher.unauthenticated(ServicePort::Tcp), publisher.listeners(), publisher.name(1)),
            (1, 1, Some("ann"))
        );
        let event = Event::Stopping(StoppingEvent { message: "x".to_owned() });
        publisher.broadcast(&event);
        assert_eq!(publisher.cut_next(), None);
        publisher.broadcast(&event);
        assert_eq!((publisher.cut_next(), publisher.cut_next()), (Some(1), None));
        publisher.send(2, &Response::done(None));
        assert_eq!(publisher.cut_next(), None, "nothing was sent to it before");
    }
}
