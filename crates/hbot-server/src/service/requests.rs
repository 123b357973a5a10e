//! What each request does.

use hbot_api::{
    Align, ErrorBody, ErrorCode, Id, LeaseCause, LeaseInfo, MAX_SHORT_REQUEST_BYTES, Mode, ModeOk, Op,
    OpName, PingOk, ReferenceCommand, Refusal, Request, Response, SubscribeOk, TorqueCommand, Who,
    may_be_long,
};
use hbot_core::Vec3;
use hbot_core::inputs::{Command, Stamp};
use serde::Serialize;
use tokio::time::Instant;

use super::convert;
use super::desk::Gone;
use super::hub::Hub;
use super::orders::OrderKind;
use crate::bridge::CONFIRMED;

impl Hub {
    /// Takes a later message; false where the client is none any more.
    pub(super) fn message(&mut self, session: u64, message: Result<Request, Refusal>) -> bool {
        if !self.peers.contains_key(&session) {
            return false;
        }
        self.stats.counts.requests += 1;
        let (id, op, result) = match message {
            Ok(Request { id, op }) => {
                let name = op.name();
                let done = self.allowed(session, &op).and_then(|()| self.obey(session, id.clone(), op));
                (id, Some(name), done)
            }
            Err(Refusal { id, op, error }) => (id, op, Err(error)),
        };
        if let Err(error) = result {
            self.refuse(session, id, op, error);
        }
        true
    }

