//! The plant with set-valued laws: against equations written out anew and a method of another kind, and by what must hold.

mod agreement;
mod back_drive;
mod dual;
mod energy;
mod extremes;
mod odometry;
mod reference;
mod scenes;
mod sticking;
