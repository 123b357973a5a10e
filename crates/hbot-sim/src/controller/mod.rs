//! The simulated motor controllers of one line. They do what the firmware of a real controller
//! does, in each protocol that a rig file can name.
//!
//! | module | what it does |
//! |---|---|
//! | `joints` (`joint`, `disc`, `filter`, `motors`) | encoders and motors of all protocols |
//! | [`hbot`] | the firmware of docs/link.md |
//! | `moteus` | moteus servos behind an fdcanusb or a UART |
//! | `odrive` | ODrives behind an adapter that speaks slcan |
//!
//! Their inputs are the time in nanoseconds, the true joint angles and rates, and the bytes of
//! their line. The sphere is not among their inputs. Encoders are exact except that counts are
//! rounded down, and motors give the commanded torque, unless [`phenomena`] change this. moteus
//! servos and ODrives filter what their encoders read ([`EncoderFilter`]). To add a firmware, write
//! a type that implements `Speaks`, and add its variant to `Firmware`.

mod disc;
mod filter;
pub mod hbot;
mod joint;
mod joints;
mod moteus;
mod motors;
mod odrive;

use hbot_config::rig::Protocol;
use hbot_core::design::device::MAX_JOINTS;

pub use self::filter::EncoderFilter;
pub use self::hbot::FIRMWARE;
pub use self::joint::{EncoderKind, SimulatedJoint};
use self::joints::Joints;
pub use self::joints::Truth;
use crate::phenomena;
use crate::plant::JointTorques;

/// A fault that a test or a user can switch on or off in the simulated motor controllers. Joints
/// are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InjectedFault {
    /// Power is lost and returns. The torque is zero, the watchdog is cleared, and
    /// `UNDESCRIBED` is set. Counts restart, except those of absolute encoders.
    /// Other [`InjectedFault`]s stay active.
    Reboot,
    /// Like [`InjectedFault::Reboot`], but for one joint's controller. If one controller controls
    /// all joints, it restarts with all of them.
    RebootOne(usize),
    /// Switches the loss of all answers on or off. Commands still take effect. This simulates a
    /// line that is cut only in the direction to the host.
    Mute(bool),
    /// Switches the loss of all commands and answers on or off. This simulates a line that is cut
    /// in both directions.
    Deaf(bool),
    /// Switches the loss of all commands and answers of one joint's controller on or off. If one
    /// controller controls all joints, this affects all of them.
    DeafOne {
        /// Index of the joint.
        joint: usize,
        /// True to lose all commands and answers, false to end the loss.
        on: bool,
    },
    /// Switches a fault of all controllers on or off. While it is on, the controllers report the
    /// fault and give no torque.
    Failed(bool),
    /// Like [`InjectedFault::Failed`], but for one joint's controller. If one controller controls
    /// all joints, this affects all of them.
    FailedOne {
        /// Index of the joint.
        joint: usize,
        /// True to switch the fault on, false to switch it off.
        on: bool,
    },
    /// Switches on or off that a joint's controller reports the joint's motor as too hot. The
    /// torque does not change.
    Hot {
        /// Index of the joint.
        joint: usize,
        /// True to switch the report of overtemperature on, false to switch it off.
        on: bool,
    },
    /// Simulates that an encoder has slipped on its shaft, so that its angle has a constant error.
    Slipped {
        /// Index of the joint.
        joint: usize,
        /// The constant error: encoder angle minus true angle, in rad of the joint in its positive
        /// direction.
        angle: f64,
    },
}

/// The functions that every simulated firmware provides, whatever its protocol.
trait Speaks {
    /// Handles `bytes` that arrive at `now_ns` and appends the answers to `reply`.
    fn hear(
        &mut self,
        now_ns: u64,
        bytes: &[u8],
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    );

    /// Returns the next time at which the firmware acts by itself, ns: a watchdog expires, or it
    /// sends a message without being asked.
    fn next_ns(&self) -> Option<u64>;

    /// Returns the next time at which the firmware sends a message without being asked, ns.
    /// [`next_ns`](Self::next_ns) is never later than this time.
    fn next_word_ns(&self) -> Option<u64> {
        None
    }

