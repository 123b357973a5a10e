//! The ops `subscribe` and `unsubscribe`: state messages.

use super::{MAX_EVERY, Op, OpRow, Who, must};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody};
use serde::{Deserialize, Serialize};

pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[must("every")]);

/// The answer to the op `subscribe`, with which a client asks for state messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubscribeOk {
    /// Number of ticks from one state message to the next, at least 1.
    pub every: u64,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Subscribe { every: fields.integer("every", 1, MAX_EVERY)? })
}

impl Client {
    /// Subscribes to one state message every `every` ticks, from 1 to
    /// [`MAX_EVERY`](crate::MAX_EVERY).
    pub fn subscribe(&mut self, every: u64) -> Result<SubscribeOk, ClientError> {
        self.ask(Op::Subscribe { every })
    }

    /// Ends the subscription to state messages.
    pub fn unsubscribe(&mut self) -> Result<(), ClientError> {
        self.call(Op::Unsubscribe).map(drop)
    }
}
