//! The outputs of a tick.

use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::inputs::MAX_COMMANDS;
use crate::mode::{Cause, Mode, Obstacle};
use crate::real::{Quat, Real, Vec3};

/// All outputs of one tick: a command to the motors, replies to commands, and the state to publish.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// The command to the motor controllers.
    pub drive: Drive,
    /// The replies to the tick's commands, in their order.
    pub replies: [Option<Reply>; MAX_COMMANDS],
    /// The state that is published to clients.
    pub state: State,
}

/// The command to the motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// True if the motors are on.
    pub enable: bool,
    /// Torque at each joint, N m, in the direction of its motor controller.
    pub torque: [Real; MAX_JOINTS],
}

/// The reply to a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reply {
    /// The command was executed.
    Done,
    /// An align command was executed.
    Aligned {
        /// Angle between the orientation measured from outside and the odometry, rad.
        angle: Real,
    },
    /// The command was refused, and nothing changed.
    Refused(Refusal),
}

/// The reason why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// The mode does not allow the command.
    Mode(Obstacle),
    /// An effect's reference is too far from the orientation to enable.
    TooFar {
        /// Slot of the effect.
        slot: u8,
        /// Distance of the orientation from where the effect rests, rad.
        angle: Real,
    },
    /// The effect does not exist any more or has no reference.
    NoReference,
    /// The state that the message was computed from is too old.
    TooOld {
        /// Age of that state, ticks.
        age_ticks: u64,
    },
    /// The message names the tick of a state that does not exist yet.
    Ahead {
        /// Number of ticks by which the named tick is in the future.
        ticks: u64,
    },
    /// The named tick is not in the history: too old, or in the future.
    NotInHistory,
    /// A number is not finite or not in its range, or a quaternion is not of unit length.
    NotFinite,
}

/// The state of the rig after a tick. Vectors are in frame N, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Number of the tick.
    pub tick: u64,
    /// Mode of the control law.
    pub mode: Mode,
    /// Cause of the fault, or `None`.
    pub cause: Option<Cause>,
    /// Orientation of the sphere. Its sign is continuous from tick to tick.
    pub q: Quat,
    /// Angular velocity of the sphere in frame N, rad/s.
    pub omega: Vec3,
    /// Reference of the first effect in the scene that has one, as it is in this tick. It maps
    /// sphere axes to frame N. `None` if no effect has a reference.
    pub reference: Option<Quat>,
    /// Torque on the sphere that this tick asks of the motors, in frame N, N m. It was computed
    /// from the `q` of this state.
    pub torque: Vec3,
    /// Number of joints.
    pub joints: usize,
    /// Joint angles within a turn, rad.
    pub angle: [Real; MAX_JOINTS],
    /// Joint rates, rad/s.
    pub rate: [Real; MAX_JOINTS],
    /// Joint torques, N m.
    pub joint_torque: [Real; MAX_JOINTS],
    /// Largest slip of a wheel, m/s.
    pub slip: Real,
    /// Fraction of the wanted torque that the limits of torque, motors and traction left, 0 to 1.
    pub scale: Real,
    /// True if the motors cannot make a part of the wanted torque at this posture, however small.
    pub deficient: bool,
    /// Load |f| / (mu N) of the most loaded contact under the torques sent, 0 to 1. It is 1 if
    /// traction limits the torque, and 0 if the rig has no traction limit.
    pub traction: Real,
    /// Energy given to the hand since the start, J (passivity observer).
    pub energy: Real,
    /// Damping that the passivity controller adds in this tick, N m s/rad; 0 if the rig has no
    /// passivity controller.
    pub damping: Real,
    /// The last stream or reference message that was accepted.
    pub client: Option<Client>,
    /// True if this tick took a new reading.
    pub fresh: bool,
}

/// The last stream or reference message that was accepted from a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Client {
    /// The client's sequence number of the message.
    pub seq: Option<u64>,
    /// Age in ticks of the state that the message was computed from. If the message names none,
    /// ticks since it was accepted.
    pub age_ticks: u64,
}

/// Slip of each wheel along c1 and c2, m/s.
pub(crate) type Slip = [[Real; 2]; MAX_WHEELS];
