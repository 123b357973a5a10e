//! The inputs of a tick. The [`Inputs`] of all ticks and the scenes determine a run completely, so
//! a recording of them is enough to replay it.

use crate::design::device::MAX_JOINTS;
use crate::real::{Quat, Real, Vec3};
use crate::render::model::LocalModel;

/// Largest number of commands that one tick can take.
pub const MAX_COMMANDS: usize = 8;

/// All inputs of one tick of the control law.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Inputs {
    /// Number of the tick. If ticks are skipped, their numbers are skipped too.
    pub tick: u64,
    /// Time from the tick's deadline to its start, ns; 0 in a run in virtual time.
    pub lateness_ns: u64,
    /// The newest reading of all joints that has arrived since the last tick, or `None` if none has
    /// arrived.
    pub feedback: Option<JointReadings>,
    /// Number of damaged frames received since the last tick.
    pub corrupt_frames: u16,
    /// True if a motor controller has rebooted and has not described itself to the host again yet.
    pub rebooted: bool,
    /// Commands of clients that arrived for this tick, in the order of arrival.
    pub commands: Commands,
}

impl Inputs {
    /// Returns the inputs of tick `tick` if it is on time and nothing has arrived: no reading, no
    /// damaged frames, no commands.
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

/// One reading of all joints, in the order steer, drive of each wheel. All signs follow the motor
/// controllers' directions.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct JointReadings {
    /// Number of the command that this reading answers: the low 32 bits of the number of the tick
    /// that sent the command.
    pub sequence: u32,
    /// Encoder counts of the joints. They wrap at 32 bits.
    pub counts: [i32; MAX_JOINTS],
    /// Joint rates that the motor controllers report, rad/s.
    pub rates: [Real; MAX_JOINTS],
    /// One bit per joint. It is set if the joint's encoder has passed its index mark.
    pub index_seen: u16,
    /// Faults and warnings that the motor controllers report about themselves.
    pub complaints: Complaints,
}

impl JointReadings {
    /// Returns a reading with the number `sequence`, encoder counts, and joint rates in rad/s. No
    /// index mark was seen, and there are no complaints.
    #[must_use]
    pub const fn new(sequence: u32, counts: [i32; MAX_JOINTS], rates: [Real; MAX_JOINTS]) -> Self {
        Self { sequence, counts, rates, index_seen: 0, complaints: Complaints::NONE }
    }
}

/// The complaints of motor controllers: faults and warnings that they report about themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
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
    /// A reported rate, current or temperature is not finite.
    pub not_finite: bool,
}

impl Complaints {
    /// No complaint.
    pub const NONE: Self = Self {
        fault: false,
        watchdog: false,
        overcurrent: false,
        overtemperature: false,
        disobeyed: false,
        not_finite: false,
    };

