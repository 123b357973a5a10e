//! Connections that have not said hello: the limit of their number, and warnings about wrong
//! tokens.

use std::net::IpAddr;
use std::time::Duration;

use rustix::process::{Resource, getrlimit};
use tokio::time::Instant;

use super::Bounds;

/// Minimum time between two warnings about wrong tokens.
const TOLD_EVERY: Duration = Duration::from_secs(60);

/// Number of ports at which clients connect, each with its own places.
const PORTS: u64 = 2;
/// Number of file descriptors that the process can need in addition to those of its connections:
/// for ports, logs, files, and connections that are being turned away.
const OTHER_DESCRIPTORS: u64 = 128;

/// Returns a notice for the user if the system allows this process too few file descriptors for all
/// connections.
pub(crate) fn too_few_descriptors() -> Option<String> {
    few_descriptors(getrlimit(Resource::Nofile).current)
}

fn few_descriptors(limit: Option<u64>) -> Option<String> {
    let needed = PORTS * Bounds::default().connections as u64 + OTHER_DESCRIPTORS;
    let limit = limit.filter(|limit| *limit < needed)?;
    Some(format!(
        "the system lets this process open {limit} files: too few for {} connections, so that one may be refused that would stop the \
         rig; ulimit -n {needed} or more",
        needed - OTHER_DESCRIPTORS
    ))
}

/// How many places for connections are taken when a new connection arrives.
pub(super) struct Taken {
    pub(super) all: usize,
    /// Places taken by connections from other machines.
    pub(super) remote: usize,
    /// Places taken by connections that have not sent a hello yet.
    pub(super) unauthenticated: usize,
}

impl Taken {
    /// Checks whether there is a place for one more connection, from this machine (`local`) or from
    /// another one. Some places are reserved for programs on this machine, so that one of them can
    /// always stop the rig.
    ///
    /// # Errors
    /// Returns the reason as text if there is no place.
    pub(super) fn place(&self, bounds: &Bounds, local: bool) -> Result<(), String> {
        let kept = if local { 0 } else { bounds.local };
        if self.all >= bounds.connections {
            return Err(format!("{} connections already", self.all));
        }
        if !local && self.remote + kept >= bounds.connections {
            return Err(format!("{} connections from other machines already", self.remote));
        }
        if self.unauthenticated + kept >= bounds.unauthenticated {
            return Err(format!("{} connections without a hello already", self.unauthenticated));
        }
        Ok(())
    }
}

/// Counts the wrong tokens that clients send, and warns about them at most once a minute.
#[derive(Default)]
pub(super) struct WrongTokens {
    count: u64,
    last: Option<IpAddr>,
    told: Option<Instant>,
}

impl WrongTokens {
    /// Counts one more wrong token from `address`, and warns if a warning is due.
    pub(super) fn add(&mut self, address: Option<IpAddr>) {
        self.count += 1;
        self.last = address;
        self.tell(Instant::now());
    }

    /// Logs a warning about the wrong tokens since the last warning, at most once a minute. Returns
    /// the number of wrong tokens that it reported.
    pub(super) fn tell(&mut self, now: Instant) -> Option<u64> {
        if self.count == 0 || self.told.is_some_and(|told| now < told + TOLD_EVERY) {
            return None;
        }
        self.told = Some(now);
        let count = std::mem::take(&mut self.count);
        let address =
            self.last.map_or_else(|| "an unknown address".to_owned(), |address| address.to_string());
        tracing::warn!(count, "wrong tokens were shown, the last from {address}");
        Some(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_kept_for_this_machine() {
        let bounds = Bounds { connections: 10, local: 2, unauthenticated: 5, ..Bounds::default() };
        let place = |all, remote, unauthenticated, local| {
            Taken { all, remote, unauthenticated }.place(&bounds, local)
        };
        assert_eq!(place(9, 7, 2, false), Ok(()));
        assert!(place(9, 8, 2, false).unwrap_err().contains("8 connections from other machines"));
        assert_eq!(place(9, 8, 2, true), Ok(()));
        assert!(place(9, 1, 3, false).unwrap_err().contains("3 connections without a hello"));
        assert_eq!(place(9, 1, 4, true), Ok(()));
        assert!(place(9, 1, 5, true).is_err());
        assert!(place(10, 1, 0, true).unwrap_err().contains("10 connections"));
    }

    #[test]
    fn too_few_descriptors_are_told() {
        assert_eq!((few_descriptors(None), few_descriptors(Some(1024))), (None, None));
        assert!(few_descriptors(Some(64)).unwrap().contains("open 64 files"));
    }

    #[test]
    fn wrong_tokens_are_told_at_most_once_a_minute() {
        let mut wrong = WrongTokens::default();
        wrong.add("192.0.2.1".parse().ok());
        let told = wrong.told.expect("the first at once");
        for _ in 0..1000 {
            wrong.add(None);
        }
        assert_eq!(wrong.tell(told + TOLD_EVERY / 2), None);
        assert_eq!(wrong.tell(told + TOLD_EVERY), Some(1000));
        assert_eq!(wrong.tell(told + 3 * TOLD_EVERY), None, "nothing new");
    }
}
