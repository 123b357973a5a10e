//! Motors that are not quite what is asked of them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Motors that are weak, lag, slow down and get hot. Peak and continuous torque are those of the rig file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Motor {
    /// Torque that there is over the torque asked for.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub torque_scale: f64,
    /// Time constant of the current loop, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub lag_s: f64,
    /// Rate of a steering joint at which back-EMF leaves no torque to drive it on, rad/s.
    #[schemars(range(min = 1.0e-3, max = 1.0e5), extend("unit" = "rad/s"))]
    pub steer_no_load_rate: f64,
    /// The same of a drive joint, after the gear, rad/s.
    #[schemars(range(min = 1.0e-3, max = 1.0e5), extend("unit" = "rad/s"))]
    pub drive_no_load_rate: f64,
    /// Time constant with which windings warm, s; a hot motor gives its continuous torque.
    #[schemars(range(min = 1.0e-3, max = 1.0e5), extend("unit" = "s"))]
    pub thermal_time_s: f64,
}

impl Default for Motor {
    fn default() -> Self {
        Self {
            // Explains the paper's table III, 5 % too soft whatever the stiffness.
            torque_scale: 0.95,
            // Physics notes, section 8.
            lag_s: 5.0e-4,
            // About 5000 turns a minute, usual of flat brushless motors that stall at near 1 N m, at
            // the joint without a gear; assumed.
            steer_no_load_rate: 500.0,
            // About 10,000 turns a minute, usual of 3 W motors, through 17:1; assumed.
            drive_no_load_rate: 60.0,
            // Usual of windings of this size (the housing's is of minutes); assumed.
            thermal_time_s: 10.0,
        }
    }
}
