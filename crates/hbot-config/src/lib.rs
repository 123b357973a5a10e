//! Reads the rig files and scene files of an Hbot. Mistakes are reported with file, line and key.
//!
//! A rig file describes the machine and its connection. A scene file describes what the sphere
//! feels like. Both are TOML. A scene can also come as JSON of the same structure. `docs/files.md`
//! lists every key of both files.
//!
//! A text becomes a legal value in these steps:
//!
//! ```text
//! TOML text ──> Document ──> validate ──> decode ──> checks ──> RigConfig, SceneFile
//! JSON value ──^ a tree       by the       to serde   what a    (private fields or types of the
//!                of values    JSON         types      schema     core, so every instance is legal)
//!                and spans    schema                  cannot say
//! ```
//!
//! The JSON schema is generated from the serde types. Each range is written once, at its field. The
//! checks, the tables in the documentation and the sliders of the panel all use it. All steps add
//! mistakes to one `Report`, so that all mistakes of a file are reported together. Each mistake is
//! a [`Diagnostic`] with its line.
//!
//! ```
//! let text = include_str!("../../../rigs/prototype.toml").replace("gear = 17 ", "gear = 0 ");
//! let mistakes = hbot_config::RigConfig::from_toml(&text, "my.toml").unwrap_err().to_string();
//! assert!(mistakes.contains("wheel[0].drive.gear: 0 is out of range; legal: 0.001 to 10000"));
//! ```

pub mod advice;
mod angle;
mod decode;
mod diagnostic;
mod document;
mod legal;
pub mod rig;
pub mod scene;
mod schema;
pub mod sweep;
mod text;
mod validate;

pub use diagnostic::{Diagnostic, Diagnostics, LoadError};
pub use document::decimal_point;
pub use legal::{did_you_mean, guess};
pub use rig::{Override, RigConfig};
pub use scene::{RunningScene, SceneFile};
pub use text::{MAX_TEXT, read_text};
