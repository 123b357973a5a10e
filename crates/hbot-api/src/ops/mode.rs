//! The ops `enable`, `disable`, `reset` and `estop`, which change the mode of the rig.

use super::{Op, OpRow, Who};
use crate::{Client, ClientError, Mode, Stop};
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

impl Client {
    /// Begins to render the scene; the torque rises gradually. Returns the mode from the next tick
    /// on.
    pub fn enable(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Enable)
    }

    /// Ends rendering; the torque falls gradually. Returns the mode from the next tick on.
    pub fn disable(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Disable)
    }

    /// Ends a fault or an emergency stop. Returns the mode from the next tick on.
    pub fn reset(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Reset)
    }

    /// Performs an emergency stop: the torque is zero at once. Returns the mode from the next tick
    /// on.
    pub fn estop(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Estop)
    }

    fn mode(&mut self, op: Op) -> Result<Mode, ClientError> {
        self.ask(op).map(|ModeOk { mode }| mode)
    }
}
