//! The simulated motor controllers of one port. They do what the firmware at the far end of a
//! serial line does.
//!
//! Their inputs are the time in nanoseconds, the true joint angles and rates, and the messages of
//! `hbot-link`. They know nothing of the sphere. Unless [`phenomena`] change it, encoders are exact
//! except for rounding down to a whole count, and motors give exactly the commanded torque.

mod disc;
mod joint;
mod motors;

use hbot_core::device::MAX_JOINTS;
use hbot_link::{
    Command, ControllerFlags, Description, Feedback, JointDescription, JointFlags, JointReading,
    PROTOCOL_VERSION,
};

use self::disc::Disc;
use self::joint::Axis;
pub use self::joint::{Encoder, SimulatedJoint};
use self::motors::Motors;
use crate::phenomena;
use crate::plant::JointTorques;

/// Temperature that all simulated motor sensors report, in degrees Celsius.
const TEMPERATURE: f32 = 25.0;

const NO_TORQUE: JointTorques = [0.0; MAX_JOINTS];

/// Name and version of the simulated firmware, as reported in its [`Description`].
pub const FIRMWARE: &str = concat!("hbot-sim ", env!("CARGO_PKG_VERSION"));

/// A fault that a test or a user can switch on or off in the simulated motor controllers. Joints
/// are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Power is lost and returns. The torque becomes zero, the watchdog is cleared, and
    /// [`ControllerFlags::UNDESCRIBED`] is set. Encoder counts restart, except those of absolute
    /// encoders. Other injected [`Fault`]s stay active.
    Reboot,
    /// Switches the loss of all answers on or off. Commands still take effect, as if only the line
    /// back to the host were cut.
    Mute(bool),
    /// Switches the loss of all commands and answers on or off, as if the line were cut in both
    /// directions.
    Deaf(bool),
    /// Switches an internal fault of the motor controller on or off. While it is on, the motor
    /// controller reports [`ControllerFlags::FAULT`] and gives no torque.
    Failed(bool),
    /// Switches the flag [`JointFlags::OVERTEMPERATURE`] of one joint on or off. The joint still
    /// gives torque.
    Hot {
        /// Index of the joint.
        joint: usize,
        /// Whether the joint reports overtemperature.
        on: bool,
    },
    /// Simulates an encoder that has slipped on its shaft: its angle gets a constant error.
    Slipped {
        /// Index of the joint.
        joint: usize,
        /// Encoder angle minus true angle, in rad of the joint in its positive direction.
        angle: f64,
    },
}

/// The simulated motor controllers of one port. Together they drive all joints of the rig.
#[derive(Debug, Clone)]
pub struct Controllers {
    joints: usize,
    axes: [Axis; MAX_JOINTS],
    discs: Option<Box<[Disc; MAX_JOINTS]>>,
    motors: Option<Box<Motors>>,
    /// Commanded torques, limited to each joint's peak, in N m. A positive torque acts in the
    /// joint's positive direction.
    torque: JointTorques,
    enabled: bool,
    expired: bool,
    described: bool,
    /// Time at which the watchdog expires if no further command arrives, ns. `None` if no valid
    /// command came since power-up.
    deadline: Option<u64>,
    mute: bool,
    deaf: bool,
    failed: bool,
}

impl Controllers {
    /// Creates motor controllers that have just powered up.
    ///
    /// Encoder counts start as if all joints were at the angle zero; `angles` are the true angles,
    /// rad. At most [`MAX_JOINTS`] of `specs` are used. `encoder` gives the errors of the encoders,
    /// or `None` for exact encoders.
    #[must_use]
    pub fn new(
        specs: &[SimulatedJoint],
        angles: &[f64; MAX_JOINTS],
        encoder: Option<&phenomena::Encoder>,
    ) -> Self {
        let none = SimulatedJoint {
            counts_per_turn: 1,
            gear: 1.0,
            reversed: false,
            peak: 0.0,
            continuous: 0.0,
            encoder: Encoder::Incremental,
        };
        let discs = encoder.map(Disc::all);
        let axes = core::array::from_fn(|j| {
            Axis::new(specs.get(j).copied().unwrap_or(none), angles[j], disc(&discs, j))
        });
        Self {
            joints: specs.len().min(MAX_JOINTS),
            axes,
            discs,
            motors: None,
            torque: NO_TORQUE,
            enabled: false,
            expired: false,
            described: false,
            deadline: None,
            mute: false,
            deaf: false,
            failed: false,
        }
    }

