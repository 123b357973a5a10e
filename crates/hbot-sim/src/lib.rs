//! The simulated rig of an Hbot. It answers the same bytes on the line as real hardware would.
//!
//! # Layers, top to bottom
//!
//! | module | what it does |
//! |---|---|
//! | [`pty`] | serves a simulated rig over a pseudo-terminal in wall time |
//! | [`exchange`] | connects a simulated rig to a line in memory, tick by tick |
//! | [`rig`] | joins plant, motor controllers and hand: time and bytes in, bytes out |
//! | [`controller`] | the firmware of the motor controllers: counts, torques, watchdog, faults |
//! | [`hand`] | a person's hand that holds the sphere |
//! | [`phenomena`] | properties of a real rig that a scene can switch on, such as friction |
//! | [`plant`] | the mechanics of sphere and wheels, and the methods that integrate them |
//! | [`motion`] | exact motions of a sphere without slip, to measure odometry methods by |
//! | [`extrapolation`] | the integrator behind [`motion`], accurate to rounding error |
//!
//! Everything except [`pty`] is a pure function of its inputs. It has no clock and no thread,
//! allocates nothing after the start, and gives the same bits on every machine. Measurements are in
//! `docs/simulator.md`.

pub mod controller;
pub mod exchange;
pub mod extrapolation;
pub mod hand;
mod impairment;
pub mod motion;
pub mod phenomena;
pub mod plant;
pub mod pty;
pub mod rig;
