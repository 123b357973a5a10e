//! The host's side of the line: everything that touches the motors and the machine. It knows nothing
//! of clients.
//!
//! # Rooms, from the line up
//!
//! 1. [`mod@line`]: bytes in, bytes out, never waiting: a serial port, or the simulated rig in memory.
//!    [`last_word`]: a process that switches the motors off where this one cannot any more.
//! 2. [`bus`]: motor buses, the seam for drivers; [`conformance`]: what every driver must do.
//! 3. [`layout`]: which joint of the rig stands where on which bus; [`motors`]: all buses as one set of
//!    joints.
//! 4. [`engine`]: one tick: readings in, `Controller::tick`, command out, sample. [`bridge`]: wait-free
//!    rings between the loop and everything else; [`sample`]: what a tick publishes.
//! 5. [`run_loop`]: the thread that ticks, in wall-clock time ([`pace`], `early`, [`realtime`],
//!    [`processor`], [`clock`]) or in virtual time.
//! 6. [`attach`]: from a rig file to its buses; [`host`]: all of it put together, started and stopped.
//! 7. [`bringup`]: one joint at a time, and calibration; [`signals`] that end it; [`stop_signal`]: an
//!    emergency stop by signal; [`doctor`]: whether a machine can keep the loop's time;
//!    [`expectation`]: what a rig's methods cost on this machine and how far they err; [`stiffness`]:
//!    what a rig can render.

pub mod attach;
pub mod bridge;
pub mod bringup;
pub mod bus;
pub mod clock;
pub mod conformance;
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
pub mod pace;
pub mod processor;
pub mod realtime;
pub mod run_loop;
pub mod sample;
pub mod signals;
pub mod stiffness;
pub mod stop_signal;
