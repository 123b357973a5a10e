//! The TCP messages of an Hbot server, their two encodings, and a blocking client. `docs/api.md` describes the same
//! messages for a programmer of any language.
//!
//! # Layers, top to bottom
//!
//! | layer | here | what it does |
//! |---|---|---|
//! | client | [`Client`] | connects, says hello, matches answers to requests, keeps events that come between |
//! | messages | [`Request`], [`Response`], [`Event`] | what is said, typed; a request that exists is a legal one |
//! | table of ops | [`OpName::row`] | who may ask an op, its fields, what it counts as |
//! | encoding | [`Encoding`] | a message to bytes and back: a line of JSON, or a MessagePack map |
//! | frames | [`Splitter`] | finds where messages begin and end, in whatever pieces the bytes arrive |
//! | stops | [`StopFinder`] | finds `estop` and `disable` in the bytes before they are split |
//!
//! Neither the messages nor the frames know of sockets, so an asynchronous server uses them as the client does.
//!
//! # Conventions
//!
//! SI units; a field carries its unit in its name only where it is another (`valid_ms`, `lateness_us`). Vectors are
//! in the inertial frame N. Quaternions are `[w, x, y, z]` and turn sphere axes into N. `t` is the time of the server's
//! loop in seconds since it started, `tick` the number of its tick.
//!
//! # What is refused, and how
//!
//! Requests come from strangers and are read strictly: an unknown field, a field given twice, a number that is not
//! finite, or text where a number belongs makes the whole request a [`RequestRefusal`], whose message names the field, what
//! was found there and what is legal. What the server sends is read leniently: fields that a later server may add are
//! passed over, and an event of an unknown name is [`Event::Unknown`].
//!
//! ```
//! use hbot_api::{Encoding, Op, Request, Splitter};
//!
//! let mut splitter = Splitter::new(Encoding::Json);
//! splitter.push(b"{\"id\": 1, \"op\": \"subsc");
//! assert!(splitter.next_message().is_none());
//! splitter.push(b"ribe\", \"every\": 10}\n");
//! let line = splitter.next_message().unwrap().unwrap();
//! let request = Request::read(Encoding::Json, line).unwrap();
//! assert_eq!(request.op, Op::Subscribe { every: 10 });
//!
//! let refusal = Request::read(Encoding::Json, br#"{"id": 2, "op": "subscribe", "every": 0}"#).unwrap_err();
//! assert_eq!(refusal.error.message, "field \"every\" is 0; legal: a whole number from 1 to 1000000");
//! ```

mod answer;
mod client;
mod counts;
mod encoding;
mod error;
mod event;
mod finite;
mod frame;
mod id;
mod info;
mod names;
mod request;
mod state;
mod stats;
mod stop;
mod stream;
#[cfg(test)]
mod tests;
mod text;
mod untyped;

pub use answer::{
    AlignOk, EffectCost, HelloOk, LoadSceneOk, ModeOk, PingOk, Response, ServerMessage, SubscribeOk,
};
pub use client::{Client, ClientError, ConnectOptions, Trust};
pub use counts::CountsByName;
pub use encoding::{Encoding, MessageEncodeError};
pub use error::{ErrorBody, ErrorCode, RequestRefusal};
pub use event::{
    DroppedEvent, Event, EventName, FaultEvent, LeaseCause, LeaseEvent, RefusedEvent, SceneEvent,
    StoppingEvent,
};
pub use frame::{SplitError, Splitter};
pub use id::{Id, MAX_ID_BYTES};
pub use info::{
    ClientLostPolicy, EnergyInfo, InfoOk, JointInfo, KindInfo, LeaseInfo, LimitsInfo, RenderInfo, RigInfo,
    SphereInfo, TractionInfo, WheelInfo,
};
pub use names::Name;
pub use request::{Field, Hello, MAX_EVERY, MAX_NAME_BYTES, Op, OpName, OpRow, Request, Token, Who};
pub use state::{ClientStream, Fault, JointState, Mode, StateEvent, StateTiming};
pub use stats::{Distribution, StatsOk};
pub use stop::{Stop, StopFinder, asks_estop, may_be_long};
pub use stream::{
    Align, DEFAULT_VALID_MS, MAX_MAGNITUDE, MAX_VALID_MS, MIN_QUATERNION_NORM, ReferenceCommand,
    TorqueCommand,
};
pub use text::{Plain, is_plain};

/// The version of the messages. A hello names the one that the client speaks; it goes up with every change that a
/// client written for the one before would not survive.
pub const PROTOCOL_VERSION: u64 = 1;

/// The TCP port of a server that is not told another: HBOT on the keys of a telephone.
pub const DEFAULT_PORT: u16 = 4268;

/// The most bytes of a request: of a line with its newline, or of a MessagePack map without its length. Only `load_scene` and
/// `set` of the lease's holder may be so long.
pub const MAX_REQUEST_BYTES: usize = 65_536;

/// The most bytes of every other request, counted likewise. A longer one is refused before it is parsed.
pub const MAX_SHORT_REQUEST_BYTES: usize = 2048;

/// The most bytes of a message of the server's, which a client must be ready to take. Only the answer to `info` comes
/// near: it carries the schema of every effect.
pub const MAX_ANSWER_BYTES: usize = 1 << 20;

/// How deep lists and maps may be nested in a request. A scene with a 3x3 stiffness has six levels.
pub const MAX_DEPTH: usize = 64;
