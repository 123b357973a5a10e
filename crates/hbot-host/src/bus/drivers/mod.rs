//! The drivers: one for each protocol that motor controllers speak.

pub mod hbot;
pub mod moteus;
pub mod odrive;
