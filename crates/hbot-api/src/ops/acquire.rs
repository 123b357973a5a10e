//! The ops `acquire` and `release`, which take the right to command and give it back.

use super::{Op, OpRow, Who, may};
use crate::ErrorBody;
use crate::fields::Fields;

// Both weigh much, because each sends an event to all clients.
pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[may("steal")]).weighing(100);
pub(super) const RELEASE_ROW: OpRow = OpRow::new(Who::Any, &[]).weighing(100);

pub(super) fn read(fields: &mut Fields<'_>) -> Result<Op, ErrorBody> {
    Ok(Op::Acquire { steal: fields.flag("steal")? })
}
