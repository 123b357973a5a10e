//! Orders on their way to the loop and back.

use std::collections::VecDeque;

use hbot_api::{AlignOk, ErrorBody, ErrorCode, Id, ModeOk, OpName, Response};
use hbot_core::inputs::Command;
use hbot_core::mode::Obstacle;
use hbot_core::outputs::{Refusal, Reply};

use super::convert;
use super::hub::Hub;
use crate::bridge::{Busy, ServiceEnd};
use crate::sample::Sample;

/// The loop takes 7 orders a tick, in their order. So many may be on their way before a further one is refused, so that there is
/// always a place for an emergency stop; that one the loop does in its next tick, whatever waits.
const MAX_STREAMS: usize = 32;
const MAX_ORDERS: usize = 64;
const MAX_DISABLES: usize = 128;

/// Orders on their way.
#[derive(Default)]
pub(super) struct Orders {
    /// By ticket, which is the order in which the loop answers.
    pending: VecDeque<(u64, Asker)>,
    /// Orders of the service's own that have found no place yet.
    insisted: VecDeque<(Asker, Command)>,
    /// The newest of all, where it is one of the service's own.
    newest: Option<Command>,
}

/// Who wants an answer.
#[derive(Debug, Clone)]
pub(super) enum Asker {
    Client {
        session: u64,
        id: Option<Id>,
        op: OpName,
        kind: OrderKind,
    },
    /// The service itself; what for.
    Service(&'static str),
}

/// What sort of order a client gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OrderKind {
    /// One of many; answered only where there is an id.
    Stream,
    /// One that is answered with the mode.
    Mode,
    /// One that makes the rig safe, not refused for want of a place that streams have taken.
    Stop,
}

impl Orders {
    /// Sends a client's order to the loop.
    fn place(
        &mut self,
        end: &mut ServiceEnd,
        asker: Asker,
        kind: OrderKind,
        command: Command,
    ) -> Result<(), Busy> {
        let most = match kind {
            OrderKind::Stream => MAX_STREAMS,
            OrderKind::Mode => MAX_ORDERS,
            OrderKind::Stop if command == Command::Disable => MAX_DISABLES,
            OrderKind::Stop => usize::MAX,
        };
        if self.pending.len() >= most {
            return Err(Busy);
        }
        let ticket = end.order(command)?;
        self.pending.push_back((ticket, asker));
        self.newest = None;
        Ok(())
    }

    /// Sends an order of the service's own, now or as soon as there is a place. Where it is the newest of all that are on their way it is
    /// not sent again: nothing has come after it that it would have to undo, and whoever brings it about can do so faster than the loop
    /// takes orders.
    pub(super) fn insist(&mut self, end: &mut ServiceEnd, asker: Asker, command: Command) {
        let on_its_way = !(self.pending.is_empty() && self.insisted.is_empty());
        if on_its_way && self.newest == Some(command) {
            return;
        }
        self.newest = Some(command);
        self.insisted.push_back((asker, command));
        self.retry(end);
    }

    /// Tries again what has found no place.
    pub(super) fn retry(&mut self, end: &mut ServiceEnd) {
        while let Some((asker, command)) = self.insisted.pop_front() {
            match end.order(command) {
                Ok(ticket) => self.pending.push_back((ticket, asker)),
                Err(Busy) => {
                    self.insisted.push_front((asker, command));
                    return;
                }
            }
        }
    }

    /// Who asked under this ticket, and whether older tickets were answered in samples that nobody saw.
    fn take(&mut self, ticket: u64) -> Option<(Asker, bool)> {
        let (front, _) = self.pending.front()?;
        if *front > ticket {
            return None;
        }
        let lost = *front < ticket;
        self.pending.pop_front().map(|(_, asker)| (asker, lost))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pending.is_empty()
    }
}

impl Hub {
    /// Sends a client's order to the loop; the answer comes with a sample.
    pub(super) fn order(
        &mut self,
        session: u64,
        id: Option<Id>,
        op: OpName,
        kind: OrderKind,
        command: Command,
    ) -> Result<(), ErrorBody> {
        let asker = Asker::Client { session, id, op, kind };
        self.orders.place(&mut self.end, asker, kind, command).map_err(|_| {
            ErrorBody::new(
                ErrorCode::Busy,
                format!("op {op}: the loop has not yet taken what it was given before"),
            )
        })?;
        if let Some(peer) = self.peers.get_mut(&session) {
            peer.owed += 1;
        }
        Ok(())
    }

    /// Passes on the answers that a sample brings.
    pub(super) fn answers(&mut self, sample: &Sample) {
        for answer in sample.answers.iter().flatten() {
            while let Some((asker, lost)) = self.orders.take(answer.ticket) {
                if lost {
                    self.answer(asker, None, sample);
                } else {
                    self.answer(asker, Some(answer.reply), sample);
                    break;
                }
            }
        }
    }

