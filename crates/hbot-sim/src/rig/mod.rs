//! The simulated rig: a plant, controllers on a serial line, and perhaps a hand.
//!
//! It has no clock and no thread. Whoever owns it says what time it is and hands it the bytes that have arrived; it
//! moves the plant up to that time under the torques that were held, and gives back the bytes of the answers. In
//! virtual time a server calls [`SimulatedRig::receive`] once a tick; in wall time [`crate::pty`] does.

mod config;

use hbot_core::Vec3;
use hbot_core::device::MAX_JOINTS;

pub use self::config::{RigConfig, RigError};
use crate::controller::{Controllers, Fault, Truth, frame_end};
use crate::hand::Grip;
use crate::impairment::Impairment;
pub use crate::impairment::Traffic;
use crate::phenomena::{Hand, Link, Phenomena, of_plant};
use crate::plant::{Dynamics, JointTorques, State};

/// The longest step of a plant where something sticks, slips or has play, ns. It is stable at any, and of order 1: this one is a
/// quarter of a tick's error for four times its cost, which still leaves time for a tick at 4 kHz (`docs/simulator.md`).
const MAX_NONSMOOTH_STEP_NS: u64 = 250_000;

/// Room for what controllers say unasked between two looks of the host, bytes. Beyond half of it nothing more is kept.
const UNASKED: usize = 64 * 1024;

/// A rig that exists in memory alone.
#[derive(Debug, Clone)]
pub struct SimulatedRig {
    dynamics: Dynamics,
    /// The sphere's own inertia, kg m².
    sphere_inertia: f64,
    state: State,
    phenomena: Phenomena,
    grip: Option<Grip>,
    line: Option<Box<Impairment>>,
    external: Vec3,
    controllers: Controllers,
    /// The byte that ends a frame on the line.
    frame_end: u8,
    /// What controllers have said unasked and the host has not read yet.
    unasked: Vec<u8>,
    max_step_ns: u64,
    max_jump_ns: u64,
    /// What the owner's clock said last.
    now_ns: u64,
    /// How long the plant has moved.
    simulated_ns: u64,
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
        let dynamics = Dynamics::new(&config.device, &Phenomena::default(), config.method, &config.start)
            .map_err(RigError::Inertia)?;
        let angles = config.start.joints();
        let encoder = config.phenomena.encoder.as_ref();
        let controllers = Controllers::new(config.protocol, &config.joints, &angles, encoder)
            .ok_or(RigError::Protocol(config.protocol))?;
        let mut rig = Self {
            sphere_inertia: dynamics.sphere_inertia(),
            dynamics,
            state: config.start,
            phenomena: Phenomena::default(),
            grip: None,
            line: None,
            external: Vec3::ZERO,
            controllers,
            frame_end: frame_end(config.protocol),
            unasked: Vec::with_capacity(UNASKED),
            max_step_ns: config.max_step_ns.max(1),
            max_jump_ns: config.max_jump_ns,
            now_ns: 0,
            simulated_ns: 0,
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
        reply.append(&mut self.unasked);
        let Some(mut line) = self.line.take() else { return self.hear(bytes, reply) };
        line.command(self.now_ns, bytes);
        self.arrivals(&mut line, self.now_ns);
        while line.answers.take(self.now_ns, |bytes| reply.extend_from_slice(bytes)) {}
        self.line = Some(line);
    }

    /// Moves the plant on to `now_ns` and appends to `reply` what reached the host before then. Only on an impaired line, or
    /// from controllers that speak unasked ([`next_arrival_ns`](Self::next_arrival_ns)), there is any.
    ///
    /// For an owner that reads first and then writes at the same instant, as a loop in virtual time does: what is late by
    /// less than a period is read in the next one, as from a real line.
    pub fn deliver(&mut self, now_ns: u64, reply: &mut Vec<u8>) {
        self.advance_to(now_ns);
        reply.append(&mut self.unasked);
        if let (Some(line), Some(before)) = (&mut self.line, now_ns.checked_sub(1)) {
            while line.answers.take(before, |bytes| reply.extend_from_slice(bytes)) {}
        }
    }

