//! Recordings of an Hbot as MCAP files, and their exact replay.
//!
//! - [`writer`] writes a recording: public topics that viewers understand ([`public`],
//!   [`messages`], [`topic`]), and one private topic that holds what a replay needs, bit for bit
//!   ([`exact`]).
//! - [`client`] records what a client receives.
//! - [`reader`] reads a recording, also one that is cut off or damaged.
//! - [`told`] reads public messages back, [`recover`] makes a file with an end of a cut one, and
//!   [`ticks`] finds the ticks that are missing.
//! - [`flight`] writes and reads the file names of flight logs.
//! - [`replay`] runs the recorded inputs through the control law and compares the outputs.
//!
//! docs/recordings.md describes the files.

pub mod client;
mod difference;
pub mod exact;
pub mod flight;
mod index;
#[allow(missing_docs, clippy::all, reason = "made from the definitions in proto/")]
pub mod messages;
pub mod public;
pub mod reader;
pub mod recover;
pub mod replay;
pub mod ticks;
pub mod told;
pub mod topic;
pub mod writer;

use std::path::{Path, PathBuf};

pub use client::ClientRecording;
pub use exact::Exact;
pub use reader::Reader;
pub use replay::Replay;
pub use topic::Topic;
pub use writer::{About, Writer};

/// Returns the recording that `path` names: for the CSV file of a flight log, the recording beside
/// it, if there is one.
#[must_use]
pub fn recording_of(path: &Path) -> PathBuf {
    let beside = path.with_extension("mcap");
    if path.extension().is_some_and(|end| end == "csv") && beside.exists() { beside } else { path.to_owned() }
}
