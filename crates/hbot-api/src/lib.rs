//! The TCP messages of an Hbot server, their two encodings, and a blocking client. `docs/api.md`
//! describes the messages for programmers of any language.
//!
//! # Layers, from top to bottom
//!
//! - client ([`Client`]): connects, says hello, matches answers to requests, and keeps events
//!   that arrive in between. [`Axes`] converts its vectors to the axes of other programs.
//! - messages ([`Request`], [`Response`], [`Event`]): typed messages. Every `Request` that has
//!   been read is legal.
//! - table of ops ([`OpName::row`]): who can use an op, its fields, and its cost.
//! - encoding ([`Encoding`]): a message to bytes and back, as a line of JSON or a MessagePack
//!   map.
//! - frames ([`Splitter`]): finds where messages begin and end in a stream of bytes.
//! - stops ([`StopFinder`]): finds `estop` and `disable` in the bytes before they are split.
//!
//! Messages and frames do not depend on sockets, so an asynchronous server can use them like the
//! client.
//!
//! # Conventions
//!
//! All quantities are in SI units. A field carries its unit in its name only if the unit is not SI
//! (`valid_ms`, `lateness_us`). Vectors are in the inertial frame N. Quaternions are `[w, x, y, z]`
//! and rotate from the sphere's axes into N. `t` is the time of the server's loop in seconds since
//! it started. `tick` is the number of its tick.
//!
//! # What is refused, and how
//!
//! Requests come from unknown clients and are read strictly. An unknown field, a duplicate field, a
//! number that is not finite, or text in place of a number makes the whole request a
//! [`RequestRefusal`]. Its message names the field, what was found and what is legal. Messages from
//! the server are read leniently: unknown fields are ignored, and an event with an unknown name is
//! [`Event::Unknown`].
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
//! let line = br#"{"id": 2, "op": "subscribe", "every": 0}"#;
//! let refusal = Request::read(Encoding::Json, line).unwrap_err();
//! let message = "field \"every\" is 0; legal: a whole number from 1 to 1000000";
//! assert_eq!(refusal.error.message, message);
//! ```

mod answer;
mod axes;
mod client;
mod counts;
mod encoding;
mod error;
mod event;
mod fields;
mod finite;
mod frame;
mod id;
mod mode;
mod names;
mod ops;
mod request;
mod state;
mod stop;
#[cfg(test)]
mod tests;
mod text;
mod untyped;

pub use answer::{Response, ServerMessage};
pub use axes::Axes;
pub use client::{
    Client, ClientError, ConnectOptions, LatePolicy, RenderEnd, RenderOptions, RenderReport, Trust,
    client_name, time_of_day,
};
pub use counts::CountsByName;
pub use encoding::{Encoding, MessageEncodeError};
pub use error::{ErrorBody, ErrorCode, RequestRefusal};
pub use event::{
    DroppedEvent, Event, EventName, FaultEvent, LeaseCause, LeaseEvent, RefusedEvent, Requester, SceneEvent,
    SetEvent, ShakingEvent, StoppingEvent, WarningParts,
};
pub use frame::{SplitError, Splitter};
pub use id::{Id, MAX_ID_BYTES};
pub use mode::{Fault, Mode};
pub use names::Name;
pub use ops::*;
pub use request::Request;
pub use state::{ClientStream, JointState, StateEvent, StateTiming};
pub use stop::{Stop, StopFinder, asks_estop, may_be_long};
pub use text::{Plain, is_plain};

/// Version of the messages. A client names its version in its first message. The version increases
/// with every change that would break a client written for the version before.
pub const PROTOCOL_VERSION: u64 = 1;

/// Default TCP port of a server: the digits of HBOT on a phone's keypad.
pub const DEFAULT_PORT: u16 = 4268;

/// Largest size of a request, in bytes. The newline of a JSON line counts, but the length before a
/// MessagePack map does not. Only `load_scene` and `set` from the client that holds the lease can
/// be this long.
pub const MAX_REQUEST_BYTES: usize = 65_536;

/// Largest size of every request except `load_scene` and `set`, in bytes. The newline of a JSON
/// line counts, but the length before a MessagePack map does not. A longer request is refused
/// before it is parsed.
pub const MAX_SHORT_REQUEST_BYTES: usize = 2048;

/// Largest size of a message from the server, in bytes. Clients must be able to receive this size.
/// Only the answer to `info` is nearly as long, because it contains the schema of every effect.
pub const MAX_ANSWER_BYTES: usize = 1 << 20;

/// Largest nesting depth of lists and maps in a request. For comparison: a scene with a 3x3
/// stiffness has a depth of six.
pub const MAX_DEPTH: usize = 64;

/// The program in Rust on the page of clients compiles.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/clients.md")]
struct ClientsPage;
