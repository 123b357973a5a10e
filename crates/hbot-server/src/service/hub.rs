//! Everything that clients share. The hub connects the following parts, and tasks use the hub
//! through a `SharedHub`.
//!
//! | part | what it owns |
//! |---|---|
//! | [`Publisher`] | clients, their subscriptions, messages that are queued for them |
//! | [`Lease`] | which client may command |
//! | [`Orders`] | orders to the loop that are not answered yet, and who asked for them |
//! | [`SceneHand`] | the simulated hand |
//! | [`Scenes`] | the running scene, and scenes that are being loaded |
//! | [`Models`] | which local models of clients the rig keeps stable |
//! | [`Incidents`] | faults and stops, as seen in samples |
//! | [`Flights`] | flight logs |
//! | [`Stats`] | histograms and counters |

mod greeting;
mod requests;
mod samples;

use std::sync::Arc;

use hbot_api::{
    Encoding, ErrorBody, ErrorCode, Event, Id, LeaseCause, OpName, RequestRefusal, Requester, Response,
    StatsOk, StoppingEvent,
};
use hbot_config::RigConfig;
use hbot_core::inputs::{Command, OnClientLost};
use serde::Serialize;
use tokio::sync::{Notify, watch};
use tokio::time::Instant;

use super::bucket::LongMessages;
use super::flights::Flights;
use super::hand::SceneHand;
use super::incidents::Incidents;
use super::info::{Clock, Info};
use super::lease::Lease;
use super::models::Models;
use super::orders::{Asker, Orders, Own};
use super::peer::{Peer, ServicePort};
use super::publisher::Publisher;
use super::scenes::Scenes;
use super::shakes::Shakes;
use super::stats::Stats;
use super::unauthenticated::WrongTokens;
use super::{Bounds, ServiceSetup, Status};
use crate::tls::Encryption;
use hbot_core::MAX_JOINTS;
use hbot_host::bus::Telemetry;
use hbot_host::rig::controllers::Controllers;
use hbot_host::run_loop::bridge::{Busy, EmergencyStop, ServiceEnd, Wakeup};
use hbot_host::run_loop::sample::Sample;

/// The reason why a connection has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gone {
    /// The client or the server has ended the connection.
    Ended,
    /// The server gave up the connection because the client did not read.
    Stuck,
    /// The TLS handshake failed or did not finish in time.
    NoHandshake,
}

/// How a connection continues after its first message.
#[derive(Debug, PartialEq)]
pub(super) enum First {
    /// The hello was accepted. The connection continues in this encoding.
    Greeted(Encoding),
    /// The first message was refused and answered. The connection ends.
    Refused,
    /// The token was wrong. This refusal is sent after a delay, which slows down guessing.
    WrongToken(RequestRefusal),
}

/// Owns everything that clients share: the channels to the loop, the scene, the lease,
/// subscriptions, statistics and flight logs.
pub(super) struct Hub {
    bounds: Bounds,
    rig: RigConfig,
    token: Option<String>,
    encryption: Option<Encryption>,
    /// The service's end of the bridge to the control loop.
    end: ServiceEnd,
    controllers: Controllers,
    info: Info,
    stats: Stats,
    publisher: Publisher,
    lease: Lease,
    orders: Orders,
    scenes: Scenes,
    models: Models,
    incidents: Incidents,
    shakes: Shakes,
    hand: SceneHand,
    flights: Flights,
    latest: Option<Sample>,
    /// Requests to let virtual time pass, until the tick in question has run: who has asked, and
    /// this tick.
    advancing: Vec<(u64, Option<Id>, u64)>,
    /// What the controller of each joint last reported about itself.
    telemetry: [Telemetry; MAX_JOINTS],
    /// Limits how often long messages are read.
    long_messages: LongMessages,
    wrong_tokens: WrongTokens,
    /// Number of connections accepted so far.
    sessions: u64,
    status: watch::Sender<Status>,
    /// Notifies the service's task that it must change what it waits for: work on another thread
    /// has begun, or the number of subscribers has changed.
    changed: Arc<Notify>,
}

