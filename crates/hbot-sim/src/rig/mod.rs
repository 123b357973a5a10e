//! The simulated rig: a plant, controllers on a serial line, and perhaps a hand.
//!
//! It has no clock and no thread. Whoever owns it says what time it is and hands it the bytes that have arrived; it
//! moves the plant up to that time under the torques that were held, and gives back the bytes of the answers. In
//! virtual time a server calls [`SimulatedRig::receive`] once a tick; in wall time [`crate::pty`] does.

mod config;

use hbot_core::Vec3;
use hbot_core::device::MAX_JOINTS;
use hbot_link::{Decoder, FromController, MAX_FEEDBACK_FRAME, ToController, encode};

pub use self::config::{SimulatedConfig, SimulatedRigError};
use crate::controller::{InjectedFault, SimulatedControllers};
use crate::hand::Grip;
pub use crate::impairment::FrameCounts;
use crate::impairment::Impairment;
use crate::phenomena::{Hand, Link, Phenomena, of_plant};
use crate::plant::{Dynamics, JointTorques, PlantState};

/// The longest step of a plant where something sticks, slips or has play, ns. It is stable at any, and of order 1: this one is a
/// quarter of a tick's error for four times its cost, which still leaves time for a tick at 4 kHz (`docs/simulator.md`).
const MAX_NONSMOOTH_STEP_NS: u64 = 250_000;

/// A rig that exists in memory alone.
#[derive(Debug, Clone)]
pub struct SimulatedRig {
    dynamics: Dynamics,
    /// The sphere's own inertia, kg m².
    sphere_inertia: f64,
    state: PlantState,
    phenomena: Phenomena,
    grip: Option<Grip>,
    line: Option<Box<Impairment>>,
    external: Vec3,
    controllers: SimulatedControllers,
    decoder: Decoder<ToController>,
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
    pub fn new(config: &SimulatedConfig) -> Result<Self, SimulatedRigError> {
        let wanted = config.device.joints();
        if config.joints.len() != wanted {
            return Err(SimulatedRigError::Joints { given: config.joints.len(), wanted });
        }
        let dynamics = Dynamics::new(&config.device, &Phenomena::default(), config.method, &config.start)
            .map_err(SimulatedRigError::Inertia)?;
        let mut rig = Self {
            sphere_inertia: dynamics.sphere_inertia(),
            dynamics,
            state: config.start,
            phenomena: Phenomena::default(),
            grip: None,
            line: None,
            external: Vec3::ZERO,
            controllers: SimulatedControllers::new(
                &config.joints,
                &config.start.joints(),
                config.phenomena.encoder.as_ref(),
            ),
            decoder: Decoder::new(),
            max_step_ns: config.max_step_ns.max(1),
            max_jump_ns: config.max_jump_ns,
            now_ns: 0,
            simulated_ns: 0,
            refused: 0,
        };
        rig.phenomena.encoder = config.phenomena.encoder;
        rig.set_phenomena(config.phenomena);
        Ok(rig)
    }

    /// Takes in `bytes` that the host sent at `now_ns` and appends to `reply` what has reached it by then.
    ///
    /// The plant is first moved on to `now_ns` under the torques held so far; new ones act from when they arrive, which
    /// on a line that is not impaired is now. Nothing is allocated where `reply` has room for what comes:
    /// [`MAX_FEEDBACK_FRAME`] bytes a message.
    pub fn receive(&mut self, now_ns: u64, bytes: &[u8], reply: &mut Vec<u8>) {
        self.advance_to(now_ns);
        let Some(mut line) = self.line.take() else { return self.hear(bytes, reply) };
        line.command(self.now_ns, bytes);
        self.arrivals(&mut line, self.now_ns);
        while line.answers.take(self.now_ns, |bytes| reply.extend_from_slice(bytes)) {}
        self.line = Some(line);
    }

    /// Moves the plant on to `now_ns` and appends to `reply` what reached the host before then. Only on an impaired line
    /// ([`next_arrival_ns`](Self::next_arrival_ns)) there is any.
    ///
    /// For an owner that reads first and then writes at the same instant, as a loop in virtual time does: what is late by
    /// less than a period is read in the next one, as from a real line.
    pub fn deliver(&mut self, now_ns: u64, reply: &mut Vec<u8>) {
        self.advance_to(now_ns);
        if let (Some(line), Some(before)) = (&mut self.line, now_ns.checked_sub(1)) {
            while line.answers.take(before, |bytes| reply.extend_from_slice(bytes)) {}
        }
    }

    /// When the next frame arrives at either end of an impaired line, ns of the owner's clock.
    #[must_use]
    pub fn next_arrival_ns(&self) -> Option<u64> {
        self.line.as_ref().and_then(|line| line.next_ns())
    }

