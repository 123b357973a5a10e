//! Motors that are not quite what is asked of them.

/// The motors of all joints. Peak and continuous torque are each joint's own, from the rig file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// The torque that there is over the torque that the controller believes to give: an error of the torque constant, 0
    /// to 2; default 0.95, which explains the paper's table III, 5 % too soft whatever the stiffness.
    pub torque_scale: f64,
    /// Time constant of the current loop, s, 0 to 0.1; default 5e-4 (physics notes, section 8).
    pub lag_s: f64,
    /// The rate of a steering joint at which its back-EMF leaves no torque to drive it on, rad/s, 1e-3 to 1e5; default
    /// 500: about 5000 turns a minute, usual of flat brushless motors that stall at near 1 N m, at the joint without a
    /// gear; assumed.
    pub steer_no_load_rate: f64,
    /// The same of a drive joint; default 60: about 10,000 turns a minute, usual of 3 W motors, through 17:1; assumed.
    pub drive_no_load_rate: f64,
    /// Time constant with which the windings warm, s, 1e-3 to 1e5; default 10, usual of windings of this size (the
    /// housing's is of minutes); assumed.
    pub thermal_time_s: f64,
}

impl Default for Motor {
    fn default() -> Self {
        Self {
            torque_scale: 0.95,
            lag_s: 5.0e-4,
            steer_no_load_rate: 500.0,
            drive_no_load_rate: 60.0,
            thermal_time_s: 10.0,
        }
    }
}
