//! Rig and scene files of an Hbot, with diagnostics that point at file, line and field.
//!
//! A rig file says what the device is and how it is reached; a scene file says what it shall feel like. Both are TOML; a
//! scene may come as JSON of the same shape too, and `docs/files.md` lists every key of both.
//!
//! One way leads from text to a legal value:
//!
//! ```text
//! TOML text ──> Document ──> validate ──> decode ──> checks ──> RigConfig, SceneFile
//! JSON value ──^ a tree       against      serde      what no    (private fields or core's own types:
//!                of values    the JSON     types      schema     what exists is legal)
//!                and spans    schema                  can say
//! ```
//!
//! The schema is made from the serde types: a range stands once, at its field, and serves the check, the reference in the
//! docs, and the sliders of a panel. Every step adds to one `Report`, so a file's mistakes are told all at once, each as a
//! [`Diagnostic`] with its line.
//!
//! ```
//! let text = include_str!("../../../rigs/prototype.toml").replace("gear = 17 ", "gear = 0 ");
//! let mistakes = hbot_config::RigConfig::from_toml(&text, "my.toml").unwrap_err();
//! assert!(mistakes.to_string().contains("wheel[0].drive.gear: 0 is out of range; legal: 0.001 to 10000"));
//! ```

mod decode;
mod diagnostic;
mod document;
mod legal;
pub mod rig;
pub mod scene;
mod schema;
mod text;
mod validate;

pub use diagnostic::{Diagnostic, Diagnostics, LoadError};
pub use rig::{Override, RigConfig};
pub use scene::{RunningScene, SceneFile};
pub use text::{MAX_TEXT, read_text};
