//! The op `advance`, which makes virtual time pass.

use super::{MAX_EVERY, Op, OpRow, Who, must};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody, StateEvent};

pub(super) const ROW: OpRow = OpRow::new(Who::Holder, &[must("ticks")]);

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Advance { ticks: fields.integer("ticks", 1, MAX_EVERY)? })
}

impl Client {
    /// Makes a simulated rig in virtual time run `ticks` ticks, from 1 to
    /// [`MAX_EVERY`](crate::MAX_EVERY), and then wait. Returns the state of the last of them. A
    /// torque or a model that was sent before acts in all of them.
    pub fn advance(&mut self, ticks: u64) -> Result<StateEvent, ClientError> {
        self.ask(Op::Advance { ticks })
    }
}
