//! Everything that comes into a tick. A recording of [`Inputs`] (and of the scenes) is the whole truth about a run.

use crate::device::MAX_JOINTS;
use crate::real::{Quat, Real, Vec3};

/// The most commands that one tick takes.
pub const MAX_COMMANDS: usize = 8;

/// What one tick sees of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inputs {
    /// The tick's number; ticks that were skipped leave a gap.
    pub tick: u64,
    /// How long after its deadline the tick started, ns; 0 in virtual time.
    pub lateness_ns: u64,
    /// The newest feedback of all joints that has arrived since the last tick, if any.
    pub feedback: Option<JointFeedback>,
    /// Damaged frames since the last tick.
    pub corrupt_frames: u16,
    /// A controller has rebooted and not yet been described to the host again.
    pub rebooted: bool,
    /// Live commands, in the order of their arrival.
    pub commands: Commands,
}

impl Inputs {
    /// A tick on time to which nothing has come in.
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

/// One reading of all joints, in the order steer, drive of each wheel, in the controllers' own sense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFeedback {
    /// The command that it answers, counted as ticks, wrapping.
    pub sequence: u32,
    /// Encoder counts, wrapping.
    pub counts: [i32; MAX_JOINTS],
    /// Rates of the joints, rad/s.
    pub rates: [Real; MAX_JOINTS],
    /// One bit a joint: its encoder has seen the index.
    pub index_seen: u16,
    /// What the controllers complain of.
    pub complaints: Complaints,
}

/// What motor controllers complain of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Complaints {
    /// A controller reports a fault of its own.
    pub fault: bool,
    /// A controller heard nothing for its watchdog time.
    pub watchdog: bool,
    /// A motor draws more current than it may.
    pub overcurrent: bool,
    /// A motor is too hot.
    pub overtemperature: bool,
    /// Motors are on although the command that is answered switches them off, or off although it
    /// switches them on.
    pub disobeyed: bool,
    /// A current or a temperature is not finite.
    pub not_finite: bool,
}

impl Complaints {
    /// What either complains of.
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

/// At most [`MAX_COMMANDS`] commands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Commands {
    list: [Option<Command>; MAX_COMMANDS],
    len: usize,
}

impl Commands {
    /// Adds a command; gives it back when the tick is full.
    ///
    /// # Errors
    /// The command itself, to be taken by the next tick.
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

    /// How many there are.
    #[inline]
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The commands in order.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = &Command> {
        self.list[..self.len].iter().flatten()
    }
}

/// A live command. Vectors and orientations in N, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Soft start, if every spring's reference is near enough.
    Enable,
    /// To idle over a ramp.
    Disable,
    /// Zero torque in this tick, until reset.
    Estop,
    /// Leave fault or estop once the cause is gone.
    Reset,
    /// A client's own torque, added to the scene's.
    Stream {
        /// N m; finite.
        torque: Vec3,
        /// Ticks for which it holds, this one included.
        valid_ticks: u32,
        /// Where it comes from in the client's view.
        stamp: Stamp,
    },
    /// Moves an effect's reference.
    Reference {
        /// The effect's slot.
        slot: u8,
        /// The effect's epoch: a message to an effect that is gone is refused.
        epoch: u32,
        /// Where to, in N; unit.
        q: Quat,
        /// The rate that the reference is said to have in N, rad/s.
        omega: Vec3,
        /// Ticks for which `omega` holds.
        valid_ticks: u32,
        /// Where it comes from in the client's view.
        stamp: Stamp,
    },
    /// The orientation seen from outside.
    Align {
        /// In N; unit.
        q: Quat,
        /// Part of the difference to take over, 0 to 1; 0 records only.
        weight: Real,
        /// The tick at which it was seen, one of the last [`ALIGN_HISTORY`](crate::controller::ALIGN_HISTORY).
        tick: u64,
    },
    /// The holder of the lease is gone.
    ClientLost(OnClientLost),
}

/// What a stream message says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stamp {
    /// The client's own number for it.
    pub seq: Option<u64>,
    /// The tick of the sample that it was computed from.
    pub tick: Option<u64>,
}

/// What becomes of a rig whose client has gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "schema", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "schema", serde(rename_all = "snake_case"))]
pub enum OnClientLost {
    /// Its stream ramps out, the scene stays.
    Ramp,
    /// Nothing: its stream ends when it expires.
    Keep,
    /// A fault.
    Fault,
}
