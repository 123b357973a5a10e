//! The table of ops: who can use each op, its fields, its cost and what reads its fields. The
//! parser, the server, the search for stops and the tests of `docs/api.md` use it.

use super::Op;
use super::fields::Fields;
use crate::names::names;
use crate::{ErrorBody, Stop};

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

/// Defines the names of all ops, their properties and the functions that read them in one list, so
/// that the compiler finds a name without one of these.
macro_rules! ops {
    ($($(#[$doc:meta])* $Variant:ident = $name:tt: $row:expr => $read:expr,)+) => {
        names! {
            /// The name of an [`Op`](crate::Op), as it is written in the field `op` of a request.
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
            pub(super) fn read(name: OpName, fields: &mut Fields<'_>) -> Result<Self, ErrorBody> {
                match name {
                    $(OpName::$Variant => ($read)(fields),)+
                }
            }
        }
    };
}

ops! {
    /// The op [`Op::Hello`](crate::Op::Hello), with which a client introduces itself.
    Hello = "hello": OpRow::new(Who::First, &[must("version"), must("name"), may("token"), may("encoding")])
        => Fields::hello,
    /// The op [`Op::Info`](crate::Op::Info), which asks for the description of the rig.
    Info = "info": OpRow::new(Who::Any, &[]).weighing(500) => |_| Ok(Op::Info),
    /// The op [`Op::Subscribe`](crate::Op::Subscribe), which starts state messages.
    Subscribe = "subscribe": OpRow::new(Who::Any, &[must("every")]) => Fields::subscribe,
    /// The op [`Op::Unsubscribe`](crate::Op::Unsubscribe), which ends state messages.
    Unsubscribe = "unsubscribe": OpRow::new(Who::Any, &[]) => |_| Ok(Op::Unsubscribe),
    /// The op [`Op::Stats`](crate::Op::Stats), which asks for statistics and counters.
    Stats = "stats": OpRow::new(Who::Any, &[]).weighing(100) => |_| Ok(Op::Stats),
    /// The op [`Op::Controllers`](crate::Op::Controllers), which asks what the motor controllers
    /// report about themselves.
    Controllers = "controllers": OpRow::new(Who::Any, &[]).weighing(100) => |_| Ok(Op::Controllers),
    /// The op [`Op::Acquire`](crate::Op::Acquire), which takes the right to command. Its weight is
    /// high because all clients are notified.
    Acquire = "acquire": OpRow::new(Who::Any, &[may("steal")]).weighing(100) => Fields::acquire,
    /// The op [`Op::Release`](crate::Op::Release), which gives the right to command back. Its
    /// weight is high because all clients are notified.
    Release = "release": OpRow::new(Who::Any, &[]).weighing(100) => |_| Ok(Op::Release),
    /// The op [`Op::LoadScene`](crate::Op::LoadScene), which loads another scene.
    LoadScene = "load_scene": OpRow::new(Who::Holder, &[must("scene")]).weighing(250).long()
        => Fields::load_scene,
    /// The op [`Op::Set`](crate::Op::Set), which changes parameters of an effect.
    Set = "set": OpRow::new(Who::Holder, &[must("effect")]).with_parameters().weighing(100).long()
        => Fields::set,
    /// The op [`Op::Torque`](crate::Op::Torque), with which a client sends a torque that it
    /// computes.
    Torque = "torque":
        OpRow::new(Who::Holder, &[must("torque"), must("valid_ms"), may("tick"), may("seq")]).stream()
            => Fields::torque,
    /// The op [`Op::Reference`](crate::Op::Reference), which moves the reference of an effect.
    Reference = "reference":
        OpRow::new(
            Who::Holder,
            &[must("effect"), must("q"), may("omega"), may("valid_ms"), may("tick"), may("seq")],
        )
        .stream() => Fields::reference,
    /// The op [`Op::Model`](crate::Op::Model), with which a client sends a local model of the
    /// torque.
    Model = "model":
        OpRow::new(
            Who::Holder,
            &[
                may("torque"),
                may("stiffness"),
                may("damping"),
                may("pose"),
                may("planes"),
                must("valid_ms"),
                may("blend_ms"),
                may("soften"),
                may("tick"),
                may("seq"),
            ],
        )
        .stream() => Fields::model,
    /// The op [`Op::Align`](crate::Op::Align), with which a client sends an orientation measured
    /// from outside.
    Align = "align":
        OpRow::new(Who::Holder, &[must("q"), may("weight"), may("sigma"), may("t")]).stream()
            => Fields::align,
    /// The op [`Op::AlignDirection`](crate::Op::AlignDirection), with which a client sends a
    /// direction measured from outside.
    AlignDirection = "align_direction":
        OpRow::new(Who::Holder, &[must("body"), must("world"), must("sigma"), may("t")]).stream()
            => Fields::align_direction,
    /// The op [`Op::Hand`](crate::Op::Hand), which moves the hand of a simulated rig.
    Hand = "hand":
        OpRow::new(
            Who::Holder,
            &[may("q"), may("over_ms"), may("stiffness"), may("damping"), may("inertia"), may("release")],
        )
        .stream() => Fields::hand,
    /// The op [`Op::Enable`](crate::Op::Enable), which begins to render the scene.
    Enable = "enable": OpRow::new(Who::Holder, &[]).rearming() => |_| Ok(Op::Enable),
    /// The op [`Op::Disable`](crate::Op::Disable), which ends rendering.
    Disable = "disable": OpRow::new(Who::Any, &[]).stopping(Stop::Disable) => |_| Ok(Op::Disable),
    /// The op [`Op::Reset`](crate::Op::Reset), which ends a fault or an emergency stop.
    Reset = "reset": OpRow::new(Who::Holder, &[]).rearming() => |_| Ok(Op::Reset),
    /// The op [`Op::Estop`](crate::Op::Estop), the emergency stop.
    Estop = "estop": OpRow::new(Who::Any, &[]).stopping(Stop::Estop) => |_| Ok(Op::Estop),
    /// The op [`Op::Advance`](crate::Op::Advance), which makes virtual time pass.
    Advance = "advance": OpRow::new(Who::Holder, &[must("ticks")]) => Fields::advance,
    /// The op [`Op::Ping`](crate::Op::Ping), which tests the connection.
    Ping = "ping": OpRow::new(Who::Any, &[may("data")]) => Fields::ping,
}

impl OpName {
    /// Returns the properties of the op, such as its fields and which clients can use it.
    #[must_use]
    pub const fn row(self) -> &'static OpRow {
        &ROWS[self as usize]
    }
}
