//! Finds the true geometry of a rig in its own encoder counts.
//!
//! A sphere that does not slip has three speeds, and n wheels have 2n joints. So the joints
//! contradict each other unless axes, cones, toes, radii and steering zeros are right. A person
//! turns the sphere with motors off, and this crate finds the numbers with which the contradiction
//! vanishes (docs/identify.md).
//!
//! | module | what it does |
//! |---|---|
//! | [`recording`] | reads the counts of a recording, as long as the motors do not push |
//! | [`motion`] | the motion of the joints, cut into short windows |
//! | [`parameter`] | the unknowns, and how far a rig can be from its drawing |
//! | [`model`] | the joint motion that no turn of the sphere explains, and its derivatives |
//! | [`fit`] | the unknowns that explain the motion best, and their covariance |
//! | [`compare`] | drift and torque of a geometry that was found, against the true one |
//! | [`motors`] | torque constants, friction and more, from a motion under known torques |
//! | [`mod@calibrate`] | wrong signs, zeros far off, exchanged joints |
//! | [`mod@identify`] | all of it: the values for the rig file, or why there are none |
//!
//! It is a library for tools. The control loop does not link it.

pub mod calibrate;
pub mod compare;
pub mod fit;
pub mod identify;
mod interval;
mod matrix;
pub mod model;
pub mod motion;
pub mod motors;
pub mod parameter;
pub mod recording;

pub use identify::{Identified, Refusal, What, identify};
pub use recording::{Recorded, RecordedError};
