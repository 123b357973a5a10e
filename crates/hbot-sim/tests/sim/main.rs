//! Tests of the simulated rig: golden vectors, conservation laws, the line, and wall time.

mod devices;
mod golden;
mod laws;
mod line;
mod nonsmooth;
mod orders;
mod phenomena;
mod pty;
mod rig;
mod stiff;
