//! The state machine: the modes of the rig and the transitions between them.

use crate::real::Real;

/// Duration of the soft start, s.
pub const SOFT_START_S: Real = 0.5;
/// Duration of the ramp to zero at disable, s.
pub const DISABLE_RAMP_S: Real = 0.05;

/// The mode of the control law. It decides whether the motors make torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// A steer zero is not known yet, so there is no torque. Changes to `Idle` when all zeros are
    /// known (homing).
    Unreferenced,
    /// Ready, without torque. After a disable, the torque still ramps down for 50 ms. Changes to
    /// `Enabling` by enable.
    Idle,
    /// The torque rises over half a second. Changes to `Active` by itself, or to `Idle` by disable.
    Enabling,
    /// The scene is rendered with full torque. Changes to `Idle` by disable.
    Active,
    /// A fault occurred: zero torque. Left by reset when the cause is gone, to `Idle`, or to
    /// `Unreferenced` if the rig is not homed.
    Fault,
    /// The rig was stopped by command: zero torque. Left in the same way as `Fault`.
    Estop,
}

/// The reason why the rig went to [`Mode::Fault`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// No reading came for `timeout_ticks`, readings are too old or mostly missing, or the watchdog
    /// of a motor controller expired.
    LinkLost,
    /// Too many frames were damaged.
    LinkCorrupt,
    /// A motor controller reports a fault or has rebooted, or its motors are on or off against the
    /// command.
    ControllerFault,
    /// The sphere, with motors on, turns faster than the rig's limit.
    Overspeed,
    /// A motor controller reports more current than allowed, or more energy was given to the hand
    /// than the rig's limit.
    Overtorque,
    /// The wheels, with motors on, slip faster than the rig's limit.
    Slip,
    /// A reading or a torque contains a number that is not finite.
    NonFinite,
    /// A joint moved further between two readings than possible, or its counts and rates disagreed
    /// for 50 ms.
    ImplausibleFeedback,
    /// A tick started more than 20 ms late, or 10 ticks in a row were skipped.
    Deadline,
    /// The holder of the lease has gone, and the rig file makes this a fault.
    ClientLost,
    /// A motor is too hot.
    Thermal,
}

impl Cause {
    /// All causes, in the order of the enum.
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

/// The state machine: the mode with its cause and the factor on torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Machine {
    pub(crate) mode: Mode,
    pub(crate) cause: Option<Cause>,
    /// Factor on torque, 0 to 1, for the soft start and the disable ramp.
    pub(crate) gain: Real,
    /// Fault condition of the last tick. It tells a new condition from a lasting one.
    present: Option<Cause>,
}

/// The reason why `enable` or `reset` was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// The rig is in mode `fault`, or the cause of the fault is still present at a reset.
    Faulted(Cause),
    /// The rig was stopped by command and must be reset first.
    Stopped,
    /// The zero of a steer joint is not known.
    Unreferenced,
}

impl Machine {
    pub(crate) const START: Self = Self { mode: Mode::Unreferenced, cause: None, gain: 0.0, present: None };

    /// Returns true if the motors are allowed to make torque.
    #[inline]
    pub(crate) fn powered(&self) -> bool {
        self.gain > 0.0 || matches!(self.mode, Mode::Enabling | Mode::Active)
    }

    /// Leaves the mode `unreferenced`, because all steer zeros are known.
    pub(crate) fn end_homing(&mut self) {
        if self.mode == Mode::Unreferenced {
            self.mode = Mode::Idle;
        }
    }

    /// Returns the reason why the rig cannot be enabled, if there is one.
    pub(crate) fn obstacle(&self) -> Option<Obstacle> {
        match (self.mode, self.cause) {
            (Mode::Fault, cause) => Some(Obstacle::Faulted(cause.unwrap_or(Cause::ControllerFault))),
            (Mode::Estop, _) => Some(Obstacle::Stopped),
            (Mode::Unreferenced, _) => Some(Obstacle::Unreferenced),
            _ => None,
        }
    }

    /// Enables the rig. The caller must have checked that there is no obstacle. Has no effect
    /// unless the mode is `idle`.
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

    /// Leaves `fault` or `estop`, to `idle`, or to `unreferenced` if the rig is not `homed`. Has no
    /// effect in other modes. Fails if the cause is still present.
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

    /// Takes the fault condition of this tick, if there is one. A new condition leads from any mode
    /// to `fault`. While the condition lasts, only `fault` and `estop` are possible. The first
    /// cause is kept until reset.
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

    /// Restarts the soft start without a change of mode.
    pub(crate) fn soften(&mut self) {
        self.gain = 0.0;
    }

    /// Advances the factor on torque by `dt` seconds.
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