    /// The controllers hear `bytes` now; their answers are appended to `reply`.
    fn hear(&mut self, bytes: &[u8], reply: &mut Vec<u8>) {
        let Self { dynamics, state, controllers, decoder, refused, now_ns, .. } = self;
        decoder.feed(bytes, |result| {
            let answer = match result {
                Ok(ToController::Describe) => controllers.describe().map(FromController::Description),
                Ok(ToController::Command(command)) => controllers
                    .command(
                        *now_ns,
                        &command,
                        &dynamics.encoder_angles(state),
                        &dynamics.encoder_rates(state),
                    )
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

    /// Lets the controllers hear what reaches them by `now_ns`, each frame at its very time.
    fn arrivals(&mut self, line: &mut Impairment, now_ns: u64) {
        while let Some(due_ns) = line.commands.next_ns().filter(|due_ns| *due_ns <= now_ns) {
            self.move_to(due_ns);
            let Impairment { commands, scratch, .. } = line;
            commands.take(due_ns, |bytes| self.hear(bytes, scratch));
            line.answer(self.now_ns);
        }
    }

    /// Moves the plant on to `now_ns` under the torques held. What arrives on the way, and a watchdog that expires, act at
    /// their very time. A time before the last one is ignored.
    pub fn advance_to(&mut self, now_ns: u64) {
        if let Some(mut line) = self.line.take() {
            self.arrivals(&mut line, now_ns);
            self.line = Some(line);
        }
        self.move_to(now_ns);
    }

    fn move_to(&mut self, now_ns: u64) {
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
        let longest = if self.dynamics.is_nonsmooth() { MAX_NONSMOOTH_STEP_NS } else { u64::MAX };
        let steps = ns.div_ceil(self.max_step_ns.min(longest));
        let h = ns as f64 / 1.0e9 / steps as f64;
        let start = self.simulated_s();
        for i in 0..steps {
            let Self { dynamics, state, controllers, grip, .. } = self;
            let tau = controllers.drive(h, || dynamics.encoder_rates(state));
            dynamics.step(state, start + i as f64 * h, h, &tau, self.external, grip.as_ref());
        }
        self.simulated_ns += ns;
        self.controllers.sense(&self.dynamics.encoder_angles(&self.state));
    }

    /// How long the plant has moved, s: the time of its loads.
    #[must_use]
    pub fn simulated_s(&self) -> f64 {
        self.simulated_ns as f64 / 1.0e9
    }

    /// The truth: orientation, angular velocity, joint angles.
    #[must_use]
    pub fn state(&self) -> &PlantState {
        &self.state
    }

    /// Puts the plant where a test wants it; counts follow, as if it had been moved there by hand.
    pub fn set_state(&mut self, state: PlantState) {
        self.state = state;
        self.dynamics.adopt(&state);
        self.controllers.sense(&self.dynamics.encoder_angles(&state));
    }

    /// True rates of what the encoders sit on, in the order steer, drive of each wheel, rad/s.
    #[must_use]
    pub fn joint_rates(&self) -> [f64; MAX_JOINTS] {
        self.dynamics.encoder_rates(&self.state)
    }

    /// The torques that the motors give at this moment, in the joints' own sense, N m.
    #[must_use]
    pub fn joint_torque(&self) -> &JointTorques {
        self.controllers.torque()
    }

    /// The plant, with the inertia of the hand where there is one.
    #[must_use]
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// The hand that holds the sphere, and its target.
    #[must_use]
    pub fn grip(&self) -> Option<&Grip> {
        self.grip.as_ref()
    }

    /// The phenomena that are there.
    #[must_use]
    pub fn phenomena(&self) -> &Phenomena {
        &self.phenomena
    }

    /// Has all phenomena replaced from now on. Orientation and angular velocity are kept, counts go on from where they
    /// are, motors that stay keep current and heat; a hand takes hold anew.
    pub fn set_phenomena(&mut self, phenomena: Phenomena) {
        let old = core::mem::replace(&mut self.phenomena, phenomena);
        if phenomena.encoder != old.encoder {
            let angles = self.dynamics.encoder_angles(&self.state);
            self.controllers.set_encoder(phenomena.encoder.as_ref(), &angles);
        }
        if of_plant(&phenomena) != of_plant(&old) {
            self.dynamics.set_phenomena(&phenomena, &self.state);
        }
        self.controllers.set_motor(phenomena.motor);
        self.set_link(phenomena.link);
        self.set_hand(phenomena.hand);
    }

    /// Impairs the line from now on, or no longer. With other figures what is on its way arrives when it was to; of a line
    /// that is mended it is lost.
    pub fn set_link(&mut self, link: Option<Link>) {
        self.phenomena.link = link;
        self.line = link.map(|link| match self.line.take() {
            None => Box::new(Impairment::new(&link)),
            Some(mut line) => {
                line.replace(&link);
                line
            }
        });
    }

    /// What became of the frames on an impaired line, to the controllers and to the host.
    #[must_use]
    pub fn traffic(&self) -> Option<[FrameCounts; 2]> {
        self.line.as_ref().map(|line| [line.commands.traffic, line.answers.traffic])
    }

    /// Lets a hand take hold of the sphere as it is now, or let go. Orientation and angular velocity are kept.
    pub fn set_hand(&mut self, hand: Option<Hand>) {
        self.phenomena.hand = hand;
        self.grip = hand.map(|hand| Grip::new(hand, self.simulated_s(), self.state.q));
        self.dynamics.set_sphere_inertia(self.sphere_inertia + hand.map_or(0.0, |hand| hand.inertia));
    }

    /// Sets a constant torque on the sphere in N, N m, besides wheels and hand.
    pub fn set_external(&mut self, torque: Vec3) {
        self.external = torque;
    }

    /// Makes trouble at the controllers, or ends it.
    pub fn inject(&mut self, fault: InjectedFault) {
        if fault == InjectedFault::Reboot {
            self.decoder.reset();
        }
        self.controllers.inject(fault, &self.dynamics.encoder_angles(&self.state));
    }

    /// How many frames were refused since power-up: damaged, or of no meaning.
    #[must_use]
    pub fn refused_frames(&self) -> u64 {
        self.refused
    }
}
