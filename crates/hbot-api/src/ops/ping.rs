//! The op `ping`, which tests the connection.

use super::{Op, OpRow, Who, may};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody};
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[may("data")]);

/// The answer to the op `ping`, with which a client tests the connection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PingOk {
    /// The data of the request, unchanged. Null if the request had none.
    pub data: Value,
    /// Number of the last tick of the control loop.
    pub tick: u64,
    /// Time of the last tick, in seconds since the control loop began.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub t: f64,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::Ping { data: fields.take("data").unwrap_or(Value::Null) })
}

impl Client {
    /// Tests whether the server answers. The answer contains `data` unchanged.
    pub fn ping(&mut self, data: Value) -> Result<PingOk, ClientError> {
        self.ask(Op::Ping { data })
    }
}