    /// Replaces the errors of the encoders while the joints are at `angles`, rad.
    ///
    /// Encoder counts continue from their present values. A zero that was already set is kept until
    /// it is set again.
    pub fn set_encoder(&mut self, encoder: Option<&phenomena::Encoder>, angles: &[f64; MAX_JOINTS]) {
        let new = encoder.map(Disc::all);
        for (j, axis) in self.axes.iter_mut().enumerate() {
            axis.replace_disc(angles[j], disc(&self.discs, j), disc(&new, j));
        }
        self.discs = new;
    }

    /// Replaces the parameters of the motors. `None` makes the motors ideal.
    ///
    /// Motors that were ideal before this call start cold, with their present torque. Other motors
    /// keep their current and heat.
    pub fn set_motor(&mut self, motor: Option<phenomena::Motor>) {
        self.motors = motor.map(|motor| match self.motors.take() {
            None => Box::new(Motors::new(motor, self.asked())),
            Some(mut motors) => {
                motors.replace(motor);
                motors
            }
        });
    }

    /// Returns the torques that act at the joints now, in N m. A positive torque acts in the
    /// joint's positive direction.
    #[must_use]
    pub fn torque(&self) -> &JointTorques {
        self.motors.as_ref().map_or_else(|| self.asked(), |motors| &motors.acting)
    }

    /// Advances the motors by `h` seconds and returns the torques to apply during that time, N m.
    ///
    /// For motors with a lag these are mean torques over that time. `rates` returns the joint rates
    /// at its start, rad/s. It is called only if the motors are not ideal.
    pub fn drive(&mut self, h: f64, rates: impl FnOnce() -> [f64; MAX_JOINTS]) -> JointTorques {
        let asked = *self.asked();
        match &mut self.motors {
            None => asked,
            Some(motors) => motors.drive(h, &self.axes[..self.joints], &asked, &rates()),
        }
    }

    /// Returns the torques that the motor controllers ask of the motors, N m. They are zero while
    /// the motors are off.
    fn asked(&self) -> &JointTorques {
        if self.gives_torque() { &self.torque } else { &NO_TORQUE }
    }

    /// Returns the time at which the watchdog expires if no further command arrives, ns. Returns
    /// `None` if it has already expired or no command ever came.
    #[must_use]
    pub fn deadline(&self) -> Option<u64> {
        self.deadline.filter(|_| !self.expired)
    }

    /// Marks the watchdog as expired if its deadline is at or before `now_ns`.
    pub fn watch(&mut self, now_ns: u64) {
        if self.deadline.is_some_and(|deadline| now_ns >= deadline) {
            self.expired = true;
        }
    }

    /// Updates the encoders with the present joint angles, rad, so that a passed index mark is
    /// detected.
    pub fn sense(&mut self, angles: &[f64; MAX_JOINTS]) {
        for (j, (axis, angle)) in self.axes[..self.joints].iter_mut().zip(angles).enumerate() {
            axis.sense(*angle, disc(&self.discs, j));
        }
    }

    /// Handles the message [`hbot_link::ToController::Describe`]. Returns the answer, or `None` if
    /// an injected fault has cut the line.
    pub fn describe(&mut self) -> Option<Description> {
        if self.deaf {
            return None;
        }
        self.described = true;
        let joint = |axis: &Axis| JointDescription { counts_per_turn: axis.joint.counts_per_turn };
        (!self.mute).then(|| Description {
            protocol: PROTOCOL_VERSION,
            firmware: FIRMWARE.try_into().unwrap_or_default(),
            joints: self.axes[..self.joints].iter().map(joint).collect(),
        })
    }

