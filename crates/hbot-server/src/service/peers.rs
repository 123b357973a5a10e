//! Clients are told things, and go.

use hbot_api::{Event, LeaseCause, LeaseEvent, Response};
use hbot_core::inputs::{Command, OnClientLost};

use super::convert;
use super::hub::Hub;

impl Hub {
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
        // The stream of who loses the lease must not go on under the next holder, or under nobody.
        match cause {
            LeaseCause::Stolen => {
                self.order_internally("lease stolen", Command::ClientLost(OnClientLost::Ramp));
            }
            LeaseCause::Released => {
                self.order_internally("lease released", Command::ClientLost(OnClientLost::Ramp));
            }
            // What the rig file says has been ordered already.
            LeaseCause::Acquired | LeaseCause::Disconnected => {}
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
        if !peer.send(response) {
            self.doomed.push(session);
        }
    }

    /// Sends an event to one client.
    pub(super) fn tell(&mut self, session: u64, event: &Event) {
        let Some(peer) = self.peers.get(&session) else { return };
        if !peer.send(event) {
            self.doomed.push(session);
        }
    }

    /// Sends an event to all who have said hello.
    pub(super) fn broadcast(&mut self, event: &Event) {
        self.frames.clear();
        for (session, peer) in self.peers.iter().filter(|(_, peer)| peer.listens()) {
            if !peer.outbox.send(self.frames.of(peer.encoding, event)) {
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
            self.stats.counts.connections_cut += 1;
            tracing::warn!(session, name = peer.name.as_deref(), "cut: the client does not read");
            peer.task.abort();
            peer.owed = 0;
            self.gone(session);
        }
    }
}
