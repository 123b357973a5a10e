//! The part of hbot that talks to clients: haptics over TCP, metrics over HTTP, and the flight log.
//! The loop and the motors are in hbot-host.
//!
//! - [`service`]: the TCP service with clients, the lease, scenes and statistics.
//! - [`web`]: a page for browsers, and the API over WebSocket.
//! - [`tls`]: encryption of the TCP service.
//! - [`flight`]: the log of the ticks around a fault.
//! - [`recording`]: recordings of everything that the loop does.
//! - [`live`]: the same messages to viewers that are connected.
//! - [`metrics`]: statistics for Prometheus.
//! - [`server`]: starts and stops a loop together with its service.
//!
//! The features `tls`, `live` and `metrics` build the modules of these names. Without a feature, a
//! small module stands in, and whoever asks for the part gets the error
//! [`NotBuilt`](not_built::NotBuilt).

mod background;
pub mod flight;
#[cfg_attr(not(feature = "live"), path = "no_live.rs")]
pub mod live;
#[cfg_attr(not(feature = "metrics"), path = "no_metrics.rs")]
pub mod metrics;
pub mod not_built;
pub mod recording;
pub mod server;
#[cfg(test)]
mod server_tests;
pub mod service;
#[cfg(test)]
mod still;
#[cfg_attr(not(feature = "tls"), path = "no_tls.rs")]
pub mod tls;
pub mod web;
