//! The op `reference`, which moves the reference of an effect.

use super::{MAX_EFFECT_BYTES, MAX_VALID_MS, Op, OpRow, Who, may, must};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody, finite};
use serde::{Deserialize, Serialize};

/// Default time for which the angular velocity `omega` of a reference is valid, ms.
pub const DEFAULT_VALID_MS: u64 = 100;

pub(super) const ROW: OpRow = OpRow::new(
    Who::Holder,
    &[must("effect"), must("q"), may("omega"), may("valid_ms"), may("tick"), may("seq")],
)
.stream();

/// A new reference orientation for an effect. The effect's reference moves to it at a limited rate,
/// the rig's `reference_rate`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCommand {
    /// Id of an effect in the scene. The effect must have a reference.
    pub effect: String,
    /// The new orientation as a unit quaternion `[w, x, y, z]`. It applies until another arrives.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the reference in frame N (fixed in space), rad/s. No component exceeds
    /// [`MAX_MAGNITUDE`](crate::MAX_MAGNITUDE). It becomes zero when it expires.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub omega: Option<[f64; 3]>,
    /// Time from arrival at the server until `omega` expires, ms, 1 to [`MAX_VALID_MS`].
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
    Ok(Op::Reference(ReferenceCommand {
        effect: fields.text("effect", MAX_EFFECT_BYTES)?,
        q: fields.quaternion("q")?,
        omega: fields.optional_vector("omega")?,
        valid_ms: fields.optional_integer("valid_ms", 1, MAX_VALID_MS)?.unwrap_or(DEFAULT_VALID_MS),
        tick: fields.optional_integer("tick", 0, u64::MAX)?,
        seq: fields.optional_integer("seq", 0, u64::MAX)?,
    }))
}

impl Client {
    /// Sends a new reference orientation for an effect, without waiting for an answer. Call it
    /// again for each new orientation.
    pub fn reference(&mut self, command: ReferenceCommand) -> Result<(), ClientError> {
        self.send(Op::Reference(command))
    }
}
