//! Stands in for `live` in a build without the feature `live`.

use std::sync::Arc;
use std::thread::JoinHandle;

use hbot_api::{Event, StateEvent};

use crate::not_built::NotBuilt;
use crate::recording::{Counts, SceneNote};
use crate::web::WebOptions;

const NOT_BUILT: NotBuilt = NotBuilt { part: "live viewers", feature: "live" };

/// Refuses, because this build has no live viewers.
///
/// # Errors
/// Always fails. The error says how to build with live viewers.
pub const fn built() -> Result<(), NotBuilt> {
    Err(NOT_BUILT)
}

/// Passes messages to viewers. There is no value of this type, because this build has none.
pub(crate) enum Feed {}

/// Refuses, as [`built`] does.
pub(crate) fn start(
    _: WebOptions,
    _: &str,
    _: Vec<String>,
    _: Arc<Counts>,
) -> std::io::Result<(Feed, JoinHandle<()>)> {
    Err(std::io::Error::other(NOT_BUILT))
}

impl Feed {
    pub(crate) fn is_watched(&self) -> bool {
        match *self {}
    }

    pub(crate) fn state(&mut self, _: &StateEvent, _: u64) {
        match *self {}
    }

    pub(crate) fn event(&mut self, _: &Event, _: u64) {
        match *self {}
    }

    pub(crate) fn scene(&mut self, _: u64, _: &SceneNote, _: u64) {
        match *self {}
    }
}
