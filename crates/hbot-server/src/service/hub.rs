//! What clients share, in one place: the hub connects the parts that each own a piece of it. Whoever has something for it to do comes
//! to its `desk`.
//!
//! | part | what it owns |
//! |---|---|
//! | [`Publisher`] | clients, their subscriptions, what is on its way to them |
//! | [`Lease`] | which client may command |
//! | [`Orders`] | orders on their way to the loop, and who waits for the answers |
//! | [`Scenes`] | the scene that runs, and those on their way to the loop |
//! | [`Incidents`] | faults and stops as samples show them |
//! | [`Flights`] | flight logs |
//! | [`Stats`] | histograms and counters |

mod greeting;
mod requests;
mod samples;

use std::sync::Arc;

use hbot_api::{
    Encoding, ErrorBody, ErrorCode, Event, Id, LeaseCause, OpName, RequestRefusal, Response, StatsOk,
    StoppingEvent,
};
use hbot_config::RigConfig;
use hbot_core::inputs::{Command, OnClientLost};
use serde::Serialize;
use tokio::sync::{Notify, watch};
use tokio::time::Instant;

use super::bucket::LongMessages;
use super::flights::Flights;
use super::incidents::Incidents;
use super::info::Info;
use super::lease::Lease;
use super::orders::{Asker, Orders};
use super::peer::Peer;
use super::publisher::Publisher;
use super::scenes::Scenes;
use super::stats::Stats;
use super::strangers::WrongTokens;
use super::{Bounds, ServiceSetup, Status};
use crate::tls::Encryption;
use hbot_host::bridge::{Bell, EmergencyStop, ServiceEnd};
use hbot_host::sample::Sample;

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

/// What became of the first message of a connection.
#[derive(Debug, PartialEq)]
pub(super) enum First {
    /// It goes on, in this encoding.
    Greeted(Encoding),
    /// It has been answered, and nothing more will be.
    Refused,
    /// It is to be answered so, but not at once: who guesses a token shall wait.
    WrongToken(RequestRefusal),
}

/// What clients share.
pub(super) struct Hub {
    bounds: Bounds,
    rig: RigConfig,
    token: Option<String>,
    encryption: Option<Encryption>,
    /// The way to the loop.
    end: ServiceEnd,
    info: Info,
    stats: Stats,
    publisher: Publisher,
    lease: Lease,
    orders: Orders,
    scenes: Scenes,
    incidents: Incidents,
    flights: Flights,
    latest: Option<Sample>,
    /// When the next message that takes long may be read.
    long_messages: LongMessages,
    wrong_tokens: WrongTokens,
    /// Connections taken so far.
    sessions: u64,
    status: watch::Sender<Status>,
    /// Notified when what the service's task waits for has changed: works on other threads have begun, or others watch.
    changed: Arc<Notify>,
}

impl Hub {
    pub(super) fn new(
        bounds: Bounds,
        end: ServiceEnd,
        setup: ServiceSetup,
        status: watch::Sender<Status>,
    ) -> Self {
        let ServiceSetup { rig, scene, phenomena, token, encryption, flight_dir, accuracy } = setup;
        let changed = Arc::new(Notify::new());
        let simulated = phenomena.is_some();
        Self {
            bounds,
            token,
            encryption,
            end,
            info: Info::new(&rig, &accuracy, simulated),
            stats: Stats::new(),
            publisher: Publisher::new(Arc::clone(&changed)),
            lease: Lease::default(),
            orders: Orders::default(),
            scenes: Scenes::new(scene, phenomena, rig.rig, Arc::clone(&changed)),
            incidents: Incidents::new(rig.rig),
            flights: Flights::new(flight_dir, rig.rig.timing.period_ns, Arc::clone(&changed)),
            latest: None,
            long_messages: LongMessages::default(),
            wrong_tokens: WrongTokens::default(),
            sessions: 0,
            status,
            changed,
            rig,
        }
    }
}

/// What the service's task and the connections ask.
impl Hub {
    pub(super) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    pub(super) fn encryption(&self) -> Option<&Encryption> {
        self.encryption.as_ref()
    }

    /// Notified when what the service's task waits for has changed.
    pub(super) fn changed(&self) -> Arc<Notify> {
        Arc::clone(&self.changed)
    }

    pub(super) fn bell(&self) -> Bell {
        self.end.bell()
    }

    pub(super) fn emergency_stop(&self) -> EmergencyStop {
        self.end.emergency_stop()
    }

    /// Whether there are samples to be taken.
    pub(super) fn has_samples(&self) -> bool {
        self.end.has_samples()
    }

    /// Whether the loop has ended and all samples are taken.
    pub(super) fn is_over(&self) -> bool {
        self.end.is_over()
    }

    /// Whether anybody wants states as they come. Where nobody does, samples wait until something notable happens.
    pub(super) fn is_watched(&self) -> bool {
        self.publisher.is_watched()
    }

    pub(super) fn long_messages(&mut self) -> &mut LongMessages {
        &mut self.long_messages
    }

    /// Clients that have not said hello.
    pub(super) fn strangers(&self) -> usize {
        self.publisher.strangers()
    }

    /// The number of one more connection.
    pub(super) fn next_session(&mut self) -> u64 {
        self.stats.counts.connections += 1;
        self.sessions += 1;
        self.sessions
    }

