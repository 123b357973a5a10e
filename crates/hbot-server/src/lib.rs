//! The program on the rig PC: a deterministic loop with the motor controllers over a serial line, and haptics offered to clients
//! over TCP.
//!
//! # Layers, from the line up
//!
//! 1. [`wire`]: bytes in, bytes out, never waiting: a [`serial`] port, or the simulated rig in memory.
//! 2. [`handshake`]: who the controllers are; `port`: the frames of one line; [`engine`]: one tick, frames in,
//!    `Controller::tick`, frames out, sample. [`last_word`]: a process that switches the motors off where this one cannot any more.
//! 3. [`run_loop`]: the thread that ticks, in wall-clock time ([`pace`], `early`, [`realtime`], [`clock`]) or in virtual time.
//! 4. [`bridge`]: wait-free rings between that thread and everything else; [`sample`]: what a tick publishes.
//! 5. [`service`]: clients over TCP, the lease, scenes, statistics; [`flight`]: the log of what led to a fault.
//! 6. [`bringup`]: one joint at a time, and calibration; [`signals`] that end it; [`doctor`]: whether a machine can keep the loop's time.
//! 7. [`server`]: all of it put together, started and stopped; [`stop_signal`]: an emergency stop past the service;
//!    [`expectation`]: what a rig's methods cost on this machine and what they err; [`stiffness`]: what a rig can render.

pub mod bridge;
pub mod bringup;
pub mod clock;
pub mod doctor;
mod early;
pub mod engine;
#[cfg(test)]
mod engine_tests;
pub mod expectation;
pub mod flight;
pub mod handshake;
pub mod last_word;
#[cfg(test)]
mod line_tests;
pub mod metrics;
pub mod pace;
mod port;
pub mod processor;
pub mod realtime;
pub mod run_loop;
pub mod sample;
pub mod serial;
pub mod server;
#[cfg(test)]
mod server_tests;
pub mod service;
pub mod signals;
pub mod stiffness;
pub mod stop_signal;
pub mod tls;
pub mod wire;
