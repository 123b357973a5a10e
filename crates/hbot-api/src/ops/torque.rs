//! The op `torque`: a torque that a client computes itself.

use super::{MAX_VALID_MS, Op, OpRow, Who, may, must};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody, finite};
use serde::{Deserialize, Serialize};

pub(super) const ROW: OpRow =
    OpRow::new(Who::Holder, &[must("torque"), must("valid_ms"), may("tick"), may("seq")]).stream();

/// A torque on the sphere that a client computes. It is added to the scene's torque until it
/// expires, and then falls to zero over 20 ms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TorqueCommand {
    /// Torque on the sphere in frame N (fixed in space), N m. No component exceeds
    /// [`MAX_MAGNITUDE`](crate::MAX_MAGNITUDE).
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// Time from arrival at the server until the torque expires, ms, 1 to [`MAX_VALID_MS`].
    pub valid_ms: u64,
    /// Tick of the state message from which the client computed this command. The server refuses a
    /// tick older than the rig's `max_age_ticks`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Sequence number, chosen by the client. Every state message contains the number of the last
    /// accepted command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Torque(TorqueCommand {
        torque: fields.vector("torque")?,
        valid_ms: fields.integer("valid_ms", 1, MAX_VALID_MS)?,
        tick: fields.optional_integer("tick", 0, u64::MAX)?,
        seq: fields.optional_integer("seq", 0, u64::MAX)?,
    }))
}

impl Client {
    /// Sends a torque that the client computes itself, without waiting for an answer. Call it again
    /// before the torque expires.
    pub fn torque(&mut self, command: TorqueCommand) -> Result<(), ClientError> {
        self.send(Op::Torque(command))
    }
}
