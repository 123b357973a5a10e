//! Behaviour of the simulated rig: against goldens, by conservation laws, over the line, in wall time.

mod devices;
mod golden;
mod laws;
mod line;
mod nonsmooth;
mod orders;
mod phenomena;
mod pty;
mod rig;
