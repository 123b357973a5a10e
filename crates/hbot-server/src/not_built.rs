//! The error for a part of the server that a program was built without.

use thiserror::Error;

/// A part was asked for that this program was built without. Parts that few people need are
/// features of the build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "built without {part}; build with `cargo run --features {feature} server`, or with `--features full`"
)]
pub struct NotBuilt {
    /// Name of the part, for people.
    pub part: &'static str,
    /// Name of the feature that builds the part.
    pub feature: &'static str,
}