    /// Takes in the client of a connection.
    pub(super) fn admit(&mut self, session: u64, peer: Peer) {
        self.publisher.admit(session, peer);
    }

    /// Counts a connection for which there was no place.
    pub(super) fn turned_away(&mut self) {
        self.stats.counts.connections_turned_away += 1;
    }

    /// Counts a refusal.
    pub(super) fn refused(&mut self, code: ErrorCode) {
        self.stats.counts.refused.add(code);
    }

    /// Lets go of the connection that has waited longest to be told of its wrong token, so that its place is another's. False if
    /// there is none.
    pub(super) fn cut_a_guess(&mut self) -> bool {
        self.publisher.cut_a_guess()
    }

    /// How the run goes until now.
    pub(super) fn summary(&mut self) -> StatsOk {
        self.drain();
        self.stats.summary(&self.flights)
    }

    /// How the run went, with the flight logs that have been written since [`farewell`](Self::farewell).
    pub(super) fn last_summary(&self, flights: &Flights) -> StatsOk {
        self.stats.summary(flights)
    }

    /// Looks at what nobody else brings up.
    pub(super) fn heartbeat(&mut self) {
        let now = Instant::now();
        self.publisher.tell_losses(now);
        self.wrong_tokens.tell(now);
        self.status.send_modify(|status| status.sample = self.latest);
    }

    pub(super) fn tell_status(&self) {
        self.status.send_modify(|status| {
            status.sample = self.latest;
            status.clients = self.publisher.listeners();
            status.holder = self.lease.name().map(str::to_owned);
            self.scenes.file().name().clone_into(&mut status.scene);
        });
    }

    /// Cuts the connections of those who do not read. Each may set off events that doom others.
    pub(super) fn bury(&mut self) {
        while let Some(session) = self.publisher.cut_next() {
            self.stats.counts.connections_cut += 1;
            self.gone(session);
        }
    }

    /// A connection has ended, or its client says no more.
    pub(super) fn leave(&mut self, session: u64, why: Gone) {
        match why {
            Gone::Ended => {}
            Gone::Stuck => {
                self.stats.counts.connections_cut += 1;
                tracing::warn!(session, "cut: the client has read nothing for {:?}", self.bounds.stuck);
            }
            Gone::NoHandshake => {
                self.stats.counts.handshakes_failed += 1;
                tracing::debug!(session, "no encrypted connection came about");
            }
        }
        self.gone(session);
    }

    /// The client says no more. It stays as long as answers are owed to it.
    pub(super) fn gone(&mut self, session: u64) {
        if !self.publisher.gone(session) {
            return;
        }
        if self.lease.is_held_by(session) {
            let policy = self.rig.api.on_client_lost;
            self.order_internally("client lost", Command::ClientLost(policy));
            self.lease.free(session);
            self.lease_changed(LeaseCause::Disconnected);
        }
        self.tell_status();
    }

    /// Says goodbye. Connections end once all that waits for their clients has been sent. Returns the flight logs in the making.
    pub(super) fn farewell(&mut self, why: &str) -> Flights {
        self.publisher.broadcast(&Event::Stopping(StoppingEvent { message: why.to_owned() }));
        self.publisher.dismiss_all();
        std::mem::take(&mut self.flights)
    }
}

/// What requests have in common.
impl Hub {
    /// Sends a client's order to the loop; the answer comes with a sample.
    fn order(&mut self, session: u64, id: Option<Id>, op: OpName, command: Command) -> Result<(), ErrorBody> {
        self.orders.place(&mut self.end, session, id, op, command).map_err(|_| {
            ErrorBody::new(
                ErrorCode::Busy,
                format!("op {op}: the loop has not yet taken what it was given before"),
            )
        })?;
        self.publisher.owe(session);
        Ok(())
    }

    pub(super) fn order_internally(&mut self, what: &'static str, command: Command) {
        self.orders.insist(&mut self.end, Asker::Service(what), command);
    }

    /// Tells all that the lease has changed hands.
    fn lease_changed(&mut self, cause: LeaseCause) {
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
        tracing::info!(holder = self.lease.name().unwrap_or("nobody"), ?cause, "lease");
        self.publisher.broadcast(&Event::Lease(self.lease.event(cause)));
        self.tell_status();
    }

    /// Sends an answer.
    fn respond(&mut self, session: u64, response: &Response) {
        if let Err(error) = &response.result {
            self.stats.counts.refused.add(error.code);
        }
        self.publisher.send(session, response);
    }

    /// Answers a request with a body.
    fn answer(&mut self, session: u64, id: Option<Id>, body: impl Serialize) {
        let answer = Response::ok(id, body);
        if let Err(error) = self.publisher.try_send(session, &answer) {
            let error = ErrorBody::new(ErrorCode::OutOfRange, format!("no answer: {error}"));
            self.respond(session, &Response::error(answer.id, error));
        }
    }

    /// Refuses a request: with an answer, or for a stream message without an id in a count.
    fn refuse(&mut self, session: u64, id: Option<Id>, op: Option<OpName>, error: ErrorBody) {
        let stream = op.is_some_and(|op| op.row().stream);
        self.stats.counts.refused_streams += u64::from(stream);
        if !stream || id.is_some() {
            self.respond(session, &Response::error(id, error));
            return;
        }
        self.stats.counts.refused.add(error.code);
        self.publisher.refuse_stream(session, op, error);
    }
}
