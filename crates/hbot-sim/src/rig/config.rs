//! The configuration of a simulated rig, and why it can be rejected.

use core::fmt;

use hbot_config::rig::Protocol;
use hbot_core::design::device::Device;
use hbot_core::design::rig::{Compensation, Rig};

use crate::controller::{Lags, Line, SimulatedJoint};
use crate::phenomena::Phenomena;
use crate::plant::{ImpossibleInertia, Method, PlantState};

/// The configuration of a [`SimulatedRig`](crate::rig::SimulatedRig): its geometry, joints, start
/// state and integration method.
#[derive(Debug, Clone)]
pub struct SimulatedConfig {
    /// Protocol of the motor controllers, and whether their line has checksums.
    pub line: Line,
    /// Delays that the settings of the motor controllers cause.
    pub lags: Lags,
    /// Geometry and masses.
    pub device: Device,
    /// Motor and encoder of each joint, in the order steer, drive of each wheel.
    pub joints: Vec<SimulatedJoint>,
    /// State in which the plant starts. Incremental encoders still count from the angle zero.
    pub start: PlantState,
    /// Phenomena of a real rig, such as friction, that are switched on.
    pub phenomena: Phenomena,
    /// What the rig truly is like, as a rig file says it: the friction, torque constants and
    /// cogging of each joint, and friction and imbalance of the sphere. It is added to the
    /// phenomena, and stays when they are replaced.
    pub imperfect: Option<Compensation>,
    /// Integration method of the plant.
    pub method: Method,
    /// Longest step of the plant, ns. A longer interval is divided into equal steps. A value of 0
    /// is treated as 1.
    pub max_step_ns: u64,
    /// Longest interval that the plant is simulated at once, ns.
    ///
    /// If more time has passed (the process was stopped, or the machine slept), the plant skips the
    /// rest. The clock of the motor controllers still jumps to the new time.
    pub max_jump_ns: u64,
}

impl SimulatedConfig {
    /// Returns the configuration of an ideal simulated rig with the geometry and joints of `rig`.
    ///
    /// The plant starts at rest with all angles at zero and without phenomena. It is integrated by
    /// [`Method::Rk4`] in steps of at most 1 ms, and by at most 100 ms at once.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            line: Protocol::Hbot.into(),
            lags: Lags::default(),
            device: rig.device,
            joints: rig.joints[..rig.device.joints()].iter().map(SimulatedJoint::from).collect(),
            start: PlantState::default(),
            phenomena: Phenomena::default(),
            imperfect: None,
            method: Method::default(),
            max_step_ns: 1_000_000,
            max_jump_ns: 100_000_000,
        }
    }
}

/// Why a [`SimulatedConfig`] was rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatedRigError {
    /// No virtual controller speaks this protocol yet.
    Protocol(Protocol),
    /// The inertias of a wheel are physically impossible.
    Inertia(ImpossibleInertia),
    /// The number of joints in the configuration differs from that of the device.
    Joints {
        /// Number of joints in the configuration.
        given: usize,
        /// Number of joints of the device: two for each wheel.
        wanted: usize,
    },
}

impl fmt::Display for SimulatedRigError {
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

impl core::error::Error for SimulatedRigError {}
