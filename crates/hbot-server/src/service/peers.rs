//! Clients come, are told things, and go.

use std::net::SocketAddr;

use hbot_api::{ErrorBody, ErrorCode, Event, LeaseCause, LeaseEvent, Response};
use hbot_core::inputs::{Command, OnClientLost};
use tokio::net::TcpStream;
use tokio::task::JoinError;

use super::connection;
use super::convert;
use super::hub::Hub;
use super::outbox::outbox;
use super::peer::{Peer, frame};

impl Hub {
    /// Takes a connection in, or turns it away.
    pub(super) fn accept(&mut self, stream: TcpStream, address: SocketAddr) {
        // Tasks rather than clients: one that has been refused may still be on its way out.
        let there = self.connections.len();
        if there >= self.bounds.connections {
            self.stats.events.turned_away += 1;
            tracing::warn!(%address, "turned away: {there} connections already");
            // Those who come even faster get no answer at all, and neither do those who would have to decrypt it.
            if self.setup.encryption.is_none() && self.turned_away.len() < self.bounds.connections {
                let message = format!("{there} connections already; try again later");
                let error = ErrorBody::new(ErrorCode::Busy, message);
                self.turned_away.spawn(connection::turn_away(stream, error));
            }
            return;
        }
        // Without it a small answer may wait for the acknowledgement of the one before; a connection works all the same.
        let _ = stream.set_nodelay(true);
        // Nor without this, but then it lasts for ever where the client's machine or the cable is gone.
        if let Err(error) = connection::watch_over(&stream) {
            tracing::debug!(%address, %error, "no keepalive");
        }
        let session = self.next_session;
        self.next_session += 1;
        self.stats.events.connections += 1;
        tracing::debug!(session, %address, "connected");
        let (outbox, inbox) = outbox(self.bounds.outgoing);
        let task = self.connections.spawn(connection::serve(
            stream,
            self.setup.encryption.clone(),
            session,
            self.to_hub.clone(),
            inbox,
            self.bounds,
        ));
        self.tasks.insert(task.id(), session);
        self.peers.insert(session, Peer::new(outbox, task));
    }

    /// A connection's task has ended. What it had to say came before, unless it was cut or panicked.
    pub(super) fn ended(&mut self, ended: Option<Result<(tokio::task::Id, ()), JoinError>>) {
        let id = match &ended {
            Some(Ok((id, ()))) => *id,
            Some(Err(error)) => error.id(),
            None => return,
        };
        let Some(session) = self.tasks.remove(&id) else { return };
        if let Some(Err(error)) = ended
            && error.is_panic()
        {
            tracing::error!(session, "the task of a connection has panicked");
            self.gone(session);
        }
    }

    /// The client says no more. It stays as long as answers are owed to it.
    pub(super) fn gone(&mut self, session: u64) {
        let Some(peer) = self.peers.get_mut(&session) else { return };
        let again = std::mem::replace(&mut peer.gone, true);
        let name = peer.name.clone();
        peer.every = 0;
        if peer.owed == 0 {
            self.peers.remove(&session);
        }
        if again {
            return;
        }
        self.count_subscribers();
        if let Some(name) = &name {
            tracing::info!(session, name, "disconnected");
        }
        if self.holder == Some(session) {
            let policy = convert::client_lost(self.setup.rig.api.on_client_lost);
            self.order_internally("client lost", Command::ClientLost(policy));
            self.lease(None, LeaseCause::Disconnected);
        }
        self.tell_status();
    }

    /// An answer that was owed has been given.
    pub(super) fn paid(&mut self, session: u64) {
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.owed = peer.owed.saturating_sub(1);
            if peer.gone && peer.owed == 0 {
                self.peers.remove(&session);
            }
        }
    }

    /// Gives the lease to a session, or to nobody, and tells all.
    pub(super) fn lease(&mut self, holder: Option<u64>, cause: LeaseCause) {
        if cause == LeaseCause::Stolen {
            // The loser's stream must not go on beneath the new holder's.
            self.order_internally("lease stolen", Command::ClientLost(OnClientLost::Ramp));
        }
        self.holder = holder;
        let name = self.holder_name();
        tracing::info!(holder = name.as_deref().unwrap_or("nobody"), ?cause, "lease");
        self.broadcast(&Event::Lease(LeaseEvent { holder: name, session: holder, cause }));
        self.tell_status();
    }

    pub(super) fn holder_name(&self) -> Option<String> {
        self.holder.and_then(|session| self.peers.get(&session)?.name.clone())
    }

    /// Sends an answer.
    pub(super) fn respond(&mut self, session: u64, response: &Response) {
        if let Err(error) = &response.result {
            self.stats.refused(error.code);
        }
        let Some(peer) = self.peers.get(&session) else { return };
        if !peer.send(response, &mut self.scratch) {
            self.doomed.push(session);
        }
    }

    /// Sends an event to one client.
    pub(super) fn tell(&mut self, session: u64, event: &Event) {
        let Some(peer) = self.peers.get(&session) else { return };
        if !peer.send(event, &mut self.scratch) {
            self.doomed.push(session);
        }
    }

    /// Sends an event to all who have said hello.
    pub(super) fn broadcast(&mut self, event: &Event) {
        let mut frames = [None, None];
        for (session, peer) in self.peers.iter().filter(|(_, peer)| peer.listens()) {
            let slot = &mut frames[peer.encoding as usize];
            let made = slot.get_or_insert_with(|| frame(peer.encoding, event, &mut self.scratch));
            if made.as_ref().is_some_and(|frame| !peer.outbox.send(frame.clone())) {
                self.doomed.push(*session);
            }
        }
    }

    /// Cuts the connections of those who do not read. Each may set off events that doom others.
    pub(super) fn bury(&mut self) {
        while let Some(session) = self.doomed.pop() {
            let Some(peer) = self.peers.get_mut(&session) else { continue };
            if peer.outbox.is_closed() {
                // It has ended by itself and is about to say so.
                continue;
            }
            self.stats.events.cut += 1;
            tracing::warn!(session, name = peer.name.as_deref(), "cut: the client does not read");
            peer.task.abort();
            peer.owed = 0;
            self.gone(session);
        }
    }
}