    /// Takes an `estop` whose bytes have stopped the loop already; false if the client is none any more.
    pub(super) fn stopped(&mut self, session: u64, id: Option<Id>) -> bool {
        let there = self.peers.contains_key(&session);
        if there {
            self.stats.counts.requests += 1;
            self.confirm_estop(session, id);
        }
        there
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

    /// Whether a message longer than ordinary ones may be read. It is looked at and not parsed.
    ///
    /// # Errors
    /// Its client does not hold the lease, or it is none that may be long.
    pub(super) fn may_send(&self, session: u64, message: &[u8]) -> Result<(), ErrorBody> {
        if !may_be_long(message) {
            let message = format!(
                "message of {} bytes; at most {MAX_SHORT_REQUEST_BYTES} are taken, and more only of {}",
                message.len(),
                long_ops().join(" and ")
            );
            return Err(ErrorBody::new(ErrorCode::TooLarge, message));
        }
        if self.holder == Some(session) {
            return Ok(());
        }
        self.holding(session, &format!("{} of this length", long_ops().join(" or ")))
    }

    /// Notes who stops the rig, for what is told of it.
    pub(super) fn stopped_by(&mut self, session: u64) {
        let name = self.peers.get(&session).and_then(|peer| peer.name.as_deref());
        self.stopper = name.map(|name| format!("client {name:?} (session {session})"));
    }

    fn allowed(&self, session: u64, op: &Op) -> Result<(), ErrorBody> {
        match op.name().row().who {
            Who::Any => Ok(()),
            Who::First => {
                Err(ErrorBody::new(ErrorCode::BadRequest, "op hello a second time; legal: once, first"))
            }
            Who::Holder => self.holding(session, op.name().as_str()),
        }
    }

    /// Whether a client holds the lease, as `op` asks.
    fn holding(&self, session: u64, op: &str) -> Result<(), ErrorBody> {
        if self.holder == Some(session) {
            return Ok(());
        }
        let holder = self.holder_name();
        let held = holder.as_ref().map(|name| format!(", which {name:?} holds")).unwrap_or_default();
        let message = format!("op {op} needs the lease{held}: acquire first");
        Err(ErrorBody { holder, ..ErrorBody::new(ErrorCode::NotHolder, message) })
    }

    /// Does what is asked and answers, or has it answered later. What takes much room on the stack is apart from it: it would be touched
    /// for each request.
    fn obey(&mut self, session: u64, id: Option<Id>, op: Op) -> Result<(), ErrorBody> {
        let name = op.name();
        match op {
            Op::Hello(_) => {}
            Op::Info => self.tell_info(session, id),
            Op::Stats => self.tell_stats(session, id),
            Op::Subscribe { every } => {
                self.subscribe(session, every);
                self.answer_with(session, id, SubscribeOk { every });
            }
            Op::Unsubscribe => {
                self.subscribe(session, 0);
                self.respond(session, &Response::done(id));
            }
            Op::Acquire { steal } => {
                self.acquire(session, steal)?;
                self.respond(session, &Response::done(id));
            }
            Op::Release => {
                self.release(session);
                self.respond(session, &Response::done(id));
            }
            Op::LoadScene { scene } => self.load_scene(session, id, scene)?,
            Op::Set { effect, parameters } => {
                self.set(&effect, &parameters)?;
                self.respond(session, &Response::done(id));
            }
            Op::Torque(torque) => {
                let command = self.torque(&torque);
                self.order(session, id, name, OrderKind::Stream, command)?;
            }
            Op::Reference(reference) => {
                let command = self.reference(&reference)?;
                self.order(session, id, name, OrderKind::Stream, command)?;
            }
            Op::Align(align) => {
                let command = self.align(&align);
                self.order(session, id, name, OrderKind::Stream, command)?;
            }
            Op::Enable => self.order(session, id, name, OrderKind::Mode, Command::Enable)?,
            Op::Reset => self.order(session, id, name, OrderKind::Mode, Command::Reset)?,
            Op::Disable => self.order(session, id, name, OrderKind::Stop, Command::Disable)?,
            Op::Estop => self.estop(session, id),
            Op::Ping { data } => {
                let tick = self.end.tick();
                let t = convert::seconds(tick * self.setup.rig.rig.timing.period_ns);
                self.answer_with(session, id, PingOk { data, tick, t });
            }
        }
        Ok(())
    }

    #[inline(never)]
    fn tell_info(&mut self, session: u64, id: Option<Id>) {
        self.drain();
        let lease = LeaseInfo { holder: self.holder_name(), session: self.holder };
        let answer = self.info.answer(&self.setup.rig, &self.setup.scene, self.latest.as_ref(), lease);
        self.answer_with(session, id, answer);
    }

    #[inline(never)]
    fn tell_stats(&mut self, session: u64, id: Option<Id>) {
        let summary = self.summary();
        self.answer_with(session, id, summary);
    }

    /// Stops the rig for a client whose stop was not found in its bytes.
    #[inline(never)]
    fn estop(&mut self, session: u64, id: Option<Id>) {
        self.end.emergency_stop().stop();
        self.stopped_by(session);
        self.confirm_estop(session, id);
    }

    /// Answers an `estop`: the loop was stopped when its bytes came, and is not stopped a second time.
    pub(super) fn confirm_estop(&mut self, session: u64, id: Option<Id>) {
        let name = self.peers.get(&session).and_then(|peer| peer.name.as_deref());
        tracing::warn!(session, name, "estop");
        if self.order(session, id.clone(), OpName::Estop, OrderKind::Stop, CONFIRMED).is_err() {
            // There is no place for it among those that are answered, but the loop does it in its next tick.
            self.answer_with(session, id, ModeOk { mode: Mode::Estop });
        }
    }

    fn subscribe(&mut self, session: u64, every: u64) {
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.every = every;
        }
        self.count_subscribers();
    }

    fn release(&mut self, session: u64) {
        if self.holder == Some(session) {
            self.lease(None, LeaseCause::Released);
        }
    }

    #[inline(never)]
    fn acquire(&mut self, session: u64, steal: bool) -> Result<(), ErrorBody> {
        match self.holder {
            Some(holder) if holder == session => {}
            None => self.lease(Some(session), LeaseCause::Acquired),
            Some(_) if steal => self.lease(Some(session), LeaseCause::Stolen),
            Some(_) => {
                let holder = self.holder_name();
                let message =
                    format!("{:?} holds the lease; steal takes it", holder.as_deref().unwrap_or_default());
                return Err(ErrorBody { holder, ..ErrorBody::new(ErrorCode::Busy, message) });
            }
        }
        Ok(())
    }

