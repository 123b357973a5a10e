//! The execution of requests.

use hbot_api::{
    Align, AlignDirection, Encoding, ErrorBody, ErrorCode, Id, LeaseCause, MAX_SHORT_REQUEST_BYTES, Mode,
    ModeOk, ModelCommand as ModelRequest, Op, OpName, PingOk, ReferenceCommand, Request, RequestRefusal,
    Response, SubscribeOk, TorqueCommand, Who, may_be_long,
};
use hbot_core::Vec3;
use hbot_core::inputs::{Command, ModelCommand, Stamp};
use serde_json::Value;

use super::super::info::Now;
use super::super::orders::MAX_ORDERS;
use super::super::{controllers, convert};
use super::Hub;

impl Hub {
    /// Executes or refuses a message that a client has sent after its hello. Returns false if the
    /// client is no longer known.
    pub(in crate::service) fn message(
        &mut self,
        session: u64,
        message: Result<Request, RequestRefusal>,
    ) -> bool {
        if !self.publisher.knows(session) {
            return false;
        }
        self.stats.counts.requests += 1;
        let (id, op, result) = match message {
            Ok(Request { id, op }) => {
                let name = op.name();
                let done = self.allowed(session, &op).and_then(|()| self.obey(session, id.clone(), op));
                (id, Some(name), done)
            }
            Err(RequestRefusal { id, op, error }) => (id, op, Err(error)),
        };
        if let Err(error) = result {
            self.refuse(session, id, op, error);
        }
        true
    }

    /// Answers an `estop` request, which already stopped the loop when its bytes arrived. Returns
    /// false if the client is no longer known.
    pub(in crate::service) fn stopped(&mut self, session: u64, id: Option<Id>) -> bool {
        let there = self.publisher.knows(session);
        if there {
            self.stats.counts.requests += 1;
            self.confirm_estop(session, id);
        }
        there
    }

    /// Checks whether a client may send this message of more than 2 KiB. Only scans its bytes,
    /// without parsing them.
    ///
    /// # Errors
    /// Fails if the op may not be that long, or if the client does not hold the lease.
    pub(in crate::service) fn may_send(&self, session: u64, message: &[u8]) -> Result<(), ErrorBody> {
        if !may_be_long(message) {
            let message = format!(
                "message of {} bytes; at most {MAX_SHORT_REQUEST_BYTES} are taken, and more only of {}",
                // A line counts with its newline.
                message.len() + usize::from(self.publisher.encoding(session) == Encoding::Json),
                long_ops().join(" and ")
            );
            return Err(ErrorBody::new(ErrorCode::TooLarge, message));
        }
        if self.lease.is_held_by(session) {
            return Ok(());
        }
        self.lease.require(session, &format!("{} of this length", long_ops().join(" or ")))
    }

    /// Records which client stops the rig, so that the `fault` event can name it.
    pub(in crate::service) fn stopped_by(&mut self, session: u64) {
        self.incidents.stopped_by(self.publisher.requester(session));
    }

    fn allowed(&self, session: u64, op: &Op) -> Result<(), ErrorBody> {
        match op.name().row().who {
            Who::Any => Ok(()),
            Who::First => {
                Err(ErrorBody::new(ErrorCode::BadRequest, "op hello a second time; legal: once, first"))
            }
            Who::Holder => self.lease.require(session, op.name().as_str()),
        }
    }

