//! The outputs of a tick.

use crate::design::device::{MAX_JOINTS, MAX_WHEELS};
use crate::inputs::MAX_COMMANDS;
use crate::real::{Quat, Real, Vec3};
use crate::safety::mode::{Cause, Mode, Obstacle};
use crate::safety::shaking::Shaking;

/// All outputs of one tick: the command to the motors, the replies to clients' commands, and the
/// state to publish.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Outputs {
    /// The command to the motors.
    pub drive: Drive,
    /// The replies to the commands of the tick, in the order of the commands.
    pub replies: [Option<Reply>; MAX_COMMANDS],
    /// The state of the rig, which is published to clients.
    pub state: State,
}

/// The command to all motors for one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Drive {
    /// True if the motors are on.
    pub enable: bool,
    /// Torque at each joint, N m. The sign is that of the joint's motor controller.
    pub torque: [Real; MAX_JOINTS],
}

/// The reply to a client's command.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Reply {
    /// The command was executed.
    Done,
    /// An `Align` command was executed.
    Aligned {
        /// Angle between the orientation in the command and the rig's own estimate for the same
        /// tick, rad.
        angle: Real,
    },
    /// The command was refused, and nothing changed. The value gives the reason.
    Refused(Refusal),
    /// An `AlignBySigma` or `AlignDirection` command was executed.
    Measured {
        /// Angle between the measurement and the rig's own estimate for the same tick, rad.
        angle: Real,
        /// False if the measurement was too far from the estimate, or its weight is 0. The
        /// orientation is then not corrected.
        used: bool,
    },
}

/// The reason why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Refusal {
    /// The present mode does not allow the command.
    Mode(Obstacle),
    /// The sphere is too far from an orientation at which an effect rests, so `enable` is refused.
    TooFar {
        /// Index of the effect's memory (see
        /// [`Effect::slot`](crate::render::effects::Effect::slot)).
        slot: u8,
        /// Distance between the sphere's orientation and the nearest one at which the effect rests,
        /// rad.
        angle: Real,
    },
    /// The effect that the command names is not in the scene, or has no reference orientation.
    NoReference,
    /// The client computed the message from a state that is too old.
    TooOld {
        /// Age of that state, in ticks.
        age_ticks: u64,
    },
    /// The client claims to have computed the message from the state of a tick that has not
    /// happened yet.
    Ahead {
        /// How far the tick that the client named is in the future, in ticks.
        ticks: u64,
    },
    /// The tick that an `Align` command names is not in the history: it is too old, or in the
    /// future.
    NotInHistory,
    /// A number is not finite or outside of its range, or a quaternion is not of unit length.
    NotFinite,
}

/// The state of the rig after a tick. Vectors are in frame N, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    /// Number of the tick.
    pub tick: u64,
    /// Present mode of the control law.
    pub mode: Mode,
    /// Cause of the fault, or `None` if the rig is not in a fault.
    pub cause: Option<Cause>,
    /// Orientation of the sphere, which maps sphere axes to frame N. The sign of the quaternion
    /// does not jump from tick to tick.
    pub q: Quat,
    /// Angular velocity of the sphere in frame N, rad/s.
    pub omega: Vec3,
    /// Present reference orientation of the first effect in the scene that has one. It maps sphere
    /// axes to frame N. `None` if no effect has a reference.
    pub reference: Option<Quat>,
    /// Torque on the sphere in frame N, in N m, that the motors are commanded to make from this
    /// tick on. It was computed from the orientation `q` of this state.
    pub torque: Vec3,
    /// Number of joints of the rig.
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, MAX_JOINTS>"))]
    pub joints: usize,
    /// Joint angles within a turn, rad, in the order steer, drive of each wheel.
    pub angle: [Real; MAX_JOINTS],
    /// Joint rates, rad/s, in the order steer, drive of each wheel.
    pub rate: [Real; MAX_JOINTS],
    /// Joint torques, N m, in the order steer, drive of each wheel.
    pub joint_torque: [Real; MAX_JOINTS],
    /// Slip of the wheel that slips most, m/s.
    pub slip: Real,
    /// Fraction of the wanted torque that remains after the limits of torque, motors and traction,
    /// 0 to 1.
    pub scale: Real,
    /// True if a component of the wanted torque was left out or reduced, because the motors cannot
    /// make it at this posture.
    pub deficient: bool,
    /// Load of the most loaded contact: its force |f| divided by the force mu N that it can hold, 0
    /// to 1. It is 1 if traction limits the torque, and 0 if the rig has no traction limit.
    pub traction: Real,
    /// Energy that the rig has given to the hand since the start, J. The passivity observer
    /// computes it; it is negative if more was absorbed.
    pub energy: Real,
    /// Damping that the passivity controller adds in this tick, N m s/rad. 0 if the rig has no
    /// passivity controller.
    pub damping: Real,
    /// The last streamed message that was accepted from a client; `None` if there was none.
    pub client: Option<TakenStream>,
    /// True if this tick took a new reading.
    pub fresh: bool,
    /// What the guard against a sphere that shakes by itself has found, while it lowers the torque.
    pub shaking: Option<Shaking>,
    /// How far ahead of the reading the scene was rendered, us. 0 if it was rendered at the
    /// measured pose `q`, or not at all.
    pub lead_us: Real,
    /// Standard deviations of the error of `q` about the axes of frame N, rad, by the rig's own
    /// estimate. `None` until a measurement with a sigma has been taken.
    pub sigma: Option<Vec3>,
}

/// Labels of the last message of a torque or reference stream that was accepted from a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct TakenStream {
    /// Sequence number that the client has given to the message, if any.
    pub seq: Option<u64>,
    /// Age, in ticks, of the state from which the client computed the message. If the message names
    /// no state, the number of ticks since the message was accepted.
    pub age_ticks: u64,
}

/// Slip velocity of each wheel along its contact directions c1 and c2, m/s.
pub(crate) type Slip = [[Real; 2]; MAX_WHEELS];