    /// When the next frame arrives at either end of an impaired line, or a controller speaks unasked, ns of the owner's clock.
    #[must_use]
    pub fn next_arrival_ns(&self) -> Option<u64> {
        if !self.unasked.is_empty() {
            return Some(self.now_ns);
        }
        let line = self.line.as_ref().and_then(|line| line.next_ns());
        let own = self.controllers.next_word_ns();
        line.map_or(own, |line| Some(own.map_or(line, |own| own.min(line))))
    }

    /// The controllers hear `bytes` now; their answers are appended to `reply`.
    fn hear(&mut self, bytes: &[u8], reply: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let Self { dynamics, state, controllers, now_ns, .. } = self;
        let (angles, rates) = (dynamics.encoder_angles(state), dynamics.encoder_rates(state));
        controllers.hear(*now_ns, bytes, &Truth { angles: &angles, rates: &rates }, reply);
    }

    /// Lets the controllers hear what reaches them by `now_ns`, each frame at its very time.
    fn arrivals(&mut self, line: &mut Impairment, now_ns: u64) {
        while let Some(due_ns) = line.commands.next_ns().filter(|due_ns| *due_ns <= now_ns) {
            self.move_to(due_ns, Some(line));
            let Impairment { commands, scratch, .. } = line;
            commands.take(due_ns, |bytes| self.hear(bytes, scratch));
            line.answer(self.now_ns);
        }
    }

    /// Moves the plant on to `now_ns` under the torques held. What arrives on the way, and a watchdog that expires, act at
    /// their very time. A time before the last one is ignored.
    pub fn advance_to(&mut self, now_ns: u64) {
        let mut line = self.line.take();
        if let Some(line) = &mut line {
            self.arrivals(line, now_ns);
        }
        self.move_to(now_ns, line.as_deref_mut());
        self.line = line;
    }

    /// Moves the plant on to `now_ns`. What controllers say unasked meanwhile goes on `line` where it is impaired.
    fn move_to(&mut self, now_ns: u64, mut line: Option<&mut Impairment>) {
        let Some(passed) = now_ns.checked_sub(self.now_ns) else { return };
        let mut left = passed.min(self.max_jump_ns);
        // Each pass takes what is due then away.
        while let Some(due_ns) = self.controllers.next_ns().filter(|due_ns| *due_ns <= now_ns) {
            let held = due_ns.saturating_sub(self.now_ns).min(left);
            self.simulate(held);
            left -= held;
            self.now_ns = self.now_ns.max(due_ns);
            self.pass(line.as_deref_mut());
        }
        self.simulate(left);
        self.now_ns = now_ns;
    }

    /// Has the controllers do what is due by themselves now.
    fn pass(&mut self, line: Option<&mut Impairment>) {
        let Self { dynamics, state, controllers, now_ns, unasked, .. } = self;
        let (angles, rates) = (dynamics.encoder_angles(state), dynamics.encoder_rates(state));
        let truth = Truth { angles: &angles, rates: &rates };
        match line {
            Some(line) => {
                controllers.pass(*now_ns, &truth, &mut line.scratch);
                line.answer(*now_ns);
            }
            // Of a line that nobody reads bytes are lost.
            None if unasked.len() > UNASKED / 2 => controllers.pass(*now_ns, &truth, &mut Vec::new()),
            None => controllers.pass(*now_ns, &truth, unasked),
        }
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
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Puts the plant where a test wants it; counts follow, as if it had been moved there by hand.
    pub fn set_state(&mut self, state: State) {
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
            None => Box::new(Impairment::new(&link, self.frame_end)),
            Some(mut line) => {
                line.replace(&link);
                line
            }
        });
    }

    /// What became of the frames on an impaired line, to the controllers and to the host.
    #[must_use]
    pub fn traffic(&self) -> Option<[Traffic; 2]> {
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
    pub fn inject(&mut self, fault: Fault) {
        self.controllers.inject(fault, &self.dynamics.encoder_angles(&self.state));
    }

    /// How many frames were refused since power-up: damaged, or of no meaning.
    #[must_use]
    pub fn refused_frames(&self) -> u64 {
        self.controllers.refused()
    }
}
