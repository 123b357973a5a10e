//! The op `advance`, which makes virtual time pass.

use super::{MAX_EVERY, Op, OpRow, Who, must};
use crate::ErrorBody;
use crate::fields::Fields;

pub(super) const ROW: OpRow = OpRow::new(Who::Holder, &[must("ticks")]);

pub(super) fn read(fields: &mut Fields<'_>) -> Result<Op, ErrorBody> {
    Ok(Op::Advance { ticks: fields.integer("ticks", 1, MAX_EVERY)? })
}
