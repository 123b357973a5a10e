//! Tests of the nonsmooth plant: against independent equations with another kind of method, and by
//! conservation laws.

mod agreement;
mod back_drive;
mod compliance;
mod dual;
mod energy;
mod extremes;
mod odometry;
mod reference;
mod scenes;
mod sticking;
