//! What the tests of hbot share. Only dev-dependencies name this crate; `.ci/dependencies.sh`
//! checks that no program links it.
//!
//! | module | what it holds |
//! |---|---|
//! | [`patience`] | the one time that a test waits for a condition, and the one helper that waits |
//! | [`prototype`] | the prototype's wheels, its simulated rig, and a rig that a busy machine does not trip |
//! | [`far`] | motor controllers at the far end of a pseudo-terminal that keep all commands they hear |
//! | [`lines`] | a client that sends JSON by hand |
//! | `server` (feature) | a server in the test's own process |
//!
//! All helpers panic if something is not as a test needs it: the panic is the test's failure.

pub mod far;
pub mod lines;
pub mod patience;
pub mod prototype;
#[cfg(feature = "server")]
pub mod server;
