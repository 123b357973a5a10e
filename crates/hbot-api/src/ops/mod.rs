//! The ops: the operations that a client can request. Each file has the fields of one op or of a
//! few that belong together, who may use it and what it costs, what reads it, and its answer. The
//! list below names them all.

mod acquire;
mod advance;
mod align;
mod controllers;
mod hand;
mod hello;
mod info;
mod load_scene;
mod mode;
mod model;
mod ping;
mod reference;
mod set;
mod stats;
mod subscribe;
mod torque;

pub use align::{Align, AlignDirection, AlignOk, MIN_SIGMA};
pub use controllers::{ControllerFlag, ControllerInfo, ControllersOk};
pub use hand::{DEFAULT_OVER_MS, HandCommand, HandHold, MAX_OVER_MS};
pub(crate) use hello::check_version;
pub use hello::{Hello, HelloOk, MAX_NAME_BYTES, Token};
pub use info::{
    ClientLostPolicy, ClockInfo, EnergyInfo, FaultWords, InfoOk, JointInfo, KindInfo, LeaseInfo, LimitsInfo,
    LoopInfo, ModeWords, PassivityInfo, RenderInfo, RigInfo, SceneInfo, SphereInfo, StableInfo, TractionInfo,
    WheelInfo,
};
pub use load_scene::{EffectCost, LoadSceneOk};
pub use mode::ModeOk;
pub use model::{
    Impedance, MAX_ASYMMETRY, MAX_BLEND_MS, MAX_OFFSET, MAX_PLANES, ModelCommand, ModelOk, PlaneCommand,
};
pub use ping::PingOk;
pub use reference::{DEFAULT_VALID_MS, ReferenceCommand};
pub use set::SetOk;
pub use stats::{Distribution, StatsOk};
pub use subscribe::SubscribeOk;
pub use torque::TorqueCommand;

use crate::fields::Fields;
use crate::names::names;
use crate::{ErrorBody, Stop};
use serde::Serialize;
use serde_json::{Map, Value};

/// Largest number of ticks from one state message to the next that a client can request.
pub const MAX_EVERY: u64 = 1_000_000;

/// Longest time for which a client's torque, angular velocity or model can be valid, ms.
pub const MAX_VALID_MS: u64 = 1000;

/// Largest component of a torque (N m) or an angular velocity (rad/s) in a request. No rig can
/// reach it, but sums of squares stay finite. The server also applies the limits of the rig.
pub const MAX_MAGNITUDE: f64 = 1e6;

/// Smallest norm of a quaternion in a request. A quaternion with a larger norm is scaled to unit
/// norm.
pub const MIN_QUATERNION_NORM: f64 = 1e-3;

/// Largest length of an effect's id in a request, in bytes.
const MAX_EFFECT_BYTES: usize = 128;

/// Which clients can use an operation (op).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Who {
    /// Every client, but only as its first message on a connection.
    First,
    /// Every client after its first message, the hello.
    Any,
    /// Only the client that holds the lease, which is the right to command.
    Holder,
}

/// A field of a request: its name, and whether it is optional.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name of the field in a request.
    pub name: &'static str,
    /// Whether the field is optional.
    pub optional: bool,
}

/// The properties of one op: a row in the table of ops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpRow {
    /// Which clients can use this op.
    pub who: Who,
    /// Fields of a request with this op, except `id` and `op`.
    pub fields: &'static [Field],
    /// Whether the other fields are parameters of the effect that the request names.
    pub parameters: bool,
    /// Whether clients send the op repeatedly. Such a message is answered only if it has an id.
    pub stream: bool,
    /// How much of the client's rate limit the op uses. An ordinary request uses 1.
    pub weight: u32,
    /// Whether a request with this op can have up to
    /// [`MAX_REQUEST_BYTES`](crate::MAX_REQUEST_BYTES) bytes, if it comes from the client that
    /// holds the lease.
    pub long: bool,
    /// The kind of stop, if this op stops the rig. The server finds stops in the received bytes
    /// before it splits or parses them.
    pub stop: Option<Stop>,
    /// Whether the op can switch the torque on again. Such a request is refused if a stop from this
    /// client arrived after it.
    pub rearms: bool,
}

