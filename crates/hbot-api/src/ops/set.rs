//! The op `set`, which changes parameters of an effect.

use super::{MAX_EFFECT_BYTES, Op, OpRow, Who, must};
use crate::fields::{Fields, bad};
use crate::{Client, ClientError, ErrorBody};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub(super) const ROW: OpRow =
    OpRow::new(Who::Holder, &[must("effect")]).with_parameters().weighing(100).long();

/// The answer to the op `set`, with which a client changes parameters of an effect.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetOk {
    /// What the rig cannot make of the changed scene or may not keep stable, and what has no effect
    /// in it: one sentence each, for people. Empty if a server does not send it.
    #[serde(default)]
    pub warnings: Vec<String>,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    let effect = fields.text("effect", MAX_EFFECT_BYTES)?;
    let parameters = std::mem::take(&mut fields.0);
    if parameters.contains_key("kind") {
        return Err(bad("field \"kind\" cannot be set; legal: parameters of the effect's kind (load_scene \
                        gives an effect another kind)"));
    }
    if parameters.is_empty() {
        return Err(bad("op set names no parameter; legal: effect and at least one parameter of its kind"));
    }
    Ok(Op::Set { effect, parameters })
}

impl Client {
    /// Changes parameters of an effect in the running scene. The torque changes gradually.
    pub fn set(&mut self, effect: &str, parameters: Map<String, Value>) -> Result<SetOk, ClientError> {
        self.ask(Op::Set { effect: effect.into(), parameters })
    }
}
