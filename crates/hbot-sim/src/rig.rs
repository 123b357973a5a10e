//! The simulated rig: a plant, controllers on a serial line, and perhaps a hand.
//!
//! It has no clock and no thread. Whoever owns it says what time it is and hands it the bytes that have arrived; it
//! moves the plant up to that time under the torques that were held, and gives back the bytes of the answers. In
//! virtual time a server calls [`SimulatedRig::receive`] once a tick; in wall time [`crate::pty`] does.

use core::fmt;

use hbot_core::Vec3;
use hbot_core::device::{Device, MAX_JOINTS};
use hbot_core::rig::Rig;
use hbot_link::{Decoder, FromController, MAX_FEEDBACK_FRAME, ToController, encode};

use crate::controller::{Controllers, Fault, SimulatedJoint};
use crate::hand::{Grip, Hand};
use crate::plant::{ImpossibleInertia, JointTorques, Method, Plant, State, Sum};

/// What a simulated rig is made of.
#[derive(Debug, Clone)]
pub struct RigConfig {
    /// Geometry and masses.
    pub device: Device,
    /// One a joint, in the order steer, drive of each wheel.
    pub joints: Vec<SimulatedJoint>,
    /// Where the plant starts; incremental encoders count from the angle zero nevertheless.
    pub start: State,
    /// Who holds the sphere.
    pub hand: Option<Hand>,
    /// How the plant is moved on.
    pub method: Method,
    /// The longest step of the plant, ns; a longer interval is divided into equal steps. 0 counts as 1.
    pub max_step_ns: u64,
    /// The most that is simulated at once, ns. Where more time has passed (a process stopped, a machine asleep) the
    /// rest is left out: the controllers' clock jumps, the plant's does not.
    pub max_jump_ns: u64,
}

impl RigConfig {
    /// The rig as the controller knows it: at rest at zero, nobody's hand on it, [`Method::Rk4`] in steps of at most
    /// 1 ms, at most 100 ms at once.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            device: rig.device,
            joints: rig.joints[..rig.device.joints()].iter().map(SimulatedJoint::from).collect(),
            start: State::default(),
            hand: None,
            method: Method::default(),
            max_step_ns: 1_000_000,
            max_jump_ns: 100_000_000,
        }
    }
}

/// Why there is no such rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigError {
    /// The device's inertias contradict each other.
    Inertia(ImpossibleInertia),
    /// The joints are not as many as the device's.
    Joints {
        /// How many there are.
        given: usize,
        /// How many the device has: two a wheel.
        wanted: usize,
    },
}

impl fmt::Display for RigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inertia(error) => write!(f, "simulated rig: {error}"),
            Self::Joints { given, wanted } => {
                write!(
                    f,
                    "simulated rig: {given} joints; its device has {wanted}, steer and drive of each wheel"
                )
            }
        }
    }
}

impl core::error::Error for RigError {}

/// A rig that exists in memory alone.
#[derive(Debug, Clone)]
pub struct SimulatedRig {
    plant: Plant,
    /// The sphere's own inertia, kg m².
    sphere_inertia: f64,
    state: State,
    grip: Option<Grip>,
    external: Vec3,
    controllers: Controllers,
    decoder: Decoder<ToController>,
    method: Method,
    max_step_ns: u64,
    max_jump_ns: u64,
    /// What the owner's clock said last.
    now_ns: u64,
    /// How long the plant has moved.
    simulated_ns: u64,
    refused: u64,
}

impl SimulatedRig {
    /// A rig that has just powered up; its clock stands at 0.
    ///
    /// # Errors
    /// Where joints and device do not fit, or the device's inertias contradict each other.
    pub fn new(config: &RigConfig) -> Result<Self, RigError> {
        let wanted = config.device.joints();
        if config.joints.len() != wanted {
            return Err(RigError::Joints { given: config.joints.len(), wanted });
        }
        let plant = Plant::new(&config.device).map_err(RigError::Inertia)?;
        let mut rig = Self {
            sphere_inertia: plant.sphere_inertia(),
            plant,
            state: config.start,
            grip: None,
            external: Vec3::ZERO,
            controllers: Controllers::new(&config.joints, &config.start.joints()),
            decoder: Decoder::new(),
            method: config.method,
            max_step_ns: config.max_step_ns.max(1),
            max_jump_ns: config.max_jump_ns,
            now_ns: 0,
            simulated_ns: 0,
            refused: 0,
        };
        rig.set_hand(config.hand);
        Ok(rig)
    }

