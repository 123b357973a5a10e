//! Phenomena: each alone against its own formula, and none where none is asked for.

mod encoder;
mod link;
mod motor;
mod none;
