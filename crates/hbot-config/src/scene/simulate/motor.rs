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

/// Motors whose torque constants differ from those that their controllers believe, each by another
/// fraction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TorqueConstants {
    /// Largest error of a motor's constant. A motor makes 1 + error times the torque that its
    /// controller believes; the errors are uniformly distributed between plus and minus this.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub spread: f64,
    /// Seed of the random numbers for the errors.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for TorqueConstants {
    fn default() -> Self {
        // A usual tolerance of small motors in one batch; assumed.
        Self { spread: 0.05, seed: 1 }
    }
}

/// Motors whose magnets pull the rotor towards some angles: a torque that repeats with the angle of
/// the encoder, in two harmonics.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Cogging {
    /// Number of periods of each harmonic in one turn of the encoder.
    #[schemars(inner(range(min = 1, max = 1000)))]
    pub per_turn: [u32; 2],
    /// Largest torque of each harmonic at a steer joint, N m.
    #[schemars(inner(range(min = 0.0, max = 10.0)), extend("unit" = "N m"))]
    pub steer: [f64; 2],
    /// Largest torque of each harmonic at a drive joint, after the gear, N m.
    #[schemars(inner(range(min = 0.0, max = 10.0)), extend("unit" = "N m"))]
    pub drive: [f64; 2],
    /// Seed of the random numbers for the phases, one for each harmonic of each motor.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for Cogging {
    fn default() -> Self {
        Self {
            // The pole pairs of a motor with 14 poles, and its 84 steps with 12 slots; assumed.
            per_turn: [7, 84],
            // 0.3 % and 0.1 % of the prototype's peak torque; assumed.
            steer: [3.0e-3, 1.0e-3],
            // A small motor with an iron-free rotor has almost none; assumed.
            drive: [0.0, 0.0],
            seed: 1,
        }
    }
}
