//! Stands in for `metrics` in a build without the feature `metrics`.

use tokio::net::TcpListener;
use tokio::sync::mpsc;

use crate::not_built::NotBuilt;
use crate::service::Control;

/// Refuses, because this build has no metrics page.
///
/// # Errors
/// Always fails. The error says how to build with the metrics page.
pub const fn built() -> Result<(), NotBuilt> {
    Err(NotBuilt { part: "metrics", feature: "metrics" })
}

/// Closes `listener`. Programs ask [`built`] first, so nobody waits for an answer on it.
pub async fn serve(_: TcpListener, _: mpsc::Sender<Control>, _: Option<String>) {}
