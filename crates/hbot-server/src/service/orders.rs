//! Orders that have been sent to the loop and wait for an answer.

use std::collections::VecDeque;
use std::fmt;

use hbot_api::{Id, OpName, OpRow, Stop};
use hbot_core::inputs::{Command, ModelCommand};
use hbot_core::outputs::Reply;
use hbot_core::render::model::LocalModel;

use hbot_host::run_loop::bridge::{Busy, ServiceEnd};
use hbot_host::run_loop::sample::Answer;

/// If at least this many orders are pending, stream messages are refused. The loop executes 7
/// orders per tick, in sequence.
const MAX_STREAMS: usize = 32;
/// If at least this many orders are pending, all ops except `disable` and `estop` are refused.
pub(super) const MAX_ORDERS: usize = 64;
/// If at least this many orders are pending, `disable` is refused. This leaves room for the
/// confirmation of an emergency stop. The stop itself takes effect in the next tick, whatever
/// orders are pending.
const MAX_DISABLES: usize = 128;

/// Keeps track of orders, which are commands for the loop: those without an answer yet, and those
/// that wait for room in the ring to the loop.
#[derive(Default)]
pub(super) struct Orders {
    /// Orders without an answer: the ticket and the origin of each. The loop answers in this order.
    pending: VecDeque<(u64, Asker)>,
    /// Orders from the service itself for which the ring to the loop had no room yet.
    insisted: VecDeque<(Asker, Command)>,
    /// The newest order, if it came from the service itself.
    newest: Option<Command>,
}

/// The origin of an order, to which the answer is passed on.
#[derive(Debug, Clone)]
pub(super) enum Asker {
    Client {
        session: u64,
        id: Option<Id>,
        op: OpName,
        /// Fraction of the stiffness of a model that is rendered.
        scale: f64,
    },
    /// The service itself.
    Service(Own),
}

/// An order of the service itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Own {
    Disable,
    /// The client that held the lease is gone, or another one has taken it, or it was given back.
    ClientLost,
    LeaseStolen,
    LeaseReleased,
}

impl Own {
    /// Returns whether what the loop has accepted until then was from an earlier lease holder.
    pub(super) const fn ends_lease(self) -> bool {
        matches!(self, Self::ClientLost | Self::LeaseStolen | Self::LeaseReleased)
    }
}

impl fmt::Display for Own {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Disable => "disable",
            Self::ClientLost => "client lost",
            Self::LeaseStolen => "lease stolen",
            Self::LeaseReleased => "lease released",
        })
    }
}

/// Returns the limit for orders of `op`: such an order is refused if at least this many orders are
/// pending. Orders that make the rig safe have higher limits, so that other orders cannot take
/// their places.
fn places(op: OpName) -> usize {
    match op.row() {
        OpRow { stop: Some(Stop::Estop), .. } => usize::MAX,
        OpRow { stop: Some(Stop::Disable), .. } => MAX_DISABLES,
        OpRow { stream: true, .. } => MAX_STREAMS,
        _ => MAX_ORDERS,
    }
}

impl Orders {
    /// Sends a client's order to the loop. The answer arrives with a later sample.
    ///
    /// # Errors
    /// Fails if too many orders are pending for another order of `op`.
    pub(super) fn place(
        &mut self,
        end: &mut ServiceEnd,
        session: u64,
        id: Option<Id>,
        op: OpName,
        command: Command,
    ) -> Result<(), Busy> {
        if self.pending.len() >= places(op) {
            return Err(Busy);
        }
        let ticket = end.order(command)?;
        self.pending.push_back((ticket, Asker::Client { session, id, op, scale: 1.0 }));
        self.newest = None;
        Ok(())
    }

    /// Sends a client's model to the loop, whose stiffness is `scale` times what the client has
    /// asked for. The answer arrives with a later sample.
    ///
    /// # Errors
    /// Fails if too many orders are pending.
    pub(super) fn place_model(
        &mut self,
        end: &mut ServiceEnd,
        (session, id): (u64, Option<Id>),
        command: ModelCommand,
        (model, scale): (&LocalModel, f64),
    ) -> Result<(), Busy> {
        let op = OpName::Model;
        if self.pending.len() >= places(op) {
            return Err(Busy);
        }
        let ticket = end.order_model(command, model)?;
        self.pending.push_back((ticket, Asker::Client { session, id, op, scale }));
        self.newest = None;
        Ok(())
    }

