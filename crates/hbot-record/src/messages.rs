//! The messages of a recording, and their definitions as they are stored in each file.
//!
//! The files in `messages/` are made from the definitions in `proto/`. A test makes them again and
//! compares; `HBOT_BLESS=1` writes them.

/// The messages that only hbot has.
pub mod hbot {
    include!("messages/hbot.rs");
}

/// The messages that Foxglove defines.
pub mod foxglove {
    include!("messages/foxglove.rs");
}

/// All definitions as a `FileDescriptorSet`, which MCAP stores as the schema of protobuf messages.
pub const DESCRIPTORS: &[u8] = include_bytes!("messages/descriptors.bin");