impl OpRow {
    const fn new(who: Who, fields: &'static [Field]) -> Self {
        Self {
            who,
            fields,
            parameters: false,
            stream: false,
            weight: 1,
            long: false,
            stop: None,
            rearms: false,
        }
    }

    const fn with_parameters(self) -> Self {
        Self { parameters: true, ..self }
    }

    const fn stream(self) -> Self {
        Self { stream: true, ..self }
    }

    const fn weighing(self, weight: u32) -> Self {
        Self { weight, ..self }
    }

    const fn long(self) -> Self {
        Self { long: true, ..self }
    }

    const fn stopping(self, stop: Stop) -> Self {
        Self { stop: Some(stop), ..self }
    }

    const fn rearming(self) -> Self {
        Self { rearms: true, ..self }
    }
}

const fn must(name: &'static str) -> Field {
    Field { name, optional: false }
}

const fn may(name: &'static str) -> Field {
    Field { name, optional: true }
}

/// Defines [`Op`], [`OpName`] and the table of ops from one list, so that the compiler finds an op
/// without one of its parts.
macro_rules! ops {
    ($(
        $(#[$doc:meta])*
        $Variant:ident $(($Payload:ty))? $({ $($fields:tt)* })? = $name:tt: $row:expr => $read:expr,
    )+) => {
        /// The operations (ops) that a client can request. They are described in `docs/api.md`.
        #[derive(Clone, Debug, PartialEq, Serialize)]
        #[serde(tag = "op")]
        pub enum Op {
            $($(#[$doc])* #[serde(rename = $name)] $Variant $(($Payload))? $({ $($fields)* })?,)+
        }

        names! {
            /// The name of an [`Op`], as it is written in the field `op` of a request.
            pub enum OpName { $($(#[$doc])* $Variant = $name,)+ }
        }

        static ROWS: [OpRow; OpName::ALL.len()] = [$($row),+];

        impl Op {
            /// Returns the name of the operation (op). [`OpName::row`] returns its properties.
            #[must_use]
            pub const fn name(&self) -> OpName {
                match self {
                    $(Self::$Variant { .. } => OpName::$Variant,)+
                }
            }

            /// Reads the fields of the op `name`.
            pub(crate) fn read(name: OpName, fields: &mut Fields) -> Result<Self, ErrorBody> {
                match name {
                    $(OpName::$Variant => ($read)(fields),)+
                }
            }
        }
    };
}

ops! {
    /// Introduces the client. This must be the first message, and is sent only once. Answer:
    /// [`HelloOk`].
    Hello(Hello) = "hello": hello::ROW => hello::read,
    /// Asks for the description of the rig, the kinds of effects and the scene. Answer:
    /// [`InfoOk`].
    Info = "info": info::ROW => |_| Ok(Op::Info),
    /// Subscribes to state messages, one every `every` ticks. Replaces an earlier subscription.
    /// Answer: [`SubscribeOk`].
    Subscribe {
        /// Number of ticks from one state message to the next, from 1 to [`MAX_EVERY`].
        every: u64,
    } = "subscribe": subscribe::ROW => subscribe::read,
    /// Ends the subscription to state messages. The answer has no data.
    Unsubscribe = "unsubscribe": OpRow::new(Who::Any, &[]) => |_| Ok(Op::Unsubscribe),
    /// Asks for the statistics and counters of the control loop and the service. Answer:
    /// [`StatsOk`].
    Stats = "stats": stats::ROW => |_| Ok(Op::Stats),
    /// Asks what the motor controller of each joint reports about itself. Answer:
    /// [`ControllersOk`].
    Controllers = "controllers": controllers::ROW => |_| Ok(Op::Controllers),
    /// Takes the lease, which is the right to command. The answer has no data, or is
    /// [`ErrorCode::Busy`](crate::ErrorCode::Busy).
    Acquire {
        /// Whether to take the lease even if another client holds it.
        #[serde(skip_serializing_if = "crate::finite::is_false")]
        steal: bool,
    } = "acquire": acquire::ROW => acquire::read,
    /// Gives the lease back, so that another client can take it. The answer has no data.
    Release = "release": acquire::RELEASE_ROW => |_| Ok(Op::Release),
    /// Loads another scene and starts to render it. Answer: [`LoadSceneOk`].
    LoadScene {
        /// The scene, a map with the structure of a scene file, or the name of a ready-made scene.
        /// Neither the content of the map nor the name has been checked.
        scene: Value,
    } = "load_scene": load_scene::ROW => load_scene::read,
    /// Changes parameters of an effect in the running scene. The torque changes gradually. Answer:
    /// [`SetOk`].
    Set {
        /// Id of an effect in the running scene.
        effect: String,
        /// New values of at least one parameter of the effect. The values have not been checked. No
        /// parameter is called `id`, `op`, `effect` or `kind`.
        #[serde(flatten)]
        parameters: Map<String, Value>,
    } = "set": set::ROW => set::read,
    /// Sends a torque that the client computes itself. Clients send it repeatedly. It is answered
    /// only if it has an id; the answer has no data.
    Torque(TorqueCommand) = "torque": torque::ROW => torque::read,
    /// Sends a new reference orientation for an effect. Clients send it repeatedly. It is answered
    /// only if it has an id; the answer has no data.
    Reference(ReferenceCommand) = "reference": reference::ROW => reference::read,
    /// Sends a local model: a torque, and how it changes as the sphere turns. Clients send it
    /// repeatedly. It is answered only if it has an id. Answer: [`ModelOk`].
    Model(Box<ModelCommand>) = "model": model::ROW => model::read,
    /// Sends the sphere's orientation as measured from outside, for example by a camera. It is
    /// answered only if it has an id. Answer: [`AlignOk`].
    Align(Align) = "align": align::ROW => align::read,
    /// Sends a direction of the sphere as measured, for example that of gravity. It is answered
    /// only if it has an id. Answer: [`AlignOk`].
    AlignDirection(AlignDirection) = "align_direction": align::DIRECTION_ROW => align::read_direction,
    /// Moves the simulated hand. Only a simulated rig has one. Clients send it repeatedly. It is
    /// answered only if it has an id; the answer has no data.
    Hand(HandCommand) = "hand": hand::ROW => hand::read,
    /// Begins to render the scene. Answer: [`ModeOk`].
    Enable = "enable": mode::ENABLE => |_| Ok(Op::Enable),
    /// Ends rendering. Answer: [`ModeOk`].
    Disable = "disable": mode::DISABLE => |_| Ok(Op::Disable),
    /// Ends a fault or an emergency stop. Answer: [`ModeOk`].
    Reset = "reset": mode::RESET => |_| Ok(Op::Reset),
    /// Performs an emergency stop. It is never refused, and all other fields of the message are
    /// ignored. Answer: [`ModeOk`].
    Estop = "estop": mode::ESTOP => |_| Ok(Op::Estop),
    /// Makes a simulated rig in virtual time run some ticks and then wait. Answer: the
    /// [`StateEvent`](crate::StateEvent) of the last of them.
    Advance {
        /// Number of ticks, from 1 to [`MAX_EVERY`].
        ticks: u64,
    } = "advance": advance::ROW => advance::read,
    /// Tests whether the server answers. Answer: [`PingOk`].
    Ping {
        /// Any value. The answer contains it unchanged.
        #[serde(skip_serializing_if = "Value::is_null")]
        data: Value,
    } = "ping": ping::ROW => ping::read,
}

impl OpName {
    /// Returns the properties of the op, such as its fields and which clients can use it.
    #[must_use]
    pub const fn row(self) -> &'static OpRow {
        &ROWS[self as usize]
    }
}
