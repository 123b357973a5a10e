//! The panel of an Hbot: a window that shows the sphere, sets its stiffness, and stops it. The
//! panel is a client of the TCP API in a separate process, so a crash of the panel does not affect
//! the loop.
//!
//! | layer | module | what it does |
//! |---|---|---|
//! | network | `net` | threads that can wait for the server; bounded queues in both directions |
//! | model | `model` | what the panel knows: the state, bounded histories, the scene, the lease |
//! | shapes | `shape` | pure functions: from a scene's laws to lines and points in frame N |
//! | views | `view` | functions that draw the model and return what the user wants as intents |
//! | window | [`Panel`] | combines them once per frame, without ever waiting |
//!
//! Controls are drawn from the schemas in the answer to `info`, so a new kind of effect has them
//! at once. Only `shape`, which draws what the hand meets, and `model/reach.rs` name kinds; a kind
//! that they do not know has no shape.

mod files;
mod model;
mod net;
mod panel;
mod picture;
mod recorded;
mod shape;
mod view;

pub use net::{DEFAULT_SAMPLES_PER_S, PanelOptions};
pub use panel::{Folders, Panel};
pub use picture::Picture;
