//! The hub's reaction to samples of the loop and to finished work on other threads.

use std::task::{Context, Poll};

use hbot_api::{AlignOk, ErrorBody, ErrorCode, Event, ModeOk, ModelOk, OpName, Response};
use hbot_core::outputs::Reply;
use tokio::task::JoinError;

use super::super::convert;
use super::super::flights::Written;
use super::super::orders::Asker;
use super::super::refusals::refusal;
use super::super::scenes::{Changed, Examined};
use super::Hub;
use hbot_host::run_loop::sample::Sample;

/// Largest number of samples that are processed before other tasks get a turn.
const SAMPLES_A_TURN: usize = 512;

impl Hub {
    /// Processes the waiting samples, at most [`SAMPLES_A_TURN`]. Then retries the orders for which
    /// the ring to the loop had no room.
    pub(in crate::service) fn drain(&mut self) {
        for _ in 0..SAMPLES_A_TURN {
            let Some(sample) = self.end.try_sample() else { break };
            self.take(&sample);
        }
        self.orders.retry(&mut self.end);
    }

    /// Processes one sample. This must take little time, because in virtual time samples arrive as
    /// fast as the loop can compute them.
    #[inline]
    fn take(&mut self, sample: &Sample) {
        self.stats.record(sample);
        self.latest = Some(*sample);
        let (joint, telemetry) = sample.telemetry;
        self.telemetry[joint] = telemetry;
        if !self.orders.is_empty() {
            self.answered(sample);
        }
        if self.scenes.is_waiting() {
            self.scenes.rendered(sample);
            self.rendered();
        }
        self.flights.record(sample);
        let incident = self.incidents.look(sample, &self.end, &mut self.flights, &mut self.stats.counts);
        if let Some(event) = incident {
            self.publisher.broadcast(&Event::Fault(event));
        }
        if let Some(event) = self.shakes.look(sample, &self.scenes) {
            self.publisher.broadcast(&Event::Shaking(event));
        }
        if self.publisher.is_watched() {
            self.stats.counts.dropped_states += self.publisher.publish(sample, || self.hand.torque());
        }
        // The loop takes few orders in a tick. An answer must not wait for the next `advance`.
        if self.end.waits_after(sample.state.tick) && self.orders.is_awaited() {
            self.end.let_it_answer();
        }
        let tick = sample.state.tick;
        while let Some(at) = self.advancing.iter().position(|(_, _, last)| *last <= tick) {
            let (session, id, _) = self.advancing.remove(at);
            let state = self.publisher.state(sample, || self.hand.torque());
            self.answer(session, id, state);
            self.publisher.answered(session);
        }
    }

    /// Passes each answer in a sample on to the client or the part of the service that sent the
    /// order.
    fn answered(&mut self, sample: &Sample) {
        for answer in sample.answers.iter().flatten() {
            while let Some((asker, reply)) = self.orders.answered(answer) {
                self.pass_on(asker, reply, sample);
            }
        }
    }

    /// Passes the loop's answer to one order on to the client that sent it, or logs it if the
    /// service sent the order. `reply` is `None` if the answer was lost with a dropped sample.
    fn pass_on(&mut self, asker: Asker, reply: Option<Reply>, sample: &Sample) {
        let (session, id, (op, scale)) = match asker {
            Asker::Client { session, id, op, scale } => (session, id, (op, scale)),
            Asker::Service(what) => {
                // Answers come in the order of the orders: what the loop has accepted until here is
                // the earlier holder's.
                if what.ends_lease() {
                    self.publisher.stream_is_foreign(true);
                }
                match reply {
                    Some(Reply::Refused(refused)) => {
                        let effect = |slot| self.scenes.id_at(slot);
                        let hand = self.scenes.earlier_hand();
                        let at = (sample, self.incidents.is_simulated());
                        let reason =
                            refusal(&what.to_string(), refused, &self.rig.rig, at, effect, hand).message;
                        tracing::warn!("{what}: refused: {reason}");
                    }
                    _ => tracing::info!(tick = sample.state.tick, "{what}: done"),
                }
                return;
            }
        };
        let streams = matches!(op, OpName::Torque | OpName::Reference | OpName::Model);
        if streams && !matches!(reply, None | Some(Reply::Refused(_))) {
            self.publisher.stream_is_foreign(false);
        }
        match reply {
            Some(Reply::Refused(refused)) => {
                let effect = |slot| self.scenes.id_at(slot);
                let hand = self.scenes.earlier_hand();
                let at = (sample, self.incidents.is_simulated());
                let error = refusal(op.as_str(), refused, &self.rig.rig, at, effect, hand);
                self.refuse(session, id, Some(op), error);
            }
            // A stream message without an id gets no answer.
            _ if op.row().stream && id.is_none() => {}
            Some(Reply::Aligned { angle }) => self.answer(session, id, AlignOk { angle, used: true }),
            Some(Reply::Measured { angle, used }) => self.answer(session, id, AlignOk { angle, used }),
            Some(Reply::Done) if op == OpName::Model => {
                self.answer(session, id, ModelOk { stiffness_scale: scale });
            }
            Some(Reply::Done) if op.row().stream => self.respond(session, &Response::done(id)),
            Some(Reply::Done) => {
                if op == OpName::Reset {
                    self.incidents.reset_by(self.publisher.requester(session));
                }
                self.answer(session, id, ModeOk { mode: convert::mode(sample.state.mode) });
            }
            None => {
                let message = format!(
                    "op {op}: the loop's answer was lost because the server fell behind; see the state"
                );
                self.refuse(session, id, Some(op), ErrorBody::new(ErrorCode::Busy, message));
            }
        }
        self.publisher.answered(session);
    }

    /// Polls for the next scene that has been examined. Stays pending while none is.
    pub(in crate::service) fn poll_examined(
        &mut self,
        context: &mut Context<'_>,
    ) -> Poll<Result<Examined, JoinError>> {
        self.scenes.poll_examined(context)
    }

    /// Records what was found out about a scene.
    pub(in crate::service) fn examined(&mut self, examined: Result<Examined, JoinError>) {
        self.scenes.examined(examined);
        self.rendered();
    }

    /// Answers the `load_scene` and `set` requests whose changes are rendered, in the order of the
    /// requests, and tells all clients.
    fn rendered(&mut self) {
        while let Some(Changed { session, id, answer, event }) = self.scenes.next_changed() {
            self.answer(session, id, answer);
            self.publisher.broadcast(&event);
            self.publisher.answered(session);
        }
    }

    /// Polls for the next flight log whose writing has ended. Stays pending while no log is being
    /// written.
    pub(in crate::service) fn poll_written(&mut self, context: &mut Context<'_>) -> Poll<Written> {
        self.flights.poll_written(context)
    }

    /// Records the outcome of writing a flight log.
    pub(in crate::service) fn written(&mut self, written: Written) {
        self.flights.written(written);
    }
}
