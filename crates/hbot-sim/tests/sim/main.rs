//! Tests of the simulated rig: conservation laws, the line, and wall time.

mod devices;
mod laws;
mod line;
mod nonsmooth;
mod orders;
mod phenomena;
mod prelude;
mod pty;
mod rig;
mod stiff;
