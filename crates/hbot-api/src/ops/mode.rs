//! The ops `enable`, `disable`, `reset` and `estop`, which change the mode of the rig.

use super::{OpRow, Who};
use crate::{Mode, Stop};
use serde::{Deserialize, Serialize};

pub(super) const ENABLE: OpRow = OpRow::new(Who::Holder, &[]).rearming();

pub(super) const DISABLE: OpRow = OpRow::new(Who::Any, &[]).stopping(Stop::Disable);

pub(super) const RESET: OpRow = OpRow::new(Who::Holder, &[]).rearming();

pub(super) const ESTOP: OpRow = OpRow::new(Who::Any, &[]).stopping(Stop::Estop);

/// The answer to the ops `enable`, `disable`, `reset` and `estop`, with which a client changes the
/// mode of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModeOk {
    /// Mode of the rig from the next tick on.
    pub mode: Mode,
}
