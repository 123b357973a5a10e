//! Orders on their way to the loop and back.

use std::collections::VecDeque;

use hbot_api::{Id, OpName, OpRow, Stop};
use hbot_core::inputs::Command;
use hbot_core::outputs::Reply;

use hbot_host::bridge::{Busy, ServiceEnd};
use hbot_host::sample::Answer;

/// The loop takes 7 orders a tick, in their sequence. So many may be on their way when a stream message, another op or a `disable`
/// comes, so that there is always a place for an emergency stop; that one the loop does in its next tick, whatever waits.
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
    },
    /// The service itself; what for.
    Service(&'static str),
}

/// How many orders may be on their way when one for `op` is given. One that makes the rig safe is not refused for want of a place that
/// others have taken.
fn places(op: OpName) -> usize {
    match op.row() {
        OpRow { stop: Some(Stop::Estop), .. } => usize::MAX,
        OpRow { stop: Some(Stop::Disable), .. } => MAX_DISABLES,
        OpRow { stream: true, .. } => MAX_STREAMS,
        _ => MAX_ORDERS,
    }
}

impl Orders {
    /// Sends a client's order to the loop; the answer comes with a sample.
    ///
    /// # Errors
    /// So many are on their way that one for `op` has no place.
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
        self.pending.push_back((ticket, Asker::Client { session, id, op }));
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

    /// The next order that `answer` settles, and its reply; `None` for a reply that was in a sample which found no place. Orders are
    /// answered in sequence, so ask again until there is none.
    pub(super) fn answered(&mut self, answer: &Answer) -> Option<(Asker, Option<Reply>)> {
        let (asker, lost) = self.take(answer.ticket)?;
        Some((asker, (!lost).then_some(answer.reply)))
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

#[cfg(test)]
mod tests {
    use hbot_core::inputs::OnClientLost;

    use super::*;
    use hbot_host::bridge::bridge;

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
        orders.place(&mut end, 1, None, OpName::Enable, Command::Enable).unwrap();
        orders.insist(&mut end, Asker::Service("lease stolen"), lost);
        orders.insist(&mut end, Asker::Service("lease stolen"), lost);
        assert_eq!(orders.pending.len(), 3);
        let mut taken = Vec::new();
        while let Some(order) = inner.take_order() {
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
        assert!(place(OpName::Estop, hbot_host::bridge::CONFIRMED) > 0);
    }
}
