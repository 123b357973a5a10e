//! What keeps the hand safe, whatever the scene asks for: the state machine with every cause of a
//! fault ([`mode`]), the watch on counts, sums of heat and energy, the stage that keeps the sphere
//! passive, the guard against [`shaking`], and the limits of size and slew of the torque.

pub(crate) mod burst;
pub(crate) mod falling;
pub(crate) mod heat;
pub mod mode;
pub(crate) mod passivity;
pub mod shaking;
pub(crate) mod shaping;
pub(crate) mod watch;
