//! The state table: what the rig may do, and what moves it from one mode to the next.

use crate::real::Real;

/// How long the soft start takes, s.
pub const SOFT_START_S: Real = 0.5;
/// How long the ramp to zero takes at disable, s.
pub const DISABLE_RAMP_S: Real = 0.05;

/// What the rig may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Homing is not done, as a steering zero is not known: no torque. Leaves to idle once all are known.
    Unreferenced,
    /// Ready, no torque (or its last 50 ms). Leaves to enabling by enable.
    Idle,
    /// Torque fades in over half a second. Leaves to active by itself, to idle by disable.
    Enabling,
    /// Rendering. Leaves to idle by disable.
    Active,
    /// Something went wrong: zero torque. Leaves by reset once the cause is gone, to idle or (if not homed) to unreferenced.
    Fault,
    /// Somebody stopped it: zero torque. Leaves like a fault.
    Estop,
}

/// Why the rig went to [`Mode::Fault`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// No feedback for `timeout_ticks`, feedback that is older or mostly missing, or a controller ran out
    /// of its watchdog time.
    LinkLost,
    /// Too many frames damaged.
    LinkCorrupt,
    /// A controller says so, it has rebooted, or its motors are on or off against the command.
    ControllerFault,
    /// The powered sphere turns faster than the rig's limit.
    Overspeed,
    /// A controller reports more current than it may, or more energy was given out than the rig's limit.
    Overtorque,
    /// The powered wheels slip faster than the rig's limit.
    Slip,
    /// A number that is not finite, in feedback or in a torque.
    NonFinite,
    /// A joint moved further between two readings than it can, or its counts and rates disagreed for 50 ms.
    ImplausibleFeedback,
    /// A tick came more than 20 ms late, or 10 in a row were skipped.
    Deadline,
    /// The holder of the lease has gone, and the rig file says that this is a fault.
    ClientLost,
    /// A motor is too hot.
    Thermal,
}

impl Cause {
    /// All causes.
    pub const ALL: [Self; 11] = [
        Self::LinkLost,
        Self::LinkCorrupt,
        Self::ControllerFault,
        Self::Overspeed,
        Self::Overtorque,
        Self::Slip,
        Self::NonFinite,
        Self::ImplausibleFeedback,
        Self::Deadline,
        Self::ClientLost,
        Self::Thermal,
    ];
}

/// The mode with its cause and the factor on torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ModeMachine {
    pub(crate) mode: Mode,
    pub(crate) cause: Option<Cause>,
    /// 0 to 1: soft start and disable ramp.
    pub(crate) gain: Real,
    /// The fault condition of the last tick: an event is its rise.
    present: Option<Cause>,
}

/// Why `enable` or `reset` was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// A fault, or its cause at reset, is there.
    Faulted(Cause),
    /// The rig is stopped: reset first.
    Stopped,
    /// A steering zero is not known.
    Unreferenced,
}

impl ModeMachine {
    pub(crate) const START: Self = Self { mode: Mode::Unreferenced, cause: None, gain: 0.0, present: None };

    /// Whether motors may push.
    #[inline]
    pub(crate) fn powered(&self) -> bool {
        self.gain > 0.0 || matches!(self.mode, Mode::Enabling | Mode::Active)
    }

    /// Leaves `unreferenced`: the steering zeros are known.
    pub(crate) fn end_homing(&mut self) {
        if self.mode == Mode::Unreferenced {
            self.mode = Mode::Idle;
        }
    }

    /// What stands against enabling, if anything.
    pub(crate) fn obstacle(&self) -> Option<Obstacle> {
        match (self.mode, self.cause) {
            (Mode::Fault, cause) => Some(Obstacle::Faulted(cause.unwrap_or(Cause::ControllerFault))),
            (Mode::Estop, _) => Some(Obstacle::Stopped),
            (Mode::Unreferenced, _) => Some(Obstacle::Unreferenced),
            _ => None,
        }
    }

    /// Enable, once nothing stands against it; when enabled already nothing changes.
    pub(crate) fn enable(&mut self) {
        if self.mode == Mode::Idle {
            self.mode = Mode::Enabling;
        }
    }

    pub(crate) fn disable(&mut self) {
        if matches!(self.mode, Mode::Enabling | Mode::Active) {
            self.mode = Mode::Idle;
        }
    }

    pub(crate) fn estop(&mut self) {
        self.mode = Mode::Estop;
        self.cause = None;
        self.gain = 0.0;
    }

    /// To idle, or to unreferenced if the rig is not `homed`, once the cause is gone; when nothing is wrong nothing changes.
    pub(crate) fn reset(&mut self, homed: bool) -> Result<(), Obstacle> {
        if !matches!(self.mode, Mode::Fault | Mode::Estop) {
            return Ok(());
        }
        if let Some(cause) = self.present {
            return Err(Obstacle::Faulted(cause));
        }
        self.mode = if homed { Mode::Idle } else { Mode::Unreferenced };
        self.cause = None;
        Ok(())
    }

    /// Takes the tick's fault condition, if there is one. Its rise is the event that ends in fault from any mode; while
    /// it lasts no mode but fault and estop is possible. The first cause stands until reset.
    pub(crate) fn take_condition(&mut self, present: Option<Cause>) {
        let rises = present.is_some() && present != self.present;
        self.present = present;
        let Some(cause) = present else { return };
        match self.mode {
            Mode::Fault => {}
            Mode::Estop if !rises => {}
            _ => {
                self.mode = Mode::Fault;
                self.cause = Some(cause);
            }
        }
        self.gain = 0.0;
    }

    /// Begins the soft start again, in the mode that it is in.
    pub(crate) fn soften(&mut self) {
        self.gain = 0.0;
    }

    /// Moves the gain on by `dt` seconds.
    #[inline]
    pub(crate) fn ramp(&mut self, dt: Real) {
        match self.mode {
            Mode::Enabling | Mode::Active => {
                if self.gain < 1.0 {
                    self.gain += dt * (1.0 / SOFT_START_S);
                }
                if self.gain >= 1.0 {
                    self.gain = 1.0;
                    self.mode = Mode::Active;
                }
            }
            Mode::Idle => self.gain = (self.gain - dt * (1.0 / DISABLE_RAMP_S)).max(0.0),
            Mode::Unreferenced | Mode::Fault | Mode::Estop => self.gain = 0.0,
        }
    }
}
