//! The status line of a server that runs in a terminal, and the figures at its end.

use std::fmt::Write as _;
use std::time::Duration;

use hbot_server::server::Finished;
use hbot_server::service::Status;
use tokio::sync::watch;

use super::style;

/// Draws the status line five times a second, for ever.
pub(crate) async fn show(mut status: watch::Receiver<Status>) {
    let mut beat = tokio::time::interval(Duration::from_millis(200));
    beat.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        beat.tick().await;
        let line = line(&status.borrow_and_update());
        anstream::eprint!("\r\x1b[2K{line}");
    }
}

/// Takes the status line away.
pub(crate) fn clear() {
    anstream::eprint!("\r\x1b[2K");
}