    /// Sends an order from the service itself, now or when the ring to the loop has room. If it
    /// equals the newest order and that one is still pending, it is not sent again: no order came
    /// between them, and the events that cause it can come faster than the loop takes orders.
    pub(super) fn insist(&mut self, end: &mut ServiceEnd, asker: Asker, command: Command) {
        let on_its_way = !(self.pending.is_empty() && self.insisted.is_empty());
        if on_its_way && self.newest == Some(command) {
            return;
        }
        self.newest = Some(command);
        self.insisted.push_back((asker, command));
        self.retry(end);
    }

    /// Tries again to send the service's orders for which the ring to the loop had no room.
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

    /// Returns an order that `answer` settles, with its reply. An answer also settles all earlier
    /// orders without an answer. Their reply is `None`, because their answers were lost with a
    /// dropped sample. Call this until it returns `None`.
    pub(super) fn answered(&mut self, answer: &Answer) -> Option<(Asker, Option<Reply>)> {
        let (asker, lost) = self.take(answer.ticket)?;
        Some((asker, (!lost).then_some(answer.reply)))
    }

    /// Removes the oldest pending order, if its ticket is at most `ticket`. Returns its origin, and
    /// whether its answer was lost with a dropped sample.
    fn take(&mut self, ticket: u64) -> Option<(Asker, bool)> {
        let (front, _) = self.pending.front()?;
        if *front > ticket {
            return None;
        }
        let lost = *front < ticket;
        self.pending.pop_front().map(|(_, asker)| (asker, lost))
    }

    /// Returns whether anybody waits for the answer to an order.
    pub(super) fn is_awaited(&self) -> bool {
        self.pending.iter().any(|(_, asker)| match asker {
            Asker::Client { id, op, .. } => id.is_some() || !op.row().stream,
            Asker::Service(_) => true,
        })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pending.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use hbot_core::inputs::OnClientLost;

    use super::*;
    use hbot_host::run_loop::bridge::bridge;

    #[tokio::test]
    async fn what_the_service_orders_again_and_again_waits_once() {
        let (mut inner, mut end) = bridge().unwrap();
        let mut orders = Orders::default();
        let lost = Command::ClientLost(OnClientLost::Ramp);
        for _ in 0..100_000 {
            orders.insist(&mut end, Asker::Service(Own::LeaseStolen), lost);
        }
        assert_eq!((orders.pending.len(), orders.insisted.len()), (1, 0));
        // It is sent again after an order of a client, and after it has been answered.
        orders.place(&mut end, 1, None, OpName::Enable, Command::Enable).unwrap();
        orders.insist(&mut end, Asker::Service(Own::LeaseStolen), lost);
        orders.insist(&mut end, Asker::Service(Own::LeaseStolen), lost);
        assert_eq!(orders.pending.len(), 3);
        let mut taken = Vec::new();
        while let Some(order) = inner.take_order() {
            assert!(orders.take(order.ticket).is_some());
            taken.push(order.command);
        }
        assert_eq!(taken, [lost, Command::Enable, lost]);
        orders.insist(&mut end, Asker::Service(Own::LeaseStolen), lost);
        assert_eq!(orders.pending.len(), 1);
        // If the ring is full, it waits for a place, only once.
        while end.order(Command::Disable).is_ok() {}
        for command in [Command::Estop, lost, lost, lost] {
            orders.insist(&mut end, Asker::Service(Own::Disable), command);
        }
        assert_eq!(orders.insisted.len(), 2);
    }

    #[tokio::test]
    async fn an_answer_settles_the_orders_before_it_as_lost() {
        let (_inner, mut end) = bridge().unwrap();
        let mut orders = Orders::default();
        for session in 1..=3 {
            orders.place(&mut end, session, None, OpName::Enable, Command::Enable).unwrap();
        }
        let answer = Answer { ticket: 2, reply: Reply::Done };
        let mut settled = Vec::new();
        while let Some((Asker::Client { session, .. }, reply)) = orders.answered(&answer) {
            settled.push((session, reply.is_some()));
        }
        assert_eq!(settled, [(1, false), (2, true)]);
        assert!(!orders.is_empty());
    }

    #[tokio::test]
    async fn a_stop_finds_a_place_that_streams_and_modes_do_not() {
        let (_inner, mut end) = bridge().unwrap();
        let mut orders = Orders::default();
        let mut place = |op, command| {
            (0..1000).take_while(|_| orders.place(&mut end, 1, None, op, command).is_ok()).count()
        };
        assert_eq!(place(OpName::Align, Command::Reset), MAX_STREAMS);
        assert_eq!(place(OpName::Torque, Command::Reset), 0);
        assert_eq!(place(OpName::Enable, Command::Enable), MAX_ORDERS - MAX_STREAMS);
        assert_eq!(place(OpName::Disable, Command::Disable), MAX_DISABLES - MAX_ORDERS);
        assert!(place(OpName::Estop, Command::Confirm) > 0);
    }
}