    /// Executes a request. The answer is sent now, or after the loop has answered. Code that needs
    /// much stack memory is in separate functions, so that ordinary requests do not touch that
    /// memory.
    fn obey(&mut self, session: u64, id: Option<Id>, op: Op) -> Result<(), ErrorBody> {
        let name = op.name();
        match op {
            Op::Hello(_) => {}
            Op::Info => self.tell_info(session, id),
            Op::Stats => self.tell_stats(session, id),
            Op::Controllers => self.tell_controllers(session, id),
            Op::Subscribe { every } => {
                self.publisher.subscribe(session, every);
                self.answer(session, id, SubscribeOk { every });
            }
            Op::Unsubscribe => {
                self.publisher.subscribe(session, 0);
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
                let by = self.publisher.requester(session);
                self.scenes.set(&mut self.end, session, id, (effect, parameters), by)?;
                self.publisher.expect_answer(session);
            }
            Op::Torque(torque) => {
                let command = self.torque(&torque);
                self.order(session, id, name, command)?;
            }
            Op::Reference(reference) => {
                let command = self.reference(&reference)?;
                self.order(session, id, name, command)?;
            }
            Op::Model(model) => self.model(session, id, &model)?,
            Op::Align(align) => {
                let command = self.align(&align);
                self.order(session, id, name, command)?;
            }
            Op::Hand(command) => {
                self.hand.obey(&command)?;
                // Like every stream message, it is answered only if it has an id.
                if id.is_some() {
                    self.respond(session, &Response::done(id));
                }
            }
            Op::AlignDirection(direction) => {
                let AlignDirection { body, world, sigma, t } = direction;
                let (body, world) = (convert::vector(body), convert::vector(world));
                let command = Command::AlignDirection { body, world, sigma, tick: self.tick_at(t) };
                self.order(session, id, name, command)?;
            }
            Op::Enable => self.order(session, id, name, Command::Enable)?,
            Op::Reset => self.order(session, id, name, Command::Reset)?,
            Op::Disable => self.order(session, id, name, Command::Disable)?,
            Op::Estop => self.estop(session, id),
            Op::Advance { ticks } => self.advance(session, id, ticks)?,
            Op::Ping { data } => {
                let tick = self.end.tick();
                let t = convert::seconds(tick * self.rig.rig.timing.period_ns);
                self.answer(session, id, PingOk { data, tick, t });
            }
        }
        Ok(())
    }

    /// Lets virtual time pass. The answer is sent when the last tick has run.
    fn advance(&mut self, session: u64, id: Option<Id>, ticks: u64) -> Result<(), ErrorBody> {
        if self.advancing.len() >= MAX_ORDERS {
            return Err(ErrorBody::new(ErrorCode::Busy, "op advance: too many of them wait already"));
        }
        let Some(last) = self.end.advance(ticks) else {
            let message =
                "op advance: this loop runs in wall-clock time; legal: a server with `--time virtual`";
            return Err(ErrorBody::new(ErrorCode::OutOfRange, message));
        };
        self.advancing.push((session, id, last));
        self.publisher.expect_answer(session);
        self.changed.notify_one();
        Ok(())
    }

    #[inline(never)]
    fn tell_info(&mut self, session: u64, id: Option<Id>) {
        self.drain();
        let now = Now {
            scene: self.scenes.file().to_json(),
            warnings: self.scenes.warnings(),
            outlook: self.scenes.outlook(),
            sample: self.latest.as_ref(),
            lease: self.lease.info(),
            incident: self.incidents.present().cloned(),
            shaking: self.shakes.present().cloned(),
        };
        let answer = self.info.answer(&self.rig, now);
        self.answer(session, id, answer);
    }

    #[inline(never)]
    fn tell_stats(&mut self, session: u64, id: Option<Id>) {
        let summary = self.summary();
        self.answer(session, id, summary);
    }

    #[inline(never)]
    fn tell_controllers(&mut self, session: u64, id: Option<Id>) {
        self.drain();
        let answer = controllers::answer(&self.rig.rig, &self.controllers, &self.telemetry);
        self.answer(session, id, answer);
    }

    /// Stops the rig for an `estop` request that was not recognized in the incoming bytes.
    #[inline(never)]
    fn estop(&mut self, session: u64, id: Option<Id>) {
        self.end.emergency_stop().stop();
        self.stopped_by(session);
        self.confirm_estop(session, id);
    }

