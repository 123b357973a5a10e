//! What a simulated rig is made of, and why there may be none.

use core::fmt;

use hbot_config::rig::Protocol;
use hbot_core::device::Device;
use hbot_core::rig::Rig;

use crate::controller::SimulatedJoint;
use crate::phenomena::Phenomena;
use crate::plant::{ImpossibleInertia, Method, State};

/// What a simulated rig is made of.
#[derive(Debug, Clone)]
pub struct RigConfig {
    /// What its controllers speak.
    pub protocol: Protocol,
    /// Geometry and masses.
    pub device: Device,
    /// One a joint, in the order steer, drive of each wheel.
    pub joints: Vec<SimulatedJoint>,
    /// Where the plant starts; incremental encoders count from the angle zero nevertheless.
    pub start: State,
    /// What it shows of a real rig.
    pub phenomena: Phenomena,
    /// How the plant is moved on.
    pub method: Method,
    /// The longest step of the plant, ns; a longer interval is divided into equal steps. 0 counts as 1.
    pub max_step_ns: u64,
    /// The most that is simulated at once, ns. Where more time has passed (a process stopped, a machine asleep) the
    /// rest is left out: the controllers' clock jumps, the plant's does not.
    pub max_jump_ns: u64,
}

impl RigConfig {
    /// The rig as the controller knows it, with controllers of hbot's own protocol: at rest at zero, without phenomena, [`Method::Rk4`] in steps of at most
    /// 1 ms, at most 100 ms at once.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            protocol: Protocol::Hbot,
            device: rig.device,
            joints: rig.joints[..rig.device.joints()].iter().map(SimulatedJoint::from).collect(),
            start: State::default(),
            phenomena: Phenomena::default(),
            method: Method::default(),
            max_step_ns: 1_000_000,
            max_jump_ns: 100_000_000,
        }
    }
}

/// Why there is no such rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigError {
    /// No virtual controller speaks this protocol yet.
    Protocol(Protocol),
    /// The device's inertias contradict each other.
    Inertia(ImpossibleInertia),
    /// The joints are not as many as the device's.
    Joints {
        /// How many there are.
        given: usize,
        /// How many the device has: two a wheel.
        wanted: usize,
    },
}

impl fmt::Display for RigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Protocol(protocol) => {
                write!(
                    f,
                    "simulated rig: it has no controllers that speak {}; set link.protocol",
                    protocol.name()
                )
            }
            Self::Inertia(error) => write!(f, "simulated rig: {error}"),
            Self::Joints { given, wanted } => {
                write!(
                    f,
                    "simulated rig: {given} joints; its device has {wanted}, steer and drive of each wheel"
                )
            }
        }
    }
}

impl core::error::Error for RigError {}