    /// Handles a command that arrives at `now_ns` and returns the answer. `angles` (rad) and
    /// `rates` (rad/s) are the joints' true values at that time.
    ///
    /// A command with the wrong number of torques, or with a torque that is not finite, changes
    /// nothing and is not answered.
    pub fn command(
        &mut self,
        now_ns: u64,
        command: &Command,
        angles: &[f64; MAX_JOINTS],
        rates: &[f64; MAX_JOINTS],
    ) -> Option<Feedback> {
        let valid = command.torque.len() == self.joints && command.torque.iter().all(|t| t.is_finite());
        if self.deaf || !valid {
            return None;
        }
        self.watch(now_ns);
        if !command.enable {
            self.expired = false;
        }
        self.enabled = command.enable;
        self.deadline = Some(now_ns.saturating_add(u64::from(command.watchdog_ms) * 1_000_000));
        self.watch(now_ns);
        for ((axis, torque), asked) in self.axes.iter_mut().zip(&mut self.torque).zip(&command.torque) {
            let given = asked.clamp(-axis.peak, axis.peak);
            axis.flags.set(JointFlags::OVERCURRENT, command.enable && given != *asked);
            *torque = f64::from(if axis.joint.reversed { -given } else { given });
        }
        (!self.mute).then(|| self.feedback(command.sequence, angles, rates))
    }

    /// Switches a fault on or off. `angles` are the true joint angles, rad. A fault of a joint that
    /// does not exist is ignored.
    pub fn inject(&mut self, fault: Fault, angles: &[f64; MAX_JOINTS]) {
        match fault {
            Fault::Reboot => self.reboot(angles),
            Fault::Mute(on) => self.mute = on,
            Fault::Deaf(on) => self.deaf = on,
            Fault::Failed(on) => self.failed = on,
            Fault::Hot { joint, on } => {
                if let Some(axis) = self.axes.get_mut(joint) {
                    axis.flags.set(JointFlags::OVERTEMPERATURE, on);
                }
            }
            Fault::Slipped { joint, angle } => {
                if let Some(axis) = self.axes.get_mut(joint) {
                    axis.slipped = angle;
                }
            }
        }
    }

    fn reboot(&mut self, angles: &[f64; MAX_JOINTS]) {
        self.torque = NO_TORQUE;
        (self.enabled, self.expired, self.described, self.deadline) = (false, false, false, None);
        for (j, (axis, angle)) in self.axes.iter_mut().zip(angles).enumerate() {
            axis.reboot(*angle, disc(&self.discs, j));
        }
        if let Some(motors) = &mut self.motors {
            motors.reboot();
        }
    }

    fn gives_torque(&self) -> bool {
        self.enabled && !self.expired && !self.failed
    }

    fn feedback(&self, sequence: u32, angles: &[f64; MAX_JOINTS], rates: &[f64; MAX_JOINTS]) -> Feedback {
        let mut flags = ControllerFlags::empty();
        flags.set(ControllerFlags::ENABLED, self.gives_torque());
        flags.set(ControllerFlags::WATCHDOG_EXPIRED, self.expired);
        flags.set(ControllerFlags::FAULT, self.failed);
        flags.set(ControllerFlags::UNDESCRIBED, !self.described);
        let reading = |j: usize| {
            let (axis, disc) = (&self.axes[j], disc(&self.discs, j));
            let mut flags = axis.flags;
            if let Some(motors) = &self.motors
                && motors.derates(j, axis, self.asked()[j])
            {
                flags |= JointFlags::OVERTEMPERATURE;
            }
            JointReading {
                count: axis.count(angles[j], disc),
                rate: axis.rate(angles[j], rates[j], disc),
                current: 0.0,
                temperature: TEMPERATURE,
                flags,
            }
        };
        Feedback { sequence, flags, joints: (0..self.joints).map(reading).collect() }
    }
}

/// Returns the encoder errors of joint `j`, or `None` if the encoders are exact.
fn disc(discs: &Option<Box<[Disc; MAX_JOINTS]>>, j: usize) -> Option<&Disc> {
    discs.as_deref().map(|discs| &discs[j])
}