    /// Does the work that is due at `now_ns` without a command, such as checking the watchdog.
    /// Appends messages that the firmware sends without being asked to `reply`.
    fn pass(&mut self, now_ns: u64, joints: &mut Joints, truth: &Truth<'_>, reply: &mut Vec<u8>);

    /// Switches a fault on or off. `angles` are the true joint angles, rad.
    fn inject(&mut self, fault: InjectedFault, joints: &mut Joints, angles: &[f64; MAX_JOINTS]);

    /// Returns the number of received frames that were refused since power-up because they were
    /// damaged or invalid.
    fn refused(&self) -> u64;
}

/// The firmware of the controllers on one line.
#[derive(Debug, Clone)]
enum Firmware {
    Hbot(Box<hbot::Hbot>),
    Moteus(Box<moteus::Moteus>),
    Odrive(Box<odrive::Odrive>),
}

impl Firmware {
    fn new(line: Line, lags: Lags, joints: &mut Joints, angles: &[f64; MAX_JOINTS]) -> Option<Self> {
        let first_id = line.protocol.ids().map_or(0, |ids| *ids.start() as u8);
        match line.protocol {
            Protocol::Hbot => Some(Self::Hbot(Box::new(hbot::Hbot::new(joints)?))),
            Protocol::Moteus => {
                let servos = moteus::Moteus::new((first_id, line.checksums), lags, joints, angles);
                Some(Self::Moteus(Box::new(servos)))
            }
            Protocol::Odrive => Some(Self::Odrive(Box::new(odrive::Odrive::new(lags, joints)))),
        }
    }

    fn speaks(&self) -> &dyn Speaks {
        match self {
            Self::Hbot(it) => it.as_ref(),
            Self::Moteus(it) => it.as_ref(),
            Self::Odrive(it) => it.as_ref(),
        }
    }

    fn speaks_mut(&mut self) -> &mut dyn Speaks {
        match self {
            Self::Hbot(it) => it.as_mut(),
            Self::Moteus(it) => it.as_mut(),
            Self::Odrive(it) => it.as_mut(),
        }
    }
}

/// How the simulated controllers of a line communicate: their protocol, and whether lines of text
/// have checksums.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line {
    /// The protocol of the controllers.
    pub protocol: Protocol,
    /// True if a line to moteus servos has checksums, as the UART of a servo has. False for an
    /// fdcanusb adapter. Other protocols ignore this value.
    pub checksums: bool,
}

impl From<Protocol> for Line {
    fn from(protocol: Protocol) -> Self {
        Self { protocol, checksums: true }
    }
}

/// The delays that the settings of a simulated controller cause. `None`: those of its vendor's
/// usual settings. They have no effect on controllers with hbot's own protocol.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lags {
    /// Time constant of the torque, s, that the setting of the current loop would cause. The
    /// controller only reports it: the simulated motor has the lag of its phenomenon.
    pub torque: Option<f64>,
    /// Delay of the reported rates, s, which [`EncoderFilter`] causes. 0 for no filter.
    pub rate: Option<f64>,
}

/// Returns the byte that ends a frame of `protocol` on a serial line.
#[must_use]
pub const fn frame_end(protocol: Protocol) -> u8 {
    match protocol {
        Protocol::Hbot => 0,
        Protocol::Moteus => b'\n',
        Protocol::Odrive => b'\r',
    }
}

/// The simulated motor controllers of one line, together with the encoders and motors of all its
/// joints.
#[derive(Debug, Clone)]
pub struct SimulatedControllers {
    joints: Joints,
    firmware: Firmware,
    mute: bool,
    deaf: bool,
}

impl SimulatedControllers {
    /// Creates motor controllers that have just powered up.
    ///
    /// Encoder counts start as if all joints were at the angle zero; `angles` are the true angles,
    /// rad. At most [`MAX_JOINTS`] of `specs` are used. `encoder` gives the errors of the encoders,
    /// or `None` for exact encoders.
    #[must_use]
    pub fn new(
        line: Line,
        lags: Lags,
        specs: &[SimulatedJoint],
        angles: &[f64; MAX_JOINTS],
        encoder: Option<&phenomena::Encoder>,
    ) -> Option<Self> {
        let mut joints = Joints::new(specs, angles, encoder);
        let firmware = Firmware::new(line, lags, &mut joints, angles)?;
        Some(Self { joints, firmware, mute: false, deaf: false })
    }

    /// Replaces the errors of the encoders while the joints are at `angles`, rad.
    ///
    /// Encoder counts continue from their present values. A zero that was already set is kept until
    /// it is set again.
    pub fn set_encoder(&mut self, encoder: Option<&phenomena::Encoder>, angles: &[f64; MAX_JOINTS]) {
        self.joints.set_encoder(encoder, angles);
    }

    /// Replaces the parameters of the motors. `None` makes the motors ideal.
    ///
    /// Motors that were ideal before this call start cold, with their present torque. Other motors
    /// keep their current and heat.
    pub fn set_motor(&mut self, motor: Option<phenomena::Motor>) {
        self.joints.set_motor(motor);
    }

