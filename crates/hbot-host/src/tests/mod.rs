//! Tests of several modules together.

mod bridge;
mod engine;
mod line;
mod motors;
mod report;
pub(crate) mod scripted;
pub(crate) mod tick_bench;
