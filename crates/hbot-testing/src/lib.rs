//! Helpers that the tests of several hbot crates share. This crate is only a dev-dependency.
//! `.ci/dependencies.sh` checks that no program links it.
//!
//! | module | contents |
//! |---|---|
//! | [`patience`] | the longest time for which a test waits, and functions that wait |
//! | [`prototype`] | the prototype, its simulated rig, and a variant with long time-outs |
//! | [`far`] | simulated motor controllers behind a pseudo-terminal, which record all commands |
//! | [`lines`] | a client that sends and receives JSON lines without the client library |
//! | [`rng`] | random numbers that are equal in every run |
//! | [`log`] | a log subscriber that hands each message to the test |
//! | `server` (feature) | a server that runs in the process of the test |
//!
//! All helpers panic if something goes wrong. The panic makes the test fail.

pub mod far;
pub mod lines;
pub mod log;
pub mod patience;
pub mod prototype;
pub mod rng;
#[cfg(feature = "server")]
pub mod server;
