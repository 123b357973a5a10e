//! The virtual motor controllers of one port: what the firmware at the far end of a serial line does.
//!
//! They know time in nanoseconds as they are told it, the true joint angles and rates, and the messages of
//! `hbot-link`; they know nothing of the sphere. Encoders are exact but for the floor to a count, and motors give what is
//! asked of them, unless [`phenomena`] say otherwise.

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
pub use self::joint::{EncoderKind, SimulatedJoint};
use self::motors::Motors;
use crate::phenomena;
use crate::plant::JointTorques;

/// What the motors' sensors read, degrees Celsius.
const TEMPERATURE: f32 = 25.0;

const NO_TORQUE: JointTorques = [0.0; MAX_JOINTS];

/// What its [`Description`] calls the firmware.
pub const FIRMWARE: &str = concat!("hbot-sim ", env!("CARGO_PKG_VERSION"));

/// Trouble to make, or to end. Joints are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InjectedFault {
    /// Power lost and back: torque zero, undescribed, counts anew (an absolute encoder's stay), watchdog forgotten.
    /// What [`InjectedFault`]s are on stays on.
    Reboot,
    /// Whether commands still act but nothing is answered: the line back is cut.
    Mute(bool),
    /// Whether nothing is heard or answered: the line is cut both ways.
    Deaf(bool),
    /// Whether the controller reports [`ControllerFlags::FAULT`] and gives no torque.
    Failed(bool),
    /// Whether a joint reports [`JointFlags::OVERTEMPERATURE`]; torque goes on.
    Hot {
        /// Which joint.
        joint: usize,
        /// Whether it is.
        on: bool,
    },
    /// How far the encoder of a joint has slipped, rad of the joint in its positive sense, from the truth.
    Slipped {
        /// Which joint.
        joint: usize,
        /// By how much, rad.
        angle: f64,
    },
}

/// The controllers of one port, for all joints.
#[derive(Debug, Clone)]
pub struct SimulatedControllers {
    joints: usize,
    axes: [Axis; MAX_JOINTS],
    discs: Option<Box<[Disc; MAX_JOINTS]>>,
    motors: Option<Box<Motors>>,
    /// Commanded and clamped, joint's sense, N m.
    torque: JointTorques,
    enabled: bool,
    expired: bool,
    described: bool,
    /// When the last valid command runs out, ns; none since power-up: `None`.
    deadline: Option<u64>,
    mute: bool,
    deaf: bool,
    failed: bool,
}

impl SimulatedControllers {
    /// Controllers that have just powered up with all joints of `specs` (at most [`MAX_JOINTS`] are taken) at the angle
    /// zero; `angles` is where they are, rad. `encoder` is what is wrong with their encoders.
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
            encoder: EncoderKind::Incremental,
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

    /// Has the errors of the encoders replaced, with the joints at `angles`, rad. Counts go on from where they are: a zero
    /// once taken stays until one is taken again.
    pub fn set_encoder(&mut self, encoder: Option<&phenomena::Encoder>, angles: &[f64; MAX_JOINTS]) {
        let new = encoder.map(Disc::all);
        for (j, axis) in self.axes.iter_mut().enumerate() {
            axis.replace_disc(angles[j], disc(&self.discs, j), disc(&new, j));
        }
        self.discs = new;
    }

    /// Has the motors' figures replaced. Motors that were ideal are cold and give what they gave; others keep current and
    /// heat.
    pub fn set_motor(&mut self, motor: Option<phenomena::Motor>) {
        self.motors = motor.map(|motor| match self.motors.take() {
            None => Box::new(Motors::new(motor, self.asked())),
            Some(mut motors) => {
                motors.replace(motor);
                motors
            }
        });
    }

    /// The torques that act at the joints at this moment, in the joints' own sense, N m.
    #[must_use]
    pub fn torque(&self) -> &JointTorques {
        self.motors.as_ref().map_or_else(|| self.asked(), |motors| &motors.acting)
    }

    /// Moves the motors on by `h` seconds and returns the torques to hold for as long, N m: of motors with a lag, the mean.
    /// `rates` gives the joints' rates at the start, rad/s, where they matter.
    pub fn drive(&mut self, h: f64, rates: impl FnOnce() -> [f64; MAX_JOINTS]) -> JointTorques {
        let asked = *self.asked();
        match &mut self.motors {
            None => asked,
            Some(motors) => motors.drive(h, &self.axes[..self.joints], &asked, &rates()),
        }
    }

    /// What is asked of the motors, N m.
    fn asked(&self) -> &JointTorques {
        if self.gives_torque() { &self.torque } else { &NO_TORQUE }
    }

    /// When the watchdog expires if nothing is heard before, ns; `None` where it has, or never was fed.
    #[must_use]
    pub fn deadline(&self) -> Option<u64> {
        self.deadline.filter(|_| !self.expired)
    }

    /// Lets the watchdog see the time `now_ns`.
    pub fn watch(&mut self, now_ns: u64) {
        if self.deadline.is_some_and(|deadline| now_ns >= deadline) {
            self.expired = true;
        }
    }

    /// Lets the encoders see the joint angles, rad, so that an index passed is not missed.
    pub fn sense(&mut self, angles: &[f64; MAX_JOINTS]) {
        for (j, (axis, angle)) in self.axes[..self.joints].iter_mut().zip(angles).enumerate() {
            axis.sense(*angle, disc(&self.discs, j));
        }
    }

    /// Answers [`hbot_link::ToController::Describe`].
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

    /// Takes a command in at `now_ns`, with the true joint angles (rad) and rates (rad/s) of that instant, and
    /// answers it. A command that is not valid is not answered and changes nothing.
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

    /// Makes trouble, or ends it, at the joint angles `angles`, rad. A joint that does not exist is ignored.
    pub fn inject(&mut self, fault: InjectedFault, angles: &[f64; MAX_JOINTS]) {
        match fault {
            InjectedFault::Reboot => self.reboot(angles),
            InjectedFault::Mute(on) => self.mute = on,
            InjectedFault::Deaf(on) => self.deaf = on,
            InjectedFault::Failed(on) => self.failed = on,
            InjectedFault::Hot { joint, on } => {
                if let Some(axis) = self.axes.get_mut(joint) {
                    axis.flags.set(JointFlags::OVERTEMPERATURE, on);
                }
            }
            InjectedFault::Slipped { joint, angle } => {
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

/// The disc of a joint's encoder, where encoders have errors.
fn disc(discs: &Option<Box<[Disc; MAX_JOINTS]>>, j: usize) -> Option<&Disc> {
    discs.as_deref().map(|discs| &discs[j])
}
