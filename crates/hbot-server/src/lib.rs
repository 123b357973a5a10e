//! What touches clients: haptics over TCP, metrics over HTTP, the flight log. The loop and its motors
//! are hbot-host's.
//!
//! - [`service`]: clients over TCP, the lease, scenes, statistics. [`tls`]: their encryption.
//! - [`flight`]: the log of what led to a fault. [`metrics`]: figures for Prometheus.
//! - [`server`]: a rig that runs and its service, put together, started and stopped.

pub mod flight;
pub mod metrics;
pub mod server;
#[cfg(test)]
mod server_tests;
pub mod service;
#[cfg(test)]
mod still;
pub mod tls;