    /// Returns the complaints that are present in `self`, in `other`, or in both.
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
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Commands {
    list: [Option<Command>; MAX_COMMANDS],
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, MAX_COMMANDS>"))]
    len: usize,
    /// The body of the last [`Command::Model`] in the list. The commands before it have none, since
    /// only the newest model of a tick counts. It is kept once, because it is as large as all other
    /// commands of a tick.
    model: Option<LocalModel>,
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

    /// Adds a command to the end of the list that replaces the client's model by `model`. Of
    /// several models in one tick only the last acts.
    ///
    /// # Errors
    /// Returns the command if the list is full, so that the next tick can take it.
    pub fn push_model(&mut self, command: ModelCommand, model: &LocalModel) -> Result<(), Command> {
        self.push(Command::Model(command))?;
        self.model = Some(*model);
        Ok(())
    }

    /// Returns the model of the command at the place `index` in the list. `None` if the command is
    /// no [`Command::Model`], or if a later one has replaced its model.
    #[must_use]
    pub fn model(&self, index: usize) -> Option<&LocalModel> {
        let is_model = |command: &Option<Command>| matches!(command, Some(Command::Model(_)));
        let last = self.list[..self.len].iter().rposition(is_model);
        self.model.as_ref().filter(|_| last == Some(index))
    }

    /// Returns the number of commands.
    #[inline]
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if the list contains no commands.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns an iterator over the commands, in the order in which they were added.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = &Command> {
        self.list[..self.len].iter().flatten()
    }
}

/// A command of a client to the control law. Vectors and orientations are in frame N, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Command {
    /// Switches the torque on with a soft start. Refused if the sphere is too far from an
    /// orientation at which the effects rest.
    Enable,
    /// Goes to mode `idle` and ramps the torque down to zero.
    Disable,
    /// Emergency stop: sets the torque to zero in this tick. It stays zero until a reset.
    Estop,
    /// Leaves mode `fault` or `estop`. Refused while the cause of the fault is still present.
    Reset,
    /// A torque that a client streams. It is added to the scene's torque.
    Stream {
        /// Torque on the sphere in frame N, in N m. It must be finite.
        torque: Vec3,
        /// Number of ticks for which the torque is valid, including this one.
        valid_ticks: u32,
        /// Labels of the message from the client: its sequence number, and the tick of the state
        /// from which it was computed.
        stamp: Stamp,
    },
    /// Moves the reference orientation of an effect.
    Reference {
        /// Index of the effect's memory (see
        /// [`Effect::slot`](crate::render::effects::Effect::slot)).
        slot: u8,
        /// Number that identifies the effect (see
        /// [`Effect::epoch`](crate::render::effects::Effect::epoch)). The command is refused if the
        /// scene no longer contains this effect.
        epoch: u32,
        /// New reference orientation in frame N, a unit quaternion.
        q: Quat,
        /// Angular velocity at which the client moves the reference, in frame N, in rad/s.
        omega: Vec3,
        /// Number of ticks for which the angular velocity `omega` is valid.
        valid_ticks: u32,
        /// Labels of the message from the client: its sequence number, and the tick of the state
        /// from which it was computed.
        stamp: Stamp,
    },
    /// Corrects the sphere's orientation with one that was measured independently, for example by a
    /// camera.
    Align {
        /// Measured orientation of the sphere in frame N, a unit quaternion.
        q: Quat,
        /// Fraction of the difference by which the orientation is corrected, 0 to 1. With 0, the
        /// difference is only reported.
        weight: Real,
        /// The tick at which the orientation was measured. It must be one of the last
        /// [`ALIGN_HISTORY`](crate::controller::ALIGN_HISTORY) ticks.
        tick: u64,
    },
    /// Reports that a client no longer holds the lease, for example because its connection ended.
    /// The value says how the rig reacts.
    ClientLost(OnClientLost),
    /// Corrects the sphere's orientation with one that was measured independently, as far as its
    /// uncertainty and that of the rig's own estimate say. A measurement that is too far from the
    /// estimate is not used.
    AlignBySigma {
        /// Measured orientation of the sphere in frame N, a unit quaternion.
        q: Quat,
        /// Standard deviations of its error about the axes of frame N, rad, each 1e-5 to pi.
        sigma: Vec3,
        /// Weight of the measurement, 0 to 1: its variances are divided by it. With 0, the
        /// difference is only reported.
        weight: Real,
        /// The tick at which the orientation was measured. It must be one of the last
        /// [`ALIGN_HISTORY`](crate::controller::ALIGN_HISTORY) ticks.
        tick: u64,
    },
    /// Corrects the sphere's orientation with a direction that was measured independently, for
    /// example that of gravity by a sensor in the sphere. It says nothing about the turn around it.
    AlignDirection {
        /// The direction in the sphere's axes, a unit vector.
        body: Vec3,
        /// The same direction in frame N, a unit vector.
        world: Vec3,
        /// Standard deviation of the error about each axis across the direction, rad, 1e-5 to pi.
        sigma: Real,
        /// The tick at which the direction was measured, as in `AlignBySigma`.
        tick: u64,
    },
    /// A local model that a client streams (see [`render::model`](crate::render::model)). Its
    /// torque is added to the scene's torque. [`Commands::push_model`] adds it together with the
    /// model.
    Model(ModelCommand),
    /// Has no effect. Its answer tells a client the mode, after a stop that did not come as a
    /// command.
    Confirm,
}

/// What a client says about a model that it streams.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct ModelCommand {
    /// Number of ticks for which the model is valid, including this one.
    pub valid_ticks: u32,
    /// Number of ticks in which the torque blends into that of this model. `None` is the time since
    /// the last model, at most 50 ms.
    pub blend_ticks: Option<u32>,
    /// Labels of the message from the client: its sequence number, and the tick of the state from
    /// which it was computed.
    pub stamp: Stamp,
}

/// Labels that a client gives to a message of a stream: a sequence number, and the tick of the
/// state from which the client computed the message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Stamp {
    /// Sequence number that the client has given to the message, if any.
    pub seq: Option<u64>,
    /// Number of the tick whose state the client used to compute the message, if given.
    pub tick: Option<u64>,
}

/// The reaction of a rig when the client that held the lease no longer holds it, for example
/// because its connection ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(any(feature = "schema", feature = "exact"), derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(any(feature = "schema", feature = "exact"), serde(rename_all = "snake_case"))]
pub enum OnClientLost {
    /// The torque that the client streams ramps down to zero. The scene goes on.
    Ramp,
    /// No reaction: the torque that the client streams ends when its validity expires.
    Keep,
    /// The rig goes to mode `fault`, in which the torque is off.
    Fault,
}
