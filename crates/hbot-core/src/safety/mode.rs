//! The state machine: the modes of the rig and the transitions between them.

use crate::real::Real;

/// Duration of the soft start, in which the torque rises from zero to its full value, s.
pub const SOFT_START_S: Real = 0.5;
/// Duration of the ramp in which the torque falls to zero after a disable, s.
pub const DISABLE_RAMP_S: Real = 0.05;

/// The mode of the control law, which decides whether the motors make torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// The zero of a steer joint is not known yet, so there is no torque. The mode changes to
    /// `Idle` when homing has found all zeros.
    Unreferenced,
    /// Ready, without torque. For 50 ms after a disable, the torque still ramps down to zero. The
    /// command `enable` changes the mode to `Enabling`.
    Idle,
    /// The torque rises over half a second. Then the mode changes to `Active`. The command
    /// `disable` changes it to `Idle`.
    Enabling,
    /// The scene is rendered with full torque. The command `disable` changes the mode to `Idle`.
    Active,
    /// A fault occurred, and the torque is zero. If the cause is gone, the command `reset` changes
    /// the mode to `Idle`, or to `Unreferenced` if the rig is not homed.
    Fault,
    /// A client stopped the rig by command, and the torque is zero. The command `reset` ends this
    /// mode in the same way as `Fault`.
    Estop,
}

/// The reason why the rig went to [`Mode::Fault`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Cause {
    /// The link to the motor controllers is lost. No reading came for `timeout_ticks`, readings are
    /// too old or mostly missing, or the watchdog of a motor controller expired.
    LinkLost,
    /// Too many frames on the line to the motor controllers were damaged.
    LinkCorrupt,
    /// A motor controller reported a fault or rebooted, or its motors were on or off contrary to
    /// the command.
    ControllerFault,
    /// The sphere turned faster than the rig's limit while the motors were on.
    Overspeed,
    /// A motor controller reported more current than allowed, or the rig gave more energy to the
    /// hand than its limit allows.
    Overtorque,
    /// The wheels slipped faster than the rig's limit while the motors were on.
    Slip,
    /// A reading or a computed torque contained a number that is not finite.
    NonFinite,
    /// A joint moved further between two readings than is possible, or its encoder counts and its
    /// rate disagreed for 50 ms.
    ImplausibleFeedback,
    /// A tick started more than 20 ms late, or 10 ticks in a row were skipped.
    Deadline,
    /// The client that held the lease is gone, and the rig file makes this a fault.
    ClientLost,
    /// A motor is hotter than allowed.
    Thermal,
}

impl Cause {
    /// All causes of faults, in the order of the enum.
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

/// The state machine of the rig: its mode, the cause of a fault, and the factor by which torque is
/// ramped.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct ModeMachine {
    pub(crate) mode: Mode,
    pub(crate) cause: Option<Cause>,
    /// Factor on the torque, 0 to 1. It ramps up in the soft start and down after a disable.
    pub(crate) gain: Real,
    /// Fault condition of the last tick. It is compared with that of the next tick, to distinguish
    /// a new condition from a lasting one.
    pub(crate) present: Option<Cause>,
}

/// The reason why `enable` or `reset` was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Obstacle {
    /// The rig is in mode `fault`, or `reset` was refused because the cause of the fault is still
    /// present.
    Faulted(Cause),
    /// The rig was stopped by command. It must be reset first.
    Stopped,
    /// The zero of a steer joint is not known: the rig is not homed.
    Unreferenced,
}

impl ModeMachine {
    pub(crate) const START: Self = Self { mode: Mode::Unreferenced, cause: None, gain: 0.0, present: None };

    /// Returns true if the motors may make torque in the present mode.
    #[inline]
    pub(crate) fn powered(&self) -> bool {
        self.gain > 0.0 || matches!(self.mode, Mode::Enabling | Mode::Active)
    }

    /// Leaves the mode `unreferenced`, after the zeros of all steer joints have been found.
    pub(crate) fn end_homing(&mut self) {
        if self.mode == Mode::Unreferenced {
            self.mode = Mode::Idle;
        }
    }

    /// Returns the reason why the rig cannot be enabled, or `None` if it can.
    pub(crate) fn obstacle(&self) -> Option<Obstacle> {
        match (self.mode, self.cause) {
            (Mode::Fault, cause) => Some(Obstacle::Faulted(cause.unwrap_or(Cause::ControllerFault))),
            (Mode::Estop, _) => Some(Obstacle::Stopped),
            (Mode::Unreferenced, _) => Some(Obstacle::Unreferenced),
            _ => None,
        }
    }

    /// Begins the soft start of the torque. Has no effect unless the mode is `idle`. The caller
    /// must have checked that [`obstacle`](Self::obstacle) returns `None`.
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

    /// Leaves mode `fault` or `estop`. The new mode is `idle`, or `unreferenced` if `homed` is
    /// false. Has no effect in other modes. Fails if the cause of the fault is still present.
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

    /// Takes the fault condition of this tick, if any, and sets the torque to zero if there is one.
    /// A new condition changes any mode to `fault`. While a condition lasts, the mode can only be
    /// `fault` or `estop`. The first cause is kept until reset.
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

    /// Restarts the soft start: the torque rises from zero again. The mode does not change.
    pub(crate) fn soften(&mut self) {
        self.gain = 0.0;
    }

    /// Advances the factor on the torque by `dt` seconds along the soft start or the disable ramp.
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
