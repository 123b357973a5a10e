//! The inputs of a tick. The [`Inputs`] of all ticks and the scenes determine a run completely, so
//! a recording of them is enough to replay it.

use crate::device::MAX_JOINTS;
use crate::real::{Quat, Real, Vec3};

/// Largest number of commands in one tick.
pub const MAX_COMMANDS: usize = 8;

/// All inputs of one tick of the control law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inputs {
    /// Number of the tick. Skipped ticks leave a gap in the numbers.
    pub tick: u64,
    /// Time from the tick's deadline to its start, ns; 0 in virtual time.
    pub lateness_ns: u64,
    /// The newest reading of all joints since the last tick, or `None` if none has arrived.
    pub feedback: Option<JointFeedback>,
    /// Number of damaged frames since the last tick.
    pub corrupt_frames: u16,
    /// True if a motor controller has rebooted and has not described itself to the host again yet.
    pub rebooted: bool,
    /// Live commands, in the order in which they arrived.
    pub commands: Commands,
}

impl Inputs {
    /// Returns the inputs of a tick that is on time and to which nothing has arrived.
    #[must_use]
    pub fn quiet(tick: u64) -> Self {
        Self {
            tick,
            lateness_ns: 0,
            feedback: None,
            corrupt_frames: 0,
            rebooted: false,
            commands: Commands::default(),
        }
    }
}

/// One reading of all joints, in the order steer, drive of each wheel. Signs are those of the motor
/// controllers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFeedback {
    /// Number of the command that the reading answers: the low 32 bits of its tick.
    pub sequence: u32,
    /// Encoder counts. They wrap at 32 bits.
    pub counts: [i32; MAX_JOINTS],
    /// Joint rates, rad/s.
    pub rates: [Real; MAX_JOINTS],
    /// One bit per joint, set if its encoder has seen the index mark.
    pub index_seen: u16,
    /// Faults and warnings that the motor controllers report about themselves.
    pub complaints: Complaints,
}

/// The complaints of motor controllers: faults and warnings that they report about themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Complaints {
    /// A motor controller reports an internal fault.
    pub fault: bool,
    /// A motor controller's watchdog expired, because commands stopped.
    pub watchdog: bool,
    /// A motor draws more current than allowed.
    pub overcurrent: bool,
    /// A motor is too hot.
    pub overtemperature: bool,
    /// The motors are on although the answered command switches them off, or off although it
    /// switches them on.
    pub disobeyed: bool,
    /// A reported current or temperature is not finite.
    pub not_finite: bool,
}

impl Complaints {
    /// Returns the complaints that are in `self`, in `other` or in both.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            fault: self.fault | other.fault,
            watchdog: self.watchdog | other.watchdog,
            overcurrent: self.overcurrent | other.overcurrent,
            overtemperature: self.overtemperature | other.overtemperature,
            disobeyed: self.disobeyed | other.disobeyed,
            not_finite: self.not_finite | other.not_finite,
        }
    }
}

/// A list of at most [`MAX_COMMANDS`] commands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Commands {
    list: [Option<Command>; MAX_COMMANDS],
    len: usize,
}

impl Commands {
    /// Adds a command to the end of the list.
    ///
    /// # Errors
    /// Returns the command if the list is full, so that the next tick can take it.
    pub fn push(&mut self, command: Command) -> Result<(), Command> {
        match self.list.get_mut(self.len) {
            Some(place) => {
                *place = Some(command);
                self.len += 1;
                Ok(())
            }
            None => Err(command),
        }
    }

    /// Returns the number of commands.
    #[inline]
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if there are no commands.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the commands, in the order in which they were added.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = &Command> {
        self.list[..self.len].iter().flatten()
    }
}

/// A live command to the control law. Vectors and orientations are in frame N, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Switches the torque on with a soft start. Refused if an effect's reference is too far from
    /// the present orientation.
    Enable,
    /// Goes to mode `idle` and ramps the torque down to zero.
    Disable,
    /// Stops the torque in this tick. It stays zero until a reset.
    Estop,
    /// Leaves mode `fault` or `estop`. Refused while the cause is still present.
    Reset,
    /// A torque that a client streams. It is added to the scene's torque.
    Stream {
        /// Torque on the sphere, N m; must be finite.
        torque: Vec3,
        /// Number of ticks for which the torque is valid, including this one.
        valid_ticks: u32,
        /// Sequence number of the message and the state that it was computed from, as given by the
        /// client.
        stamp: Stamp,
    },
    /// Moves the reference of an effect.
    Reference {
        /// Slot of the effect.
        slot: u8,
        /// Epoch of the effect. A message to an effect that no longer exists is refused.
        epoch: u32,
        /// New reference orientation in frame N, a unit quaternion.
        q: Quat,
        /// Rate at which the client moves the reference, in frame N, rad/s.
        omega: Vec3,
        /// Number of ticks for which `omega` is valid.
        valid_ticks: u32,
        /// Sequence number of the message and the state that it was computed from, as given by the
        /// client.
        stamp: Stamp,
    },
    /// Corrects the orientation by one that was measured from outside, for example by a camera.
    Align {
        /// Measured orientation in frame N, a unit quaternion.
        q: Quat,
        /// Fraction of the difference that is corrected, 0 to 1. With 0 the difference is only
        /// reported.
        weight: Real,
        /// The tick at which the orientation was measured: one of the last
        /// [`ALIGN_HISTORY`](crate::controller::ALIGN_HISTORY) ticks.
        tick: u64,
    },
    /// Reports that the client that held the lease has gone. The rig reacts as given.
    ClientLost(OnClientLost),
}

/// The labels of a stream message: its sequence number and the tick of the state that it was
/// computed from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stamp {
    /// The client's sequence number of the message.
    pub seq: Option<u64>,
    /// The tick of the state that the client computed the message from.
    pub tick: Option<u64>,
}

/// The reaction of a rig when the client that held the lease has gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum OnClientLost {
    /// The client's stream ramps down to zero. The scene goes on.
    Ramp,
    /// No reaction: the client's stream ends when it expires.
    Keep,
    /// The rig goes to mode `fault`.
    Fault,
}