    fn torque(&self, torque: &TorqueCommand) -> Command {
        Command::Stream {
            torque: convert::vector(torque.torque),
            valid_ticks: self.ticks(torque.valid_ms),
            stamp: Stamp { seq: torque.seq, tick: torque.tick },
        }
    }

    #[inline(never)]
    fn reference(&self, reference: &ReferenceCommand) -> Result<Command, ErrorBody> {
        let id = &reference.effect;
        let place = self.setup.scene.slot_of(id);
        let Some(place) = place.filter(|place| place.has_reference) else {
            let scene = &self.setup.scene;
            let legal: Vec<&str> = scene
                .file()
                .effects()
                .iter()
                .map(|effect| effect.id())
                .filter(|id| scene.slot_of(id).is_some_and(|place| place.has_reference))
                .collect();
            let what = if place.is_some() { "has no reference" } else { "is not in the scene" };
            let legal =
                if legal.is_empty() { "none, no effect has one".to_owned() } else { legal.join(", ") };
            return Err(ErrorBody::new(
                ErrorCode::UnknownEffect,
                format!("effect {id:?} {what}; legal: {legal}"),
            ));
        };
        Ok(Command::Reference {
            slot: place.slot,
            epoch: place.epoch,
            q: convert::quaternion(reference.q),
            omega: reference.omega.map_or(Vec3::ZERO, convert::vector),
            valid_ticks: self.ticks(reference.valid_ms),
            stamp: Stamp { seq: reference.seq, tick: reference.tick },
        })
    }

    fn align(&self, align: &Align) -> Command {
        let period_ns = self.setup.rig.rig.timing.period_ns;
        let tick = match align.t {
            // To the nearest tick; what is beyond all ticks ends up at the last one and is not in the history.
            Some(t) => (t * 1.0e9 / period_ns as f64).round() as u64,
            None => self.end.tick(),
        };
        Command::Align { q: convert::quaternion(align.q), weight: align.weight, tick }
    }

    /// A time in ticks, at least one.
    fn ticks(&self, ms: u64) -> u32 {
        let ticks = (ms * u64::from(self.setup.rig.rate_hz)).div_ceil(1000).max(1);
        u32::try_from(ticks).unwrap_or(u32::MAX)
    }

    /// Answers a request with a body.
    pub(super) fn answer_with(&mut self, session: u64, id: Option<Id>, body: impl Serialize) {
        let answer = Response::ok(id, body);
        let Some(peer) = self.peers.get(&session) else { return };
        match peer.try_send(&answer) {
            Ok(true) => {}
            Ok(false) => self.doomed.push(session),
            Err(error) => {
                let error = ErrorBody::new(ErrorCode::OutOfRange, format!("no answer: {error}"));
                self.respond(session, &Response::error(answer.id, error));
            }
        }
    }

    /// Refuses a request: with an answer, or for a stream message without an id in a count.
    pub(super) fn refuse(&mut self, session: u64, id: Option<Id>, op: Option<OpName>, error: ErrorBody) {
        let stream = op.is_some_and(|op| op.row().stream);
        self.stats.counts.refused_streams += u64::from(stream);
        if !stream || id.is_some() {
            self.respond(session, &Response::error(id, error));
            return;
        }
        self.stats.refused(error.code);
        let Some(peer) = self.peers.get_mut(&session) else { return };
        peer.refuse(op, error);
        if let Some(event) = peer.refused_event(Instant::now()) {
            self.tell(session, &event);
        }
    }
}

/// The names of the ops that may be long.
fn long_ops() -> Vec<&'static str> {
    OpName::ALL.into_iter().filter(|op| op.row().long).map(OpName::as_str).collect()
}