    /// Answers one order; `None` where its answer was in a sample that found no place.
    fn answer(&mut self, asker: Asker, reply: Option<Reply>, sample: &Sample) {
        let (session, id, op, kind) = match asker {
            Asker::Client { session, id, op, kind } => (session, id, op, kind),
            Asker::Service(what) => {
                match reply {
                    Some(Reply::Refused(refusal)) => {
                        let reason = self.refusal(what, refusal).message;
                        tracing::warn!("{what}: refused: {reason}");
                    }
                    _ => tracing::info!(tick = sample.state.tick, "{what}: done"),
                }
                return;
            }
        };
        self.paid_after(session, |hub| match reply {
            Some(Reply::Refused(refusal)) => {
                let error = hub.refusal(op.as_str(), refusal);
                hub.refuse(session, id, Some(op), error);
            }
            // A stream without an id is not answered.
            _ if kind == OrderKind::Stream && id.is_none() => {}
            Some(Reply::Aligned { angle }) => hub.answer_with(session, id, AlignOk { angle }),
            Some(Reply::Done) if kind == OrderKind::Stream => hub.respond(session, &Response::done(id)),
            Some(Reply::Done) => {
                hub.answer_with(session, id, ModeOk { mode: convert::mode(sample.state.mode) })
            }
            None => {
                let message = format!(
                    "op {op}: the loop's answer was lost because the server fell behind; see the state"
                );
                hub.refuse(session, id, Some(op), ErrorBody::new(ErrorCode::Busy, message));
            }
        });
    }

    /// Gives an answer that was owed.
    pub(super) fn paid_after(&mut self, session: u64, answer: impl FnOnce(&mut Self)) {
        answer(self);
        self.paid(session);
    }

    /// A refusal of the loop as clients see it.
    fn refusal(&self, op: &str, refusal: Refusal) -> ErrorBody {
        let rig = &self.setup.rig.rig;
        let (code, message) = match refusal {
            Refusal::Mode(Obstacle::Faulted(cause)) => {
                let cause = convert::fault(cause);
                let message = if op == OpName::Reset.as_str() {
                    format!("op reset: the cause of fault {cause} is still there: remove it first")
                } else {
                    format!("op {op}: the rig is in fault {cause}: remove its cause and reset first")
                };
                (ErrorCode::Faulted, message)
            }
            Refusal::Mode(Obstacle::Stopped) => {
                (ErrorCode::Faulted, format!("op {op}: the rig was stopped: reset first"))
            }
            Refusal::Mode(Obstacle::Unreferenced) => (
                ErrorCode::Faulted,
                format!(
                    "op {op}: a steering zero is not known: turn the wheels past their index, or calibrate"
                ),
            ),
            Refusal::TooFar { slot, angle } => {
                let id = self.setup.scene.id_at(slot).unwrap_or("?");
                let message = format!(
                    "op {op}: the reference of effect {id:?} is {angle:.3} rad from the sphere's orientation; legal: at \
                     most {} rad (limits.enable_max_angle). Turn the sphere, or set anchor = \"here\"",
                    rig.limits.enable_max_angle
                );
                return ErrorBody { angle: Some(angle), ..ErrorBody::new(ErrorCode::OutOfRange, message) };
            }
            Refusal::NoReference => (
                ErrorCode::UnknownEffect,
                format!("op {op}: the effect is no longer there, or has no reference"),
            ),
            Refusal::TooOld { age_ticks } => (
                ErrorCode::OutOfRange,
                format!(
                    "field \"tick\" is {age_ticks} ticks ago; legal: at most {} (limits.max_age_ticks)",
                    rig.limits.max_age_ticks
                ),
            ),
            Refusal::Ahead { ticks } => (
                ErrorCode::OutOfRange,
                format!(
                    "field \"tick\" is {ticks} ticks in the future; legal: the tick of a state that was sent"
                ),
            ),
            Refusal::NotInHistory => (
                ErrorCode::OutOfRange,
                "field \"t\" is not (or no longer) in the history; legal: a moment of about the last second"
                    .to_owned(),
            ),
            Refusal::NotFinite => (
                ErrorCode::BadRequest,
                format!("op {op}: a number is not finite, or a quaternion not of unit norm"),
            ),
        };
        ErrorBody::new(code, message)
    }
}

#[cfg(test)]
mod tests {
    use hbot_core::inputs::OnClientLost;

    use super::*;
    use crate::bridge::bridge;

    #[tokio::test]
    async fn what_the_service_orders_again_and_again_waits_once() {
        let (mut inner, mut end) = bridge().unwrap();
        let mut orders = Orders::default();
        let lost = Command::ClientLost(OnClientLost::Ramp);
        for _ in 0..100_000 {
            orders.insist(&mut end, Asker::Service("lease stolen"), lost);
        }
        assert_eq!((orders.pending.len(), orders.insisted.len()), (1, 0));
        // After an order of a client's it is another; and so it is once it has been answered.
        let client = Asker::Client { session: 1, id: None, op: OpName::Enable, kind: OrderKind::Mode };
        orders.place(&mut end, client, OrderKind::Mode, Command::Enable).unwrap();
        orders.insist(&mut end, Asker::Service("lease stolen"), lost);
        orders.insist(&mut end, Asker::Service("lease stolen"), lost);
        assert_eq!(orders.pending.len(), 3);
        let mut taken = Vec::new();
        while let Ok(order) = inner.orders.pop() {
            assert!(orders.take(order.ticket).is_some());
            taken.push(order.command);
        }
        assert_eq!(taken, [lost, Command::Enable, lost]);
        orders.insist(&mut end, Asker::Service("lease stolen"), lost);
        assert_eq!(orders.pending.len(), 1);
        // Where the ring is full, it waits for a place: once.
        while end.order(Command::Disable).is_ok() {}
        for command in [Command::Estop, lost, lost, lost] {
            orders.insist(&mut end, Asker::Service("a signal"), command);
        }
        assert_eq!(orders.insisted.len(), 2);
    }
}