impl Hub {
    pub(super) fn new(
        bounds: Bounds,
        end: ServiceEnd,
        setup: ServiceSetup,
        status: watch::Sender<Status>,
    ) -> Self {
        let ServiceSetup {
            rig,
            scene,
            phenomena,
            hand,
            token,
            encryption,
            flight_dir,
            controllers,
            accuracy,
            origin,
            time_waits,
            notes,
            web: _,
        } = setup;
        let changed = Arc::new(Notify::new());
        let simulated = phenomena.is_some();
        let mut incidents = Incidents::new(rig.rig, simulated);
        if let Some(simulate) = scene.file().simulate() {
            incidents.show(simulate);
        }
        Self {
            bounds,
            token,
            encryption,
            end,
            controllers,
            info: Info::new(&rig, &accuracy, simulated, Clock { origin, time_waits }),
            stats: Stats::new(notes.counts()),
            publisher: Publisher::new(Arc::clone(&changed), notes.clone()),
            lease: Lease::default(),
            orders: Orders::default(),
            scenes: Scenes::new(scene, phenomena, &rig, notes.clone(), Arc::clone(&changed)),
            models: Models::new(&rig),
            incidents,
            shakes: Shakes::default(),
            hand: SceneHand::new(hand),
            flights: Flights::new(flight_dir, rig.rig.timing.period_ns, notes, Arc::clone(&changed)),
            latest: None,
            advancing: Vec::new(),
            telemetry: [Telemetry::default(); MAX_JOINTS],
            long_messages: LongMessages::default(),
            wrong_tokens: WrongTokens::default(),
            sessions: 0,
            status,
            changed,
            rig,
        }
    }
}

/// Functions that the service's task and the connections call.
impl Hub {
    pub(super) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    pub(super) fn encryption(&self) -> Option<&Encryption> {
        self.encryption.as_ref()
    }

    /// Returns whether clients must send a token.
    pub(super) const fn has_token(&self) -> bool {
        self.token.is_some()
    }

    /// Returns the encoding that a client has asked for in its hello.
    pub(super) fn encoding(&self, session: u64) -> Encoding {
        self.publisher.encoding(session)
    }

    /// Returns the notifier that wakes the service's task when it must change what it waits for.
    pub(super) fn changed(&self) -> Arc<Notify> {
        Arc::clone(&self.changed)
    }

    pub(super) fn wakeup(&self) -> Wakeup {
        self.end.wakeup()
    }

    pub(super) fn emergency_stop(&self) -> EmergencyStop {
        self.end.emergency_stop()
    }

    /// Returns whether samples from the loop are waiting.
    pub(super) fn has_samples(&self) -> bool {
        self.end.has_samples()
    }

    /// Returns whether the loop has ended and all its samples have been taken.
    pub(super) fn is_over(&self) -> bool {
        self.end.is_over()
    }

    /// Returns whether any client waits for states. If not, samples wait until a notable one
    /// arrives.
    pub(super) fn is_watched(&self) -> bool {
        self.publisher.is_watched() || !self.advancing.is_empty()
    }

    pub(super) fn long_messages(&mut self) -> &mut LongMessages {
        &mut self.long_messages
    }

    /// Returns the number of clients connected to `port` that have not sent their hello yet.
    pub(super) fn unauthenticated(&self, port: ServicePort) -> usize {
        self.publisher.unauthenticated(port)
    }

    /// Counts a new connection and returns its session number.
    pub(super) fn next_session(&mut self) -> u64 {
        self.stats.counts.connections += 1;
        self.sessions += 1;
        self.sessions
    }

    /// Adds `peer`, the client of the new connection `session`.
    pub(super) fn admit(&mut self, session: u64, peer: Peer) {
        self.publisher.admit(session, peer);
    }

    /// Counts a connection that was turned away because there was no place for it.
    pub(super) fn turned_away(&mut self) {
        self.stats.counts.connections_turned_away += 1;
    }

    /// Counts a request that was refused with the error `code`.
    pub(super) fn refused(&mut self, code: ErrorCode) {
        self.stats.counts.refused.add(code);
    }

    /// Closes the connection to `port` that has waited longest for the refusal of its wrong token,
    /// so that another connection gets its place. Returns false if there is no such connection.
    pub(super) fn close_wrong_token(&mut self, port: ServicePort) -> Option<u64> {
        self.publisher.close_wrong_token(port)
    }

    /// Processes the waiting samples and returns the statistics of the run so far.
    pub(super) fn summary(&mut self) -> StatsOk {
        self.drain();
        self.stats.summary(&self.flights)
    }

    /// Returns the final statistics, including the flight logs that were written after
    /// [`farewell`](Self::farewell).
    pub(super) fn last_summary(&self, flights: &Flights) -> StatsOk {
        self.stats.summary(flights)
    }

    /// Performs the periodic work: reports lost messages to clients, logs wrong tokens, and updates
    /// the status.
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

    /// Closes the connections of clients that do not read. Each closing can cause events that
    /// overflow the queues of other clients, so this repeats until no such client is left.
    pub(super) fn close_unresponsive(&mut self) {
        while let Some(session) = self.publisher.cut_next() {
            self.stats.counts.connections_cut += 1;
            self.gone(session);
        }
    }

    /// Handles the end of a connection, or of the client's sending direction. Counts the connection
    /// if it was cut or never encrypted.
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

