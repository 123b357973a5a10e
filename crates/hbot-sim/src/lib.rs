//! The simulated rig of an Hbot. It answers the same bytes on the line as real hardware would.
//!
//! # Layers, top to bottom
//!
//! | module | what it does |
//! |---|---|
//! | [`served`] | the thread that serves a rig in wall time |
//! | [`pty`], [`socket`] | the lines of that thread: a pseudo-terminal, or a pair of sockets |
//! | [`exchange`] | a rig at the end of a line in memory, tick by tick |
//! | [`rig`] | plant, controllers and hand together: time and bytes in, bytes out |
//! | [`controller`] | virtual motor controllers of each protocol, at the far end of the line |
//! | [`hand`] | a person's hand on the sphere |
//! | [`phenomena`] | the figures of what a real rig shows besides |
//! | [`plant`] | the sphere on wheels that do not slip, and the methods that move it on |
//! | [`motion`] | true motions of a sphere that does not slip, for measuring methods of odometry |
//! | [`wander`] | a rig that is not as drawn, and a hand that turns its sphere for long |
//! | [`extrapolation`] | the integrator to rounding that they are made by |
//!
//! Everything but the first three is a pure function of what comes in: no clock, no thread, and the
//! same bits on every machine. With hbot's own link nothing is allocated after the start.
//! `docs/internals/plant.md` has the measurements.

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
pub mod served;
mod shafts;
pub mod socket;
pub mod wander;
