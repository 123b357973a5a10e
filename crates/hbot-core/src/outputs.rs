//! Everything that comes out of a tick.

use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::inputs::MAX_COMMANDS;
use crate::mode::{Cause, Mode, Obstacle};
use crate::real::{Quat, Real, Vec3};

/// What one tick gives: a command to the motors, answers, and the state to publish.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For the motor controllers.
    pub drive: Drive,
    /// One for each of the tick's commands, in their order.
    pub replies: [Option<Reply>; MAX_COMMANDS],
    /// For everybody else.
    pub state: State,
}

/// What the motors are to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Whether they may push at all.
    pub enable: bool,
    /// Torque at each joint in its controller's own sense, N m.
    pub torque: [Real; MAX_JOINTS],
}

/// The answer to a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reply {
    /// Done.
    Done,
    /// Done: the outside orientation was this far away, rad.
    Aligned {
        /// The angle between outside orientation and odometry, rad.
        angle: Real,
    },
    /// Not done; nothing changed.
    Refused(Refusal),
}

/// Why a command was not done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// The mode does not allow it.
    Mode(Obstacle),
    /// An effect's reference is too far from the orientation to enable.
    TooFar {
        /// The effect's slot.
        slot: u8,
        /// How far, rad.
        angle: Real,
    },
    /// The effect is gone, or has no reference.
    NoReference,
    /// The sample that it was computed from is too old.
    TooOld {
        /// How old, ticks.
        age_ticks: u64,
    },
    /// The sample that it names has not been made yet.
    Ahead {
        /// How far in the future its tick is, ticks.
        ticks: u64,
    },
    /// That moment is no longer (or not yet) in the history.
    NotInHistory,
    /// A number is not finite, or a quaternion not unit.
    NotFinite,
}

/// What a tick publishes of itself. Vectors in N, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// The tick's number.
    pub tick: u64,
    /// What the rig may do.
    pub mode: Mode,
    /// Why it is in fault.
    pub cause: Option<Cause>,
    /// Orientation; its sign is continuous.
    pub q: Quat,
    /// Angular velocity in N, rad/s.
    pub omega: Vec3,
    /// Where the first effect of the scene that has a reference is to bring the sphere: its reference as it stands in this
    /// tick, anchored and moved, sphere axes to N. `None` where no effect has one.
    pub reference: Option<Quat>,
    /// The torque that this tick asks of the motors, on the sphere, in N, N m. It belongs to this `q`.
    pub torque: Vec3,
    /// How many joints there are.
    pub joints: usize,
    /// Joint angles within a turn, rad.
    pub angle: [Real; MAX_JOINTS],
    /// Joint rates, rad/s.
    pub rate: [Real; MAX_JOINTS],
    /// Joint torques, N m.
    pub joint_torque: [Real; MAX_JOINTS],
    /// The largest slip of a wheel, m/s.
    pub slip: Real,
    /// What the limits of torque, motors and traction left of the torque wanted, 0 to 1.
    pub scale: Real,
    /// The motors cannot make a part of the torque that was wanted, whatever its size.
    pub deficient: bool,
    /// The largest |f| / (mu N) of a contact under the torques sent, 0 to 1; 1 where it limits them; 0 where the rig's
    /// traction is not known.
    pub traction: Real,
    /// Energy given out, J (passivity observer).
    pub energy: Real,
    /// The damping that the passivity controller adds in this tick, N m s/rad; 0 where the rig has none.
    pub damping: Real,
    /// The last stream message that was taken.
    pub client: Option<TakenStream>,
    /// Whether this tick took new feedback.
    pub fresh: bool,
}

/// The last stream message that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TakenStream {
    /// The client's own number for it.
    pub seq: Option<u64>,
    /// Ticks since the sample that it was computed from, where it names one, or else since it was taken.
    pub age_ticks: u64,
}

/// Slip of each wheel along c1 and c2, m/s.
pub(crate) type Slip = [[Real; 2]; MAX_WHEELS];
