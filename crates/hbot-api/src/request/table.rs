//! The table of ops. Whatever treats ops differently (the parser, the server, the search for stops, the tests of `docs/api.md`) asks it.

use crate::Stop;
use crate::names::names;

/// Who may ask an op.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Who {
    /// Every client, as the first message and then never again.
    First,
    /// Every client that has said hello.
    Any,
    /// The client that holds the lease.
    Holder,
}

/// A field of an op.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Whether it may be left out.
    pub optional: bool,
}

/// What there is to know of an op.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpRow {
    /// Who may ask it.
    pub who: Who,
    /// Its fields, without `id` and `op`.
    pub fields: &'static [Field],
    /// Whether any other field is a parameter of the effect that it names.
    pub parameters: bool,
    /// Whether it belongs to a stream: sent again and again, and answered only if it has an id.
    pub stream: bool,
    /// What it counts as against the rate of requests, in ordinary requests.
    pub weight: u32,
    /// Whether the holder of the lease may send up to [`MAX_REQUEST_BYTES`](crate::MAX_REQUEST_BYTES) of it.
    pub long: bool,
    /// Which stop it is, if it is one: found in the bytes before they are split or parsed.
    pub stop: Option<Stop>,
    /// Whether it may bring torque back. Such a request is refused if a stop of the same client has come after it.
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

/// Defines the names of the ops and their rows in one list, so that a name without a row does not compile.
macro_rules! ops {
    ($($(#[$doc:meta])* $Variant:ident = $name:tt: $row:expr,)+) => {
        names! {
            /// The name of an [`Op`](crate::Op).
            pub enum OpName { $($(#[$doc])* $Variant = $name,)+ }
        }

        static ROWS: [OpRow; OpName::ALL.len()] = [$($row),+];
    };
}

ops! {
    /// See [`Op::Hello`](crate::Op::Hello).
    Hello = "hello": OpRow::new(Who::First, &[must("version"), must("name"), may("token"), may("encoding")]),
    /// See [`Op::Info`](crate::Op::Info).
    Info = "info": OpRow::new(Who::Any, &[]).weighing(500),
    /// See [`Op::Subscribe`](crate::Op::Subscribe).
    Subscribe = "subscribe": OpRow::new(Who::Any, &[must("every")]),
    /// See [`Op::Unsubscribe`](crate::Op::Unsubscribe).
    Unsubscribe = "unsubscribe": OpRow::new(Who::Any, &[]),
    /// See [`Op::Stats`](crate::Op::Stats).
    Stats = "stats": OpRow::new(Who::Any, &[]).weighing(100),
    /// See [`Op::Acquire`](crate::Op::Acquire). All clients are notified, which is its weight.
    Acquire = "acquire": OpRow::new(Who::Any, &[may("steal")]).weighing(100),
    /// See [`Op::Release`](crate::Op::Release). All clients are notified, which is its weight.
    Release = "release": OpRow::new(Who::Any, &[]).weighing(100),
    /// See [`Op::LoadScene`](crate::Op::LoadScene).
    LoadScene = "load_scene": OpRow::new(Who::Holder, &[must("scene")]).weighing(250).long(),
    /// See [`Op::Set`](crate::Op::Set).
    Set = "set": OpRow::new(Who::Holder, &[must("effect")]).with_parameters().weighing(100).long(),
    /// See [`Op::Torque`](crate::Op::Torque).
    Torque = "torque":
        OpRow::new(Who::Holder, &[must("torque"), must("valid_ms"), may("tick"), may("seq")]).stream(),
    /// See [`Op::Reference`](crate::Op::Reference).
    Reference = "reference":
        OpRow::new(
            Who::Holder,
            &[must("effect"), must("q"), may("omega"), may("valid_ms"), may("tick"), may("seq")],
        )
        .stream(),
    /// See [`Op::Align`](crate::Op::Align).
    Align = "align": OpRow::new(Who::Holder, &[must("q"), must("weight"), may("t")]).stream(),
    /// See [`Op::Enable`](crate::Op::Enable).
    Enable = "enable": OpRow::new(Who::Holder, &[]).rearming(),
    /// See [`Op::Disable`](crate::Op::Disable).
    Disable = "disable": OpRow::new(Who::Any, &[]).stopping(Stop::Disable),
    /// See [`Op::Reset`](crate::Op::Reset).
    Reset = "reset": OpRow::new(Who::Holder, &[]).rearming(),
    /// See [`Op::Estop`](crate::Op::Estop).
    Estop = "estop": OpRow::new(Who::Any, &[]).stopping(Stop::Estop),
    /// See [`Op::Ping`](crate::Op::Ping).
    Ping = "ping": OpRow::new(Who::Any, &[may("data")]),
}

impl OpName {
    /// What there is to know of it.
    #[must_use]
    pub const fn row(self) -> &'static OpRow {
        &ROWS[self as usize]
    }
}
