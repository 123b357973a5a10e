//! The panel of an Hbot: see the sphere, set its stiffness, stop it. A client of the TCP API in a process of its own: it may
//! crash, and nothing happens to the loop.
//!
//! | layer | module | what it does |
//! |---|---|---|
//! | network | `net` | threads that may wait; bounded handovers both ways |
//! | model | `model` | what is known: the state, bounded histories, the scene, who commands |
//! | views | `view` | functions of the model; what a person wants comes back as intents |
//! | window | [`Panel`] | puts them together, once a frame, without ever waiting |
//!
//! Nothing here knows a kind of effect by name: controls are drawn from the schemas that `info` gives.

mod files;
mod model;
mod net;
mod panel;
mod picture;
mod view;

pub use net::{DEFAULT_SAMPLES_PER_S, PanelOptions};
pub use panel::{Folders, Panel};
pub use picture::Picture;