    /// Returns the torques that act at the joints now, in N m. A positive torque acts in the
    /// joint's positive direction.
    #[must_use]
    pub fn torque(&self) -> &JointTorques {
        self.joints.torque()
    }

    /// Advances the motors by `h` seconds, and returns the torques to apply to the joints during
    /// that time, N m.
    ///
    /// If motors have a lag, the torques are means over that time. The function `rates` must return
    /// the joint rates at its start, rad/s. It is not called if the motors are ideal.
    pub fn drive(&mut self, h: f64, rates: impl FnOnce() -> [f64; MAX_JOINTS]) -> JointTorques {
        self.joints.drive(h, rates)
    }

    /// Returns whether any controller filters what its encoder reads. Then [`follow`](Self::follow)
    /// must be called after each step of the plant.
    #[must_use]
    pub fn filters(&self) -> bool {
        self.joints.filters()
    }

    /// Advances the controllers' filters by a step of `h` seconds, from the motion `before` it to
    /// the motion `after` it.
    pub fn follow(&mut self, h: f64, before: &Truth<'_>, after: &Truth<'_>) {
        self.joints.follow(h, before, after);
    }

    /// Returns the next time at which a controller acts by itself, ns: a watchdog expires, or the
    /// controller sends a message without being asked.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.firmware.speaks().next_ns()
    }

    /// Returns the next time at which a controller sends a message without being asked, ns. Returns
    /// `None` if none does.
    #[must_use]
    pub fn next_word_ns(&self) -> Option<u64> {
        self.firmware.speaks().next_word_ns()
    }

    /// Does the work of the controllers that is due at `now_ns` without a command. For example, an
    /// expired watchdog switches motors off. Appends messages that the controllers send without
    /// being asked to `reply`.
    pub fn pass(&mut self, now_ns: u64, truth: &Truth<'_>, reply: &mut Vec<u8>) {
        let before = reply.len();
        self.firmware.speaks_mut().pass(now_ns, &mut self.joints, truth, reply);
        if self.mute || self.deaf {
            reply.truncate(before);
        }
    }

    /// Informs the encoders of the present joint angles, rad, so that they detect when a joint
    /// passes an index mark.
    pub fn sense(&mut self, angles: &[f64; MAX_JOINTS]) {
        self.joints.sense(angles);
    }

    /// Delivers bytes from the host to the controllers at `now_ns`, and appends their answers to
    /// `reply`. `truth` has the true joint angles and rates at that time.
    pub fn hear(&mut self, now_ns: u64, bytes: &[u8], truth: &Truth<'_>, reply: &mut Vec<u8>) {
        if self.deaf {
            return;
        }
        let before = reply.len();
        self.firmware.speaks_mut().hear(now_ns, bytes, &mut self.joints, truth, reply);
        if self.mute {
            reply.truncate(before);
        }
    }

    /// Switches a fault on or off. `angles` are the true joint angles, rad. A fault of a joint that
    /// does not exist is ignored.
    pub fn inject(&mut self, fault: InjectedFault, angles: &[f64; MAX_JOINTS]) {
        match fault {
            InjectedFault::Mute(on) => self.mute = on,
            InjectedFault::Deaf(on) => self.deaf = on,
            InjectedFault::Hot { joint, on } => self.joints.set_hot(joint, on),
            InjectedFault::Slipped { joint, angle } => self.joints.slip(joint, angle),
            InjectedFault::Reboot
            | InjectedFault::RebootOne(_)
            | InjectedFault::DeafOne { .. }
            | InjectedFault::Failed(_)
            | InjectedFault::FailedOne { .. } => {
                self.firmware.speaks_mut().inject(fault, &mut self.joints, angles);
            }
        }
    }

    /// Changes a setting of the controller of one joint. `name` is the vendor's name of the
    /// setting, such as `servo.timeout_mode` for a moteus. Returns false if there is no such
    /// setting.
    pub fn set(&mut self, joint: usize, name: &str, value: f64) -> bool {
        match &mut self.firmware {
            Firmware::Hbot(_) => false,
            Firmware::Odrive(axes) => axes.set(joint, name, value, &mut self.joints),
            Firmware::Moteus(servos) => servos.set(joint, name, value, &mut self.joints),
        }
    }

    /// Gives the controller of one joint another id on the bus, to simulate a builder's mistake.
    pub fn set_id(&mut self, joint: usize, id: u8) {
        match &mut self.firmware {
            Firmware::Hbot(_) => {}
            Firmware::Odrive(axes) => axes.set_id(joint, id),
            Firmware::Moteus(servos) => servos.set_id(joint, id),
        }
    }

    /// Returns the number of received frames that were refused since power-up because they were
    /// damaged or invalid.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.firmware.speaks().refused()
    }
}
