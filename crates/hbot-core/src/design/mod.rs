//! The rig as it is built: [`device`] (a valid design, checked over all steer angles),
//! [`kinematics`] (contact frames, the matrix G, forward and inverse kinematics), [`singularity`]
//! (margins and indices) and [`rig`] (the device with its joints, limits and methods).

pub mod device;
pub mod kinematics;
pub mod rig;
pub mod singularity;