    /// Answers an `estop` request. The loop was stopped already, so it is not stopped a second
    /// time.
    fn confirm_estop(&mut self, session: u64, id: Option<Id>) {
        tracing::debug!(session, name = self.publisher.name(session), "estop");
        if self.order(session, id.clone(), OpName::Estop, Command::Confirm).is_err() {
            // No further order can wait for an answer now, but the loop executes the stop in its
            // next tick.
            self.answer(session, id, ModeOk { mode: Mode::Estop });
        }
    }

    fn load_scene(&mut self, session: u64, id: Option<Id>, scene: Value) -> Result<(), ErrorBody> {
        let by = self.publisher.requester(session);
        self.scenes.load(&mut self.end, session, id, scene, by)?;
        if let Some(simulate) = self.scenes.file().simulate() {
            self.incidents.show(simulate);
            self.hand.replaced();
        }
        self.publisher.expect_answer(session);
        self.tell_status();
        Ok(())
    }

    fn release(&mut self, session: u64) {
        if self.lease.free(session) {
            self.lease_changed(LeaseCause::Released, self.publisher.requester(session));
        }
    }

    #[inline(never)]
    fn acquire(&mut self, session: u64, steal: bool) -> Result<(), ErrorBody> {
        let name = self.publisher.name(session).unwrap_or_default();
        if let Some(cause) = self.lease.acquire(session, name, steal)? {
            self.lease_changed(cause, self.publisher.requester(session));
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

    fn reference(&self, reference: &ReferenceCommand) -> Result<Command, ErrorBody> {
        let place = self.scenes.reference(&reference.effect)?;
        Ok(Command::Reference {
            slot: place.slot,
            epoch: place.epoch,
            q: convert::quaternion(reference.q),
            omega: reference.omega.map_or(Vec3::ZERO, convert::vector),
            valid_ticks: self.ticks(reference.valid_ms),
            stamp: Stamp { seq: reference.seq, tick: reference.tick },
        })
    }

    #[inline(never)]
    fn model(&mut self, session: u64, id: Option<Id>, request: &ModelRequest) -> Result<(), ErrorBody> {
        let (model, scale) = self.models.checked(request)?;
        let command = ModelCommand {
            valid_ticks: self.ticks(request.valid_ms),
            blend_ticks: request.blend_ms.map(|ms| if ms == 0 { 0 } else { self.ticks(ms) }),
            stamp: Stamp { seq: request.seq, tick: request.tick },
        };
        let answers = id.is_some();
        let placed = self.orders.place_model(&mut self.end, (session, id), command, (&model, scale));
        self.placed(session, (OpName::Model, answers), placed)
    }

    fn align(&self, align: &Align) -> Command {
        let (q, weight, tick) = (convert::quaternion(align.q), align.weight, self.tick_at(align.t));
        match align.sigma {
            None => Command::Align { q, weight, tick },
            Some(sigma) => Command::AlignBySigma { q, sigma: convert::vector(sigma), weight, tick },
        }
    }

    /// Returns the tick at the time `t` (s), or the present one if there is none.
    fn tick_at(&self, t: Option<f64>) -> u64 {
        let period_ns = self.rig.rig.timing.period_ns;
        match t {
            // Round to the nearest tick. A time beyond all ticks becomes the largest tick, which is
            // not in the history and is refused.
            Some(t) => (t * 1.0e9 / period_ns as f64).round() as u64,
            None => self.end.tick(),
        }
    }

    /// Converts milliseconds to ticks of the loop, rounded up, at least one.
    fn ticks(&self, ms: u64) -> u32 {
        let ticks = (ms * u64::from(self.rig.rate_hz)).div_ceil(1000).max(1);
        u32::try_from(ticks).unwrap_or(u32::MAX)
    }
}

/// Returns the names of the ops whose requests can be longer than 2 KiB.
fn long_ops() -> Vec<&'static str> {
    OpName::ALL.into_iter().filter(|op| op.row().long).map(OpName::as_str).collect()
}