    /// Takes in `bytes` that arrived at `now_ns` and appends the bytes of the answers to `reply`.
    ///
    /// The plant is first moved on to `now_ns` under the torques held so far; the new ones act from then on. Nothing
    /// is allocated where `reply` has room for [`MAX_FEEDBACK_FRAME`] bytes a message.
    pub fn receive(&mut self, now_ns: u64, bytes: &[u8], reply: &mut Vec<u8>) {
        self.advance_to(now_ns);
        let Self { plant, state, controllers, decoder, refused, now_ns, .. } = self;
        decoder.feed(bytes, |result| {
            let answer = match result {
                Ok(ToController::Describe) => controllers.describe().map(FromController::Description),
                Ok(ToController::Command(command)) => controllers
                    .command(*now_ns, &command, &state.joints(), &plant.joint_rates(state))
                    .map(FromController::Feedback),
                Err(_) => {
                    *refused += 1;
                    None
                }
            };
            if let Some(answer) = answer {
                let mut frame = [0; MAX_FEEDBACK_FRAME];
                // No message is longer than such a frame, so there is always one.
                if let Ok(length) = encode(&answer, &mut frame) {
                    reply.extend_from_slice(&frame[..length]);
                }
            }
        });
    }

    /// Moves the plant on to `now_ns` under the torques held. A watchdog that expires on the way ends them at its very
    /// time. A time before the last one is ignored.
    pub fn advance_to(&mut self, now_ns: u64) {
        let Some(passed) = now_ns.checked_sub(self.now_ns) else { return };
        let mut left = passed.min(self.max_jump_ns);
        if let Some(deadline) = self.controllers.deadline().filter(|deadline| *deadline <= now_ns) {
            let held = deadline.saturating_sub(self.now_ns).min(left);
            self.simulate(held);
            self.controllers.watch(deadline);
            left -= held;
        }
        self.simulate(left);
        self.now_ns = now_ns;
    }

    /// Sets the clock without moving the plant: the time from which the next interval counts, ns.
    pub fn set_clock(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn simulate(&mut self, ns: u64) {
        if ns == 0 {
            return;
        }
        let steps = ns.div_ceil(self.max_step_ns);
        let h = ns as f64 / 1.0e9 / steps as f64;
        let start = self.simulated_s();
        let tau = *self.controllers.torque();
        for i in 0..steps {
            let t = start + i as f64 * h;
            match &self.grip {
                None => self.plant.step(self.method, &mut self.state, t, h, &tau, &self.external),
                Some(grip) => {
                    self.plant.step(self.method, &mut self.state, t, h, &tau, &Sum(*grip, self.external));
                }
            }
        }
        self.simulated_ns += ns;
        self.controllers.sense(&self.state.joints());
    }

    /// How long the plant has moved, s: the time of its loads.
    #[must_use]
    pub fn simulated_s(&self) -> f64 {
        self.simulated_ns as f64 / 1.0e9
    }

    /// The truth: orientation, angular velocity, joint angles.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Puts the plant where a test wants it; counts follow, as if it had been moved there by hand.
    pub fn set_state(&mut self, state: State) {
        self.state = state;
        self.controllers.sense(&state.joints());
    }

    /// True joint rates in the order steer, drive of each wheel, rad/s.
    #[must_use]
    pub fn joint_rates(&self) -> [f64; MAX_JOINTS] {
        self.plant.joint_rates(&self.state)
    }

    /// The torques that the motors now give, in the joints' own sense, N m.
    #[must_use]
    pub fn joint_torque(&self) -> &JointTorques {
        self.controllers.torque()
    }

    /// The plant, with the inertia of the hand where there is one.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The hand that holds the sphere, and its target.
    #[must_use]
    pub fn grip(&self) -> Option<&Grip> {
        self.grip.as_ref()
    }

    /// Lets a hand take hold of the sphere as it is now, or let go. Orientation and angular velocity are kept.
    pub fn set_hand(&mut self, hand: Option<Hand>) {
        self.grip = hand.map(|hand| Grip::new(hand, self.simulated_s(), self.state.q));
        self.plant.set_sphere_inertia(self.sphere_inertia + hand.map_or(0.0, |hand| hand.inertia));
    }

    /// Sets a constant torque on the sphere in N, N m, besides wheels and hand.
    pub fn set_external(&mut self, torque: Vec3) {
        self.external = torque;
    }

    /// Makes trouble at the controllers, or ends it.
    pub fn inject(&mut self, fault: Fault) {
        if fault == Fault::Reboot {
            self.decoder.reset();
        }
        self.controllers.inject(fault, &self.state.joints());
    }

    /// How many frames were refused since power-up: damaged, or of no meaning.
    #[must_use]
    pub fn refused_frames(&self) -> u64 {
        self.refused
    }
}
