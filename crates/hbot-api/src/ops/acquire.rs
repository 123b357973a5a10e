//! The ops `acquire` and `release`, which take the right to command and give it back.

use super::{Op, OpRow, Who, may};
use crate::ErrorBody;
use crate::fields::Fields;

// All clients are told of both.
pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[may("steal")]).weighing(100);
pub(super) const RELEASE_ROW: OpRow = OpRow::new(Who::Any, &[]).weighing(100);

pub(super) fn read(fields: &mut Fields<'_>) -> Result<Op, ErrorBody> {
    Ok(Op::Acquire { steal: fields.flag("steal")? })
}
