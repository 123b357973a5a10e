//! Tests each phenomenon alone against its formula, and the ideal rig without phenomena.

mod encoder;
mod link;
mod motor;
mod none;
mod shafts;
