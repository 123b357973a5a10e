//! Simulated imperfections of the motors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rig::USUAL_LAG_S;

/// Motors that are not ideal. They make less torque than commanded, respond late, lose torque at
/// high speed, and give only their continuous torque when they are hot. Their peak and continuous
/// torques are those of the rig file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Motor {
    /// Actual torque divided by the commanded torque.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub torque_scale: f64,
    /// Time constant with which the torque follows the command, because of the motor's current
    /// loop, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub lag_s: f64,
    /// Rate of a steer joint at which its motor gives no more torque in the direction of motion,
    /// because of back-EMF, rad/s.
    #[schemars(range(min = 1.0e-3, max = 1.0e5), extend("unit" = "rad/s"))]
    pub steer_no_load_rate: f64,
    /// Rate of a drive joint, after the gear, at which its motor gives no more torque in the
    /// direction of motion, because of back-EMF, rad/s.
    #[schemars(range(min = 1.0e-3, max = 1.0e5), extend("unit" = "rad/s"))]
    pub drive_no_load_rate: f64,
    /// Time constant with which the windings warm up, s. A hot motor gives only its continuous
    /// torque.
    #[schemars(range(min = 1.0e-3, max = 1.0e5), extend("unit" = "s"))]
    pub thermal_time_s: f64,
}

impl Default for Motor {
    fn default() -> Self {
        Self {
            // Explains the paper's table III, where all stiffnesses are 5 % too soft.
            torque_scale: 0.95,
            // The simulated motors are as late as those of a rig file that does not say it.
            lag_s: USUAL_LAG_S,
            // About 5000 turns per minute, without a gear. Usual for flat brushless motors with a
            // stall torque near 1 N m; assumed.
            steer_no_load_rate: 500.0,
            // About 10,000 turns per minute, through a gear of 17:1. Usual for 3 W motors; assumed.
            drive_no_load_rate: 60.0,
            // Usual for windings of this size; assumed. The housing takes minutes.
            thermal_time_s: 10.0,
        }
    }
}
