//! What samples of the loop, and works on other threads, set off.

use std::task::{Context, Poll};

use hbot_api::{AlignOk, ErrorBody, ErrorCode, Event, ModeOk, Response};
use hbot_core::outputs::Reply;
use tokio::task::JoinError;

use super::super::convert;
use super::super::flights::Written;
use super::super::orders::Asker;
use super::super::refusals::refusal;
use super::super::scenes::{Loaded, Measured};
use super::Hub;
use hbot_host::sample::Sample;

/// Samples taken before others have their turn again.
const SAMPLES_A_TURN: usize = 512;

impl Hub {
    /// Takes the samples that are there, at most so many a turn.
    pub(in crate::service) fn drain(&mut self) {
        for _ in 0..SAMPLES_A_TURN {
            let Some(sample) = self.end.try_sample() else { break };
            self.take(&sample);
        }
        self.orders.retry(&mut self.end);
    }

    /// Takes a sample in. This runs for every tick, and in virtual time as fast as the loop goes.
    #[inline]
    fn take(&mut self, sample: &Sample) {
        self.stats.record(sample);
        self.latest = Some(*sample);
        if !self.orders.is_empty() {
            self.answered(sample);
        }
        if self.scenes.is_loading() {
            self.scenes.rendered(sample);
            self.loaded();
        }
        self.flights.record(sample);
        let incident = self.incidents.look(sample, &self.end, &mut self.flights, &mut self.stats.counts);
        if let Some(event) = incident {
            self.publisher.broadcast(&Event::Fault(event));
        }
        if self.publisher.is_watched() {
            self.stats.counts.dropped_states += self.publisher.publish(sample);
        }
    }

    /// Passes on the answers that a sample brings.
    fn answered(&mut self, sample: &Sample) {
        for answer in sample.answers.iter().flatten() {
            while let Some((asker, reply)) = self.orders.answered(answer) {
                self.pass_on(asker, reply, sample);
            }
        }
    }

    /// Answers one order; `None` where its answer was in a sample that found no place.
    fn pass_on(&mut self, asker: Asker, reply: Option<Reply>, sample: &Sample) {
        let (session, id, op) = match asker {
            Asker::Client { session, id, op } => (session, id, op),
            Asker::Service(what) => {
                match reply {
                    Some(Reply::Refused(refused)) => {
                        let effect = |slot| self.scenes.id_at(slot);
                        let reason = refusal(what, refused, &self.rig.rig, effect).message;
                        tracing::warn!("{what}: refused: {reason}");
                    }
                    _ => tracing::info!(tick = sample.state.tick, "{what}: done"),
                }
                return;
            }
        };
        match reply {
            Some(Reply::Refused(refused)) => {
                let effect = |slot| self.scenes.id_at(slot);
                let error = refusal(op.as_str(), refused, &self.rig.rig, effect);
                self.refuse(session, id, Some(op), error);
            }
            // A stream without an id is not answered.
            _ if op.row().stream && id.is_none() => {}
            Some(Reply::Aligned { angle }) => self.answer(session, id, AlignOk { angle }),
            Some(Reply::Done) if op.row().stream => self.respond(session, &Response::done(id)),
            Some(Reply::Done) => {
                self.answer(session, id, ModeOk { mode: convert::mode(sample.state.mode) });
            }
            None => {
                let message = format!(
                    "op {op}: the loop's answer was lost because the server fell behind; see the state"
                );
                self.refuse(session, id, Some(op), ErrorBody::new(ErrorCode::Busy, message));
            }
        }
        self.publisher.paid(session);
    }

    /// The end of the next measurement of a scene; pending while there is none.
    pub(in crate::service) fn poll_measured(
        &mut self,
        context: &mut Context<'_>,
    ) -> Poll<Result<Measured, JoinError>> {
        self.scenes.poll_measured(context)
    }

    /// Notes what effects cost.
    pub(in crate::service) fn measured(&mut self, measured: Result<Measured, JoinError>) {
        self.scenes.measured(measured);
        self.loaded();
    }

    /// Answers the loads that are complete, in their order.
    fn loaded(&mut self) {
        while let Some(Loaded { session, id, answer, event }) = self.scenes.next_loaded() {
            self.answer(session, id, answer);
            self.publisher.broadcast(&Event::Scene(event));
            self.publisher.paid(session);
        }
    }

    /// The end of the next flight log that is being written; pending while there is none.
    pub(in crate::service) fn poll_written(&mut self, context: &mut Context<'_>) -> Poll<Written> {
        self.flights.poll_written(context)
    }

    /// Notes how writing a flight log went.
    pub(in crate::service) fn written(&mut self, written: Written) {
        self.flights.written(written);
    }
}
