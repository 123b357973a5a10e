//! The ops `acquire` and `release`, which take the right to command and give it back.

use super::{Op, OpRow, Who, may};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody};

// Both weigh much, because each sends an event to all clients.
pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[may("steal")]).weighing(100);
pub(super) const RELEASE_ROW: OpRow = OpRow::new(Who::Any, &[]).weighing(100);

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Acquire { steal: fields.flag("steal")? })
}

impl Client {
    /// Takes the lease, which is the right to command. If `steal` is true, takes it even if another
    /// client holds it.
    pub fn acquire(&mut self, steal: bool) -> Result<(), ClientError> {
        self.call(Op::Acquire { steal }).map(drop)
    }

    /// Gives the lease back, so that another client can take it.
    pub fn release(&mut self) -> Result<(), ClientError> {
        self.call(Op::Release).map(drop)
    }
}
