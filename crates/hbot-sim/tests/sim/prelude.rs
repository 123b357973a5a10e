//! What most modules of these tests use.

pub(crate) use crate::devices::{brisk, rig, toed};
pub(crate) use crate::line::{MS, command, frame};
pub(crate) use hbot_core::design::device::Device;
pub(crate) use hbot_core::{Quat, Vec3, rotation};
pub(crate) use hbot_link::{FromController, ToController};
pub(crate) use hbot_sim::controller::InjectedFault;
pub(crate) use hbot_sim::phenomena::{CageFriction, Hand, JointFriction, Phenomena, Slip};
pub(crate) use hbot_sim::plant::{Dynamics, Method, Plant, PlantState};
pub(crate) use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
pub(crate) use hbot_testing::prototype::{device, device_with};
