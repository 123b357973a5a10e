//! The requests that a client can send.

mod fields;
mod parse;
mod table;

pub(crate) use fields::Excerpt;
pub use table::{Field, OpName, OpRow, Who};

use crate::{
    Align, AlignDirection, Encoding, HandCommand, Id, ModelCommand, ReferenceCommand, TorqueCommand,
};
use serde::Serialize;
use serde_json::{Map, Value};
use std::fmt;

/// Largest number of ticks from one state message to the next that a client can request.
pub const MAX_EVERY: u64 = 1_000_000;

/// Largest length of a client's name, in bytes of UTF-8.
pub const MAX_NAME_BYTES: usize = 64;

/// One message from a client. After reading, every number is finite and in range, and every
/// quaternion has unit norm. The server checks later whether the request is legal for the rig, the
/// scene and the moment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Request {
    /// Id of the request, which the answer repeats. A stream message without an id is not answered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<Id>,
    /// The operation (op) that the client requests, with its fields.
    #[serde(flatten)]
    pub op: Op,
}

/// The operations (ops) that a client can request. They are described in `docs/api.md`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "op", rename_all = "snake_case")]
pub enum Op {
    /// Introduces the client. This must be the first message, and is sent only once. Answer:
    /// [`HelloOk`](crate::HelloOk).
    Hello(Hello),
    /// Asks for the description of the rig, the kinds of effects and the scene. Answer:
    /// [`InfoOk`](crate::InfoOk).
    Info,
    /// Subscribes to state messages, one every `every` ticks. Replaces an earlier subscription.
    /// Answer: [`SubscribeOk`](crate::SubscribeOk).
    Subscribe {
        /// Number of ticks from one state message to the next, from 1 to [`MAX_EVERY`].
        every: u64,
    },
    /// Ends the subscription to state messages. The answer has no data.
    Unsubscribe,
    /// Asks for the statistics and counters of the control loop and the service. Answer:
    /// [`StatsOk`](crate::StatsOk).
    Stats,
    /// Asks what the motor controller of each joint reports about itself. Answer:
    /// [`ControllersOk`](crate::ControllersOk).
    Controllers,
    /// Takes the lease, which is the right to command. The answer has no data, or is
    /// [`ErrorCode::Busy`](crate::ErrorCode::Busy).
    Acquire {
        /// Whether to take the lease even if another client holds it.
        #[serde(skip_serializing_if = "is_false")]
        steal: bool,
    },
    /// Gives the lease back, so that another client can take it. The answer has no data.
    Release,
    /// Loads another scene and starts to render it. Answer: [`LoadSceneOk`](crate::LoadSceneOk).
    LoadScene {
        /// The scene, a map with the structure of a scene file, or the name of a ready-made scene.
        /// Neither the content of the map nor the name has been checked.
        scene: Value,
    },
    /// Changes parameters of an effect in the running scene. The torque changes gradually. The
    /// answer has no data.
    Set {
        /// Id of an effect in the running scene.
        effect: String,
        /// New values of at least one parameter of the effect. The values have not been checked. No
        /// parameter is called `id`, `op`, `effect` or `kind`.
        #[serde(flatten)]
        parameters: Map<String, Value>,
    },
    /// Sends a torque that the client computes itself. Clients send it repeatedly. It is answered
    /// only if it has an id; the answer has no data.
    Torque(TorqueCommand),
    /// Sends a new reference orientation for an effect. Clients send it repeatedly. It is answered
    /// only if it has an id; the answer has no data.
    Reference(ReferenceCommand),
    /// Sends a local model: a torque, and how it changes as the sphere turns. Clients send it
    /// repeatedly. It is answered only if it has an id. Answer: [`ModelOk`](crate::ModelOk).
    Model(Box<ModelCommand>),
    /// Sends the sphere's orientation as measured from outside, for example by a camera. It is
    /// answered only if it has an id. Answer: [`AlignOk`](crate::AlignOk).
    Align(Align),
    /// Moves the simulated hand. Only a simulated rig has one. Clients send it repeatedly. It is
    /// answered only if it has an id; the answer has no data.
    Hand(HandCommand),
    /// Sends a direction of the sphere as measured, for example that of gravity. It is answered
    /// only if it has an id. Answer: [`AlignOk`](crate::AlignOk).
    AlignDirection(AlignDirection),
    /// Begins to render the scene. Answer: [`ModeOk`](crate::ModeOk).
    Enable,
    /// Ends rendering. Answer: [`ModeOk`](crate::ModeOk).
    Disable,
    /// Ends a fault or an emergency stop. Answer: [`ModeOk`](crate::ModeOk).
    Reset,
    /// Performs an emergency stop. It is never refused, and all other fields of the message are
    /// ignored. Answer: [`ModeOk`](crate::ModeOk).
    Estop,
    /// Makes a simulated rig in virtual time run some ticks and then wait. Answer: the
    /// [`StateEvent`](crate::StateEvent) of the last of them.
    Advance {
        /// Number of ticks, from 1 to [`MAX_EVERY`].
        ticks: u64,
    },
    /// Tests whether the server answers. Answer: [`PingOk`](crate::PingOk).
    Ping {
        /// Any value. The answer contains it unchanged.
        #[serde(skip_serializing_if = "Value::is_null")]
        data: Value,
    },
}

/// The first message of a client, which introduces it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hello {
    /// Version of the messages that the client uses: [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION).
    pub version: u64,
    /// Name of the client, shown to people: 1 to [`MAX_NAME_BYTES`] bytes without control or
    /// invisible characters (see [`is_plain`](crate::is_plain)).
    pub name: String,
    /// Token of the server. A server that other machines can reach requires it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<Token>,
    /// Encoding of all messages after the answer to this one. The answer itself is still JSON.
    pub encoding: Encoding,
}

/// A secret text. Debug output does not show it.
#[derive(Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Token(String);

impl Token {
    /// Returns the secret text. To check it, use a comparison that takes constant time.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl From<String> for Token {
    fn from(secret: String) -> Self {
        Self(secret)
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

fn is_false(flag: &bool) -> bool {
    !flag
}
