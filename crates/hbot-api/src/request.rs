//! What a client asks.

mod fields;
mod parse;
mod table;

pub(crate) use fields::Excerpt;
pub use table::{Field, OpName, OpRow, Who};

use crate::{Align, Encoding, Id, ReferenceCommand, TorqueCommand};
use serde::Serialize;
use serde_json::{Map, Value};
use std::fmt;

/// The most ticks a sample that a subscription may ask for.
pub const MAX_EVERY: u64 = 1_000_000;

/// The longest name of a client, in bytes of UTF-8.
pub const MAX_NAME_BYTES: usize = 64;

/// One message from a client. One that has been read is legal in itself: every number is finite and within its range,
/// every quaternion of unit norm. Whether it is legal for the rig, the scene and the moment is the server's to judge.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Request {
    /// Repeated in the answer. A stream message without one is not answered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<Id>,
    /// What is asked.
    #[serde(flatten)]
    pub op: Op,
}

/// What a client may ask; see `docs/api.md` for what each does.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "op", rename_all = "snake_case")]
pub enum Op {
    /// Who is there. Comes first, and once. Answer: [`HelloOk`](crate::HelloOk).
    Hello(Hello),
    /// What the rig is and can do, the effects and their parameters, the scene. Answer: [`InfoOk`](crate::InfoOk).
    Info,
    /// Send a state every so many ticks, in place of an earlier subscription. Answer: [`SubscribeOk`](crate::SubscribeOk).
    Subscribe {
        /// Ticks a sample, from 1 to [`MAX_EVERY`].
        every: u64,
    },
    /// Send no more states. Answer: nothing more than ok.
    Unsubscribe,
    /// Histograms and counters of the loop. Answer: [`StatsOk`](crate::StatsOk).
    Stats,
    /// Take the lease to command. Answer: nothing more than ok, or [`ErrorCode::Busy`](crate::ErrorCode::Busy).
    Acquire {
        /// Take it even from another holder.
        #[serde(skip_serializing_if = "is_false")]
        steal: bool,
    },
    /// Give the lease back. Answer: nothing more than ok.
    Release,
    /// Render another scene. Answer: [`LoadSceneOk`](crate::LoadSceneOk).
    LoadScene {
        /// The scene, a map of the shape of a scene file. Only its being a map has been checked.
        scene: Value,
    },
    /// Change parameters of an effect, ramped. Answer: nothing more than ok.
    Set {
        /// The id of an effect of the scene.
        effect: String,
        /// At least one parameter of that effect's kind and its new value, unchecked. Never `id`, `op`, `effect`, `kind`.
        #[serde(flatten)]
        parameters: Map<String, Value>,
    },
    /// A torque that the client renders itself. Answered only where there is an id: nothing more than ok.
    Torque(TorqueCommand),
    /// Move an effect's reference. Answered only where there is an id: nothing more than ok.
    Reference(ReferenceCommand),
    /// The orientation seen from outside. Answer, only where there is an id: [`AlignOk`](crate::AlignOk).
    Align(Align),
    /// Begin to render. Answer: [`ModeOk`](crate::ModeOk).
    Enable,
    /// Stop rendering. Answer: [`ModeOk`](crate::ModeOk).
    Disable,
    /// Leave a fault or an emergency stop. Answer: [`ModeOk`](crate::ModeOk).
    Reset,
    /// Stop at once. Never refused: further fields are passed over. Answer: [`ModeOk`](crate::ModeOk).
    Estop,
    /// Answer. Answer: [`PingOk`](crate::PingOk).
    Ping {
        /// Anything; comes back as it is.
        #[serde(skip_serializing_if = "Value::is_null")]
        data: Value,
    },
}

/// The first message of a client.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hello {
    /// The version of the messages: [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION).
    pub version: u64,
    /// Who it is, for people: 1 to [`MAX_NAME_BYTES`] bytes without control or invisible characters ([`is_plain`](crate::is_plain)).
    pub name: String,
    /// The secret that a server asks for which can be reached from other machines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<Token>,
    /// How both sides send from the answer to this message on; the answer itself is still JSON.
    pub encoding: Encoding,
}

/// A secret, kept out of debug output.
#[derive(Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Token(String);

impl Token {
    /// The secret itself. Compare it in constant time.
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

impl Op {
    /// Its name, which is also the key to its row in the table of ops.
    #[must_use]
    pub const fn name(&self) -> OpName {
        match self {
            Self::Hello(_) => OpName::Hello,
            Self::Info => OpName::Info,
            Self::Subscribe { .. } => OpName::Subscribe,
            Self::Unsubscribe => OpName::Unsubscribe,
            Self::Stats => OpName::Stats,
            Self::Acquire { .. } => OpName::Acquire,
            Self::Release => OpName::Release,
            Self::LoadScene { .. } => OpName::LoadScene,
            Self::Set { .. } => OpName::Set,
            Self::Torque(_) => OpName::Torque,
            Self::Reference(_) => OpName::Reference,
            Self::Align(_) => OpName::Align,
            Self::Enable => OpName::Enable,
            Self::Disable => OpName::Disable,
            Self::Reset => OpName::Reset,
            Self::Estop => OpName::Estop,
            Self::Ping { .. } => OpName::Ping,
        }
    }
}