    /// Handles a client that sends no more requests. If it held the lease, this orders the loop to
    /// apply the rig file's policy for a lost client, and frees the lease. The client stays known
    /// until its pending answers are sent.
    pub(super) fn gone(&mut self, session: u64) {
        let by = self.publisher.requester(session);
        if !self.publisher.gone(session) {
            return;
        }
        if self.lease.is_held_by(session) {
            let policy = self.rig.api.on_client_lost;
            self.order_internally(Own::ClientLost, Command::ClientLost(policy));
            self.lease.free(session);
            self.incidents.lost(by.clone());
            self.lease_changed(LeaseCause::Disconnected, by);
        }
        self.tell_status();
    }

    /// Informs all clients that the server stops, and closes each connection after its queued
    /// messages are sent. Returns the flight logs that are in progress.
    pub(super) fn farewell(&mut self, why: &str) -> Flights {
        // A fault in samples that still wait gets its flight log too.
        self.drain();
        self.publisher.broadcast(&Event::Stopping(StoppingEvent { message: why.to_owned() }));
        self.publisher.dismiss_all();
        std::mem::take(&mut self.flights)
    }
}

/// Functions that several requests share.
impl Hub {
    /// Sends a client's command to the loop. The answer arrives with a later sample.
    ///
    /// # Errors
    /// Fails if too many orders are pending.
    fn order(&mut self, session: u64, id: Option<Id>, op: OpName, command: Command) -> Result<(), ErrorBody> {
        let answers = id.is_some();
        let placed = self.orders.place(&mut self.end, session, id, op, command);
        self.placed(session, (op, answers), placed)
    }

    /// Notes that an order of a client waits for the loop. If the client waits for the answer, lets
    /// the loop run a tick.
    fn placed(
        &mut self,
        session: u64,
        (op, answers): (OpName, bool),
        placed: Result<(), Busy>,
    ) -> Result<(), ErrorBody> {
        placed.map_err(|_| {
            ErrorBody::new(
                ErrorCode::Busy,
                format!("op {op}: the loop has not yet taken what it was given before"),
            )
        })?;
        self.publisher.expect_answer(session);
        if answers || !op.row().stream {
            self.end.let_it_answer();
        }
        Ok(())
    }

    pub(super) fn order_internally(&mut self, what: Own, command: Command) {
        self.orders.insist(&mut self.end, Asker::Service(what), command);
        self.end.let_it_answer();
    }

    /// Announces a change of the lease, caused by the client `by`, to all clients. If the lease was
    /// stolen or released, also ramps down the torque stream of the old holder.
    fn lease_changed(&mut self, cause: LeaseCause, by: Option<Requester>) {
        // A stream or a moving hand must not continue under the next holder, or without a holder.
        if cause != LeaseCause::Acquired {
            self.hand.resume();
            self.end.run_freely();
            for (session, id, _) in std::mem::take(&mut self.advancing) {
                let message = "op advance: the lease has changed hands, so time passes by itself";
                let error = ErrorBody::new(ErrorCode::NotHolder, message);
                self.refuse(session, id, Some(OpName::Advance), error);
                self.publisher.answered(session);
            }
        }
        match cause {
            LeaseCause::Stolen => {
                self.order_internally(Own::LeaseStolen, Command::ClientLost(OnClientLost::Ramp));
            }
            LeaseCause::Released => {
                self.order_internally(Own::LeaseReleased, Command::ClientLost(OnClientLost::Ramp));
            }
            // For a lost client, the policy of the rig file has been ordered already.
            LeaseCause::Acquired | LeaseCause::Disconnected => {}
        }
        tracing::info!(holder = self.lease.name().unwrap_or("nobody"), ?cause, "lease");
        self.publisher.broadcast(&Event::Lease(self.lease.event(cause, by)));
        self.tell_status();
    }

    /// Sends an answer, and counts it if it is a refusal.
    fn respond(&mut self, session: u64, response: &Response) {
        if let Err(error) = &response.result {
            self.stats.counts.refused.add(error.code);
        }
        self.publisher.send(session, response);
    }

    /// Sends a successful answer with a body. If the body has a number that is not finite, sends an
    /// error instead.
    fn answer(&mut self, session: u64, id: Option<Id>, body: impl Serialize) {
        let answer = Response::ok(id, body);
        if let Err(error) = self.publisher.try_send(session, &answer) {
            let error = ErrorBody::new(ErrorCode::OutOfRange, format!("no answer: {error}"));
            self.respond(session, &Response::error(answer.id, error));
        }
    }

    /// Refuses a request and counts the refusal. A refused stream message without an id gets no
    /// separate answer; the client is informed of the number of such refusals.
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
