//! The motor controllers of a rig as one set of joints: [`attach`] turns a rig file into motor
//! buses, [`layout`] maps each joint of the rig to its place on a bus, [`mod@motors`] presents all
//! buses as one, [`controllers`] says where they lead. [`built`] simulates a rig that is not as its
//! file says. [`host`] starts and stops all parts
//! together. [`last_word`] is a helper process that switches the motors off if this process dies.

pub mod attach;
pub mod built;
pub mod controllers;
pub mod host;
pub mod last_word;
pub mod layout;
pub mod motors;
