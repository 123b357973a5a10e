//! The host's side of the line: everything that talks to the motors and to the operating system.
//! This crate knows nothing of clients.
//!
//! # Modules, from the line up
//!
//! 1. [`mod@line`] moves bytes to and from the motor controllers and never waits. A line is a
//!    serial port, or the simulated rig in memory.
//! 2. [`bus`] defines motor buses, the interface that drivers implement. [`bus::drivers`] has one
//!    for each protocol, [`bus::conformance`] is the test suite that every driver must pass.
//! 3. [`rig`] turns a rig file into motor buses, and presents all buses as one set of joints.
//!    [`rig::last_word`] is a helper process that switches the motors off if this process dies.
//! 4. [`run_loop`] is the thread that ticks, in wall-clock or in virtual time.
//!    [`run_loop::engine`] runs one tick: it takes readings in, calls `Controller::tick`, sends the
//!    command and publishes a [`run_loop::sample`] through the wait-free rings of
//!    [`run_loop::bridge`].
//! 5. [`commission`] prepares a rig and a machine: tests of joints, calibration, the doctor.

pub mod bus;
pub mod commission;
pub mod line;
pub mod rig;
pub mod run_loop;
#[cfg(test)]
mod tests;
