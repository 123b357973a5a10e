//! The client of an Hbot server for C and C++: a C ABI over the blocking client of hbot-api.
//! `clients/c/README.md` is its page. The file `include/hbot.h` is written from this crate by
//! cbindgen; the test `header` fails if it is out of date.
//!
//! | module | what it holds |
//! |---|---|
//! | `status` | the codes that functions return, and the text of the last error |
//! | `boundary` | everything that crosses the ABI: pointers, texts, panics |
//! | `client` | connecting and closing; the client behind its handle |
//! | `state` | states as a plain struct |
//! | `event` | the other events as a plain struct, and both queues |
//! | `ops` | one function for each op |
//! | `info` | the description of the rig as a plain struct |
//! | `scene` | scenes from files and texts, and parameters of effects |
//! | `render` | the loop that calls the program for each state |
//! | `axes` | vectors and quaternions for other programs |
//!
//! # Contract of all functions
//!
//! Every pointer is null or points to an object of its type that lives during the call. Results may
//! be uninitialised; the function writes them completely or not at all. Texts end with a zero byte.
//! A client pointer comes from `hbot_connect` and has not been given to `hbot_close`. The head of
//! `hbot.h` states this for the authors of programs, together with the rules for threads. No panic
//! crosses the ABI: it becomes `HbotStatus::Panic`.

mod axes;
mod boundary;
mod client;
mod event;
mod info;
mod model;
mod ops;
mod render;
mod scene;
mod state;
mod status;

pub use axes::*;
pub use client::*;
pub use event::*;
pub use info::*;
pub use model::*;
pub use ops::*;
pub use render::*;
pub use scene::*;
pub use state::*;
pub use status::{HbotStatus, hbot_last_error, hbot_status_name};

/// Version of the structs and functions in this header. Compare it with hbot_abi_version().
pub const HBOT_ABI_VERSION: u32 = 1;

/// Returns the HBOT_ABI_VERSION of the library. If it differs from that of the header with which
/// a program was compiled, the program must not call any other function.
#[unsafe(no_mangle)]
pub extern "C" fn hbot_abi_version() -> u32 {
    HBOT_ABI_VERSION
}
