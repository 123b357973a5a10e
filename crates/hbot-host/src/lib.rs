//! The host's side of the line: everything that talks to the motors and to the operating system.
//! This crate knows nothing of clients.
//!
//! # Modules, from the line up
//!
//! 1. [`mod@line`] moves bytes to and from the motor controllers and never waits. A line is a
//!    serial port, or the simulated rig in memory. [`last_word`] is a helper process that switches
//!    the motors off if this process dies.
//! 2. [`bus`] defines motor buses, the interface that drivers implement. [`conformance`] is the
//!    test suite that every driver must pass.
//! 3. [`layout`] maps each joint of the rig to its place on a bus. [`motors`] presents all buses as
//!    one set of joints.
//! 4. [`engine`] runs one tick: it takes readings in, calls `Controller::tick`, sends the command
//!    and publishes a sample. [`bridge`] holds the wait-free rings between the loop and the rest of
//!    the program. [`sample`] defines what a tick publishes.
//! 5. [`run_loop`] is the thread that ticks, in wall-clock time ([`pace`], `early`, [`realtime`],
//!    [`processor`], [`clock`]) or in virtual time.
//! 6. [`attach`] turns a rig file into motor buses; [`built`] simulates a rig that is not as its
//!    file says. [`controllers`] says which motor controllers they lead to. [`host`] starts and
//!    stops all of these parts together.
//! 7. [`bringup`] moves one joint at a time and calibrates the rig. [`signals`] lists the signals
//!    that end a program. [`stop_signal`] is an emergency stop by signal. [`doctor`] checks whether
//!    a machine can keep the loop's deadlines. [`expectation`] measures what a rig's methods cost
//!    on this machine and how large their error is.

pub mod attach;
pub mod bridge;
#[cfg(test)]
mod bridge_tests;
pub mod bringup;
pub mod built;
pub mod bus;
pub mod clock;
pub mod conformance;
pub mod controllers;
pub mod doctor;
mod early;
pub mod engine;
#[cfg(test)]
mod engine_tests;
pub mod expectation;
pub mod host;
pub mod last_word;
pub mod layout;
pub mod line;
#[cfg(test)]
mod line_tests;
pub mod motors;
#[cfg(test)]
mod motors_tests;
pub mod pace;
pub mod processor;
pub mod realtime;
#[cfg(test)]
mod report_tests;
pub mod run_loop;
pub mod sample;
pub mod signals;
pub mod stop_signal;
#[cfg(test)]
mod tick_bench;
