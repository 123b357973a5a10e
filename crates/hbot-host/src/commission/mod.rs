//! Before a rig is used: [`bringup`] finds controllers and moves joints, [`doctor`]
//! checks whether a machine can keep the loop's deadlines, [`expectation`] measures what a rig's
//! methods cost on this machine and how large their error is.

pub mod bringup;
pub mod doctor;
pub mod expectation;
