//! The simulated rig: a plant, motor controllers on a serial line, and optionally a hand.
//!
//! It has no clock and no thread. The owner passes the time and the bytes that have arrived. The
//! rig simulates the plant up to that time under the torques held so far and returns the bytes of
//! the answers. In virtual time a server calls [`SimulatedRig::receive`] once a tick; in wall time
//! [`crate::served`] calls it.

mod config;

use hbot_core::Vec3;
use hbot_core::design::device::MAX_JOINTS;
use hbot_core::design::rig::Compensation;

pub use self::config::{SimulatedConfig, SimulatedRigError};
use crate::controller::{InjectedFault, SimulatedControllers, Truth, frame_end};
use crate::hand::{Grip, Guide, HandTorque};
pub use crate::impairment::FrameCounts;
use crate::impairment::Impairment;
use crate::phenomena::{Hand, Imbalance, Link, Phenomena, of_plant};
use crate::plant::Load as _;
use crate::plant::{Dynamics, Frictions, JointTorques, PlantState};
use crate::shafts::{MAX_COGGING_STEP_NS, Shafts};

/// Longest step of a nonsmooth plant (one that sticks, slips or has play), ns.
///
/// The method is stable at any step and has order 1. Compared with a step of 1 ms, this step has a
/// quarter of the error at four times the cost. The computation is still fast enough for ticks at 4
/// kHz (`docs/simulator.md`).
const MAX_NONSMOOTH_STEP_NS: u64 = 250_000;

/// Size of the buffer for messages that controllers send without being asked, in bytes. While it is
/// more than half full, further messages are dropped.
const UNASKED: usize = 64 * 1024;

/// A rig that is simulated in memory: the plant, the motor controllers, the line to them, and
/// optionally a hand on the sphere.
#[derive(Debug, Clone)]
pub struct SimulatedRig {
    dynamics: Dynamics,
    /// Inertia of the sphere without a hand, kg m².
    sphere_inertia: f64,
    state: PlantState,
    phenomena: Phenomena,
    /// Imperfections of this very rig, which are added to the phenomena.
    imperfect: Option<Box<Compensation>>,
    grip: Option<Grip>,
    /// Where the hand's torque is told to other threads, if any of them asks.
    hand_torque: Option<HandTorque>,
    line: Option<Box<Impairment>>,
    /// What torque constants and cogging make of the controllers' torques. `None` if motors are
    /// ideal in this respect.
    shafts: Option<Box<Shafts>>,
    /// Gear ratio of each joint.
    gears: [f64; MAX_JOINTS],
    external: Vec3,
    controllers: SimulatedControllers,
    /// The byte that ends a frame on the line.
    frame_end: u8,
    /// Messages that controllers have sent without being asked and that the host has not read yet.
    unasked: Vec<u8>,
    max_step_ns: u64,
    max_jump_ns: u64,
    /// Latest time that the owner of the rig has passed in, ns.
    now_ns: u64,
    /// Total time over which the plant has been simulated, ns.
    simulated_ns: u64,
}

impl SimulatedRig {
    /// Creates a rig that has just powered up, with its clock at 0.
    ///
    /// # Errors
    /// Fails if the number of joints does not fit the device, or if the inertias of a wheel are
    /// physically impossible.
    pub fn new(config: &SimulatedConfig) -> Result<Self, SimulatedRigError> {
        let wanted = config.device.joints();
        if config.joints.len() != wanted {
            return Err(SimulatedRigError::Joints { given: config.joints.len(), wanted });
        }
        let imperfect = config.imperfect.filter(Compensation::is_some);
        let frictions = imperfect.as_ref().and_then(frictions);
        let ideal = Phenomena::default();
        let plain = with_own(&ideal, imperfect.as_ref());
        let dynamics = Dynamics::rubbing(&config.device, &plain, frictions, config.method, &config.start)
            .map_err(SimulatedRigError::Inertia)?;
        let angles = config.start.joints();
        let encoder = config.phenomena.encoder.as_ref();
        let controllers =
            SimulatedControllers::new(config.line, config.lags, &config.joints, &angles, encoder)
                .ok_or(SimulatedRigError::Protocol(config.line.protocol))?;
        let mut rig = Self {
            sphere_inertia: dynamics.sphere_inertia(),
            dynamics,
            state: config.start,
            phenomena: ideal,
            imperfect: imperfect.map(Box::new),
            grip: None,
            hand_torque: None,
            line: None,
            shafts: None,
            gears: core::array::from_fn(|j| config.joints.get(j).map_or(1.0, |joint| joint.gear)),
            external: Vec3::ZERO,
            controllers,
            frame_end: frame_end(config.line.protocol),
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

    /// Receives `bytes` that the host sent at `now_ns`, and appends to `reply` the answers that
    /// have reached the host by then.
    ///
    /// The plant is first simulated up to `now_ns` under the torques held so far. New torques act
    /// from the time at which the bytes arrive, which is `now_ns` if the line is not impaired. No
    /// memory is allocated if `reply` has enough room: [`hbot_link::MAX_FEEDBACK_FRAME`] bytes for
    /// each message of hbot's own link.
    pub fn receive(&mut self, now_ns: u64, bytes: &[u8], reply: &mut Vec<u8>) {
        self.advance_to(now_ns);
        if let Some(told) = &self.hand_torque {
            told.set(self.hand_torque());
        }
        reply.append(&mut self.unasked);
        let Some(mut line) = self.line.take() else { return self.hear(bytes, reply) };
        line.command(self.now_ns, bytes);
        self.arrivals(&mut line, self.now_ns);
        while line.answers.take(self.now_ns, |bytes| reply.extend_from_slice(bytes)) {}
        self.line = Some(line);
    }

    /// Simulates the plant up to `now_ns` and appends to `reply` everything that reached the host
    /// before then.
    ///
    /// Only an impaired line, or a controller that sends messages without being asked, delivers
    /// bytes in this way (see [`next_arrival_ns`](Self::next_arrival_ns)). Use this function if you
    /// first read and then write at the same time, as a loop in virtual time does. An answer that
    /// is delayed by less than a period is then read one tick later, as on a real line.
    pub fn deliver(&mut self, now_ns: u64, reply: &mut Vec<u8>) {
        self.advance_to(now_ns);
        reply.append(&mut self.unasked);
        if let (Some(line), Some(before)) = (&mut self.line, now_ns.checked_sub(1)) {
            while line.answers.take(before, |bytes| reply.extend_from_slice(bytes)) {}
        }
    }

    /// Returns the next time at which a frame arrives at either end of an impaired line, or at
    /// which a controller sends a message without being asked, in ns of the owner's clock.
    #[must_use]
    pub fn next_arrival_ns(&self) -> Option<u64> {
        if !self.unasked.is_empty() {
            return Some(self.now_ns);
        }
        let line = self.line.as_ref().and_then(|line| line.next_ns());
        let own = self.controllers.next_word_ns();
        line.map_or(own, |line| Some(own.map_or(line, |own| own.min(line))))
    }

    /// Passes `bytes` to the motor controllers at the present time and appends their answers to
    /// `reply`.
    fn hear(&mut self, bytes: &[u8], reply: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let Self { dynamics, state, controllers, now_ns, .. } = self;
        let (angles, rates) = (dynamics.encoder_angles(state), dynamics.encoder_rates(state));
        controllers.hear(*now_ns, bytes, &Truth { angles: &angles, rates: &rates }, reply);
    }

    /// Passes every frame that arrives by `now_ns` to the motor controllers, each at its exact
    /// arrival time.
    fn arrivals(&mut self, line: &mut Impairment, now_ns: u64) {
        while let Some(due_ns) = line.commands.next_ns().filter(|due_ns| *due_ns <= now_ns) {
            self.move_to(due_ns, Some(line));
            let Impairment { commands, scratch, .. } = line;
            commands.take(due_ns, |bytes| self.hear(bytes, scratch));
            line.answer(self.now_ns);
        }
    }

    /// Simulates the plant up to `now_ns` under the torques commanded before.
    ///
    /// Frames that arrive meanwhile, and a watchdog that expires, take effect at their exact times.
    /// A time before the last one given is ignored.
    pub fn advance_to(&mut self, now_ns: u64) {
        let mut line = self.line.take();
        if let Some(line) = &mut line {
            self.arrivals(line, now_ns);
        }
        self.move_to(now_ns, line.as_deref_mut());
        self.line = line;
    }

    /// Simulates the plant up to `now_ns`. Messages that controllers send meanwhile without being
    /// asked go through `line` if it is impaired.
    fn move_to(&mut self, now_ns: u64, mut line: Option<&mut Impairment>) {
        let Some(passed) = now_ns.checked_sub(self.now_ns) else { return };
        let mut left = passed.min(self.max_jump_ns);
        // Each pass handles what was due, so the loop ends.
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

    /// Lets the controllers do what is due now without a request, such as an expired watchdog.
    fn pass(&mut self, line: Option<&mut Impairment>) {
        let Self { dynamics, state, controllers, now_ns, unasked, .. } = self;
        let (angles, rates) = (dynamics.encoder_angles(state), dynamics.encoder_rates(state));
        let truth = Truth { angles: &angles, rates: &rates };
        match line {
            Some(line) => {
                controllers.pass(*now_ns, &truth, &mut line.scratch);
                line.answer(*now_ns);
            }
            // If the host does not read the line, further bytes are lost.
            None if unasked.len() > UNASKED / 2 => controllers.pass(*now_ns, &truth, &mut Vec::new()),
            None => controllers.pass(*now_ns, &truth, unasked),
        }
    }

    /// Sets the clock to `now_ns` without simulating the plant, for example at the start. The next
    /// simulated interval begins at this time.
    pub fn set_clock(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn simulate(&mut self, ns: u64) {
        if ns == 0 {
            return;
        }
        let mut longest = if self.dynamics.is_nonsmooth() { MAX_NONSMOOTH_STEP_NS } else { u64::MAX };
        if self.shafts.as_ref().is_some_and(|shafts| shafts.cog()) {
            longest = longest.min(MAX_COGGING_STEP_NS);
        }
        let steps = ns.div_ceil(self.max_step_ns.min(longest));
        let h = ns as f64 / 1.0e9 / steps as f64;
        let start = self.simulated_s();
        for i in 0..steps {
            let Self { dynamics, state, controllers, grip, shafts, .. } = self;
            let mut tau = controllers.drive(h, || dynamics.encoder_rates(state));
            if let Some(shafts) = shafts {
                tau = shafts.act(&tau, h, &dynamics.encoder_angles(state), &dynamics.encoder_rates(state));
            }
            let motion = |state| (dynamics.encoder_angles(state), dynamics.encoder_rates(state));
            let before = controllers.filters().then(|| motion(state));
            dynamics.step(state, start + i as f64 * h, h, &tau, self.external, grip.as_ref());
            if let Some((angles, rates)) = &before {
                let after = (dynamics.encoder_angles(state), dynamics.encoder_rates(state));
                let after = Truth { angles: &after.0, rates: &after.1 };
                controllers.follow(h, &Truth { angles, rates }, &after);
            }
        }
        self.simulated_ns += ns;
        self.controllers.sense(&self.dynamics.encoder_angles(&self.state));
    }

    /// Returns the total time over which the plant has been simulated, s. Loads such as the hand
    /// use this time.
    #[must_use]
    pub fn simulated_s(&self) -> f64 {
        self.simulated_ns as f64 / 1.0e9
    }

    /// Returns the true state of the plant: orientation, angular velocity and joint angles.
    #[must_use]
    pub fn state(&self) -> &PlantState {
        &self.state
    }

    /// Replaces the plant's state, for tests. The encoders read as if the rig had been moved to the
    /// new state.
    pub fn set_state(&mut self, state: PlantState) {
        self.state = state;
        self.dynamics.adopt(&state);
        self.controllers.sense(&self.dynamics.encoder_angles(&state));
    }

    /// Returns the true rates that the encoders measure, rad/s, in the order steer, drive of each
    /// wheel. If gears have play, the encoder of a drive is on its motor.
    #[must_use]
    pub fn joint_rates(&self) -> [f64; MAX_JOINTS] {
        self.dynamics.encoder_rates(&self.state)
    }

    /// Returns the torques that the motors give now, in N m, without those of cogging and of torque
    /// constants that differ. A positive torque acts in the joint's positive direction.
    #[must_use]
    pub fn joint_torque(&self) -> &JointTorques {
        self.controllers.torque()
    }

    /// Returns the torques that the motors give now, in N m, with those of cogging and of torque
    /// constants that differ. A positive torque acts in the joint's positive direction.
    #[must_use]
    pub fn shaft_torque(&self) -> JointTorques {
        let tau = self.controllers.torque();
        let Some(shafts) = &self.shafts else { return *tau };
        let angles = self.dynamics.encoder_angles(&self.state);
        shafts.act(tau, 0.0, &angles, &[0.0; MAX_JOINTS])
    }

    /// Returns the plant, including the hand's inertia if a hand holds the sphere.
    #[must_use]
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// Returns the simulated hand that holds the sphere, or `None`.
    #[must_use]
    pub fn grip(&self) -> Option<&Grip> {
        self.grip.as_ref()
    }

    /// Returns the phenomena of a real rig, such as friction, that are switched on.
    #[must_use]
    pub fn phenomena(&self) -> &Phenomena {
        &self.phenomena
    }

    /// Replaces all phenomena from now on.
    ///
    /// Orientation and angular velocity are kept. Encoder counts continue from their present
    /// values. If motors are simulated before and after, they keep their current and heat. A hand
    /// takes hold again at the present orientation.
    pub fn set_phenomena(&mut self, phenomena: Phenomena) {
        let old = core::mem::replace(&mut self.phenomena, phenomena);
        if phenomena.encoder != old.encoder {
            let angles = self.dynamics.encoder_angles(&self.state);
            self.controllers.set_encoder(phenomena.encoder.as_ref(), &angles);
        }
        if of_plant(&phenomena) != of_plant(&old) {
            let all = with_own(&phenomena, self.imperfect.as_deref());
            self.dynamics.set_phenomena(&all, &self.state);
        }
        self.controllers.set_motor(phenomena.motor);
        self.shafts = Shafts::new(&phenomena, self.imperfect.as_deref(), &self.gears);
        self.set_link(phenomena.link);
        self.set_hand(phenomena.hand);
    }

    /// Impairs the line with the parameters `link` from now on. `None` ends the impairment.
    ///
    /// If only the parameters change, frames in flight arrive at the times already set. If the
    /// impairment ends, frames in flight are lost.
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

    /// Returns the numbers of frames on an impaired line: first those to the motor controllers,
    /// then those to the host. Returns `None` if the line is not impaired.
    #[must_use]
    pub fn traffic(&self) -> Option<[FrameCounts; 2]> {
        self.line.as_ref().map(|line| [line.commands.traffic, line.answers.traffic])
    }

    /// Lets a simulated hand take hold of the sphere at its present orientation. `None` makes the
    /// hand let go. Orientation and angular velocity are kept.
    pub fn set_hand(&mut self, hand: Option<Hand>) {
        self.phenomena.hand = hand;
        self.grip = hand.map(|hand| Grip::new(hand, self.simulated_s(), self.state.q));
        self.dynamics.set_sphere_inertia(self.sphere_inertia + hand.map_or(0.0, |hand| hand.inertia));
    }

    /// Lets a simulated hand turn the sphere to an orientation. A hand that is guided already goes
    /// on from where its target is, another one takes hold of the sphere at its present
    /// orientation.
    pub fn guide_hand(&mut self, guide: &Guide) {
        let t = self.simulated_s();
        let guided = self.grip.as_ref().filter(|grip| grip.is_guided());
        let from = guided.map_or(self.state.q, |grip| grip.target(t).q);
        let grip = Grip::guided(guide, t, from);
        self.grip = Some(grip);
        self.dynamics.set_sphere_inertia(self.sphere_inertia + guide.inertia);
    }

    /// Lets go of the sphere. The phenomenon `hand` stays, so that
    /// [`resume_hand`](Self::resume_hand) lets the hand take hold again.
    pub fn release_hand(&mut self) {
        self.grip = None;
        self.dynamics.set_sphere_inertia(self.sphere_inertia);
    }

    /// Lets the hand of the phenomena take hold of the sphere at its present orientation, after a
    /// program has guided it. Without the phenomenon `hand`, lets go of the sphere.
    pub fn resume_hand(&mut self) {
        self.set_hand(self.phenomena.hand);
    }

    /// Returns the torque of the simulated hand on the sphere in frame N, N m. `None` if no hand
    /// holds it.
    #[must_use]
    pub fn hand_torque(&self) -> Option<Vec3> {
        let target = |grip: &Grip| grip.at(self.simulated_s());
        self.grip.as_ref().map(|grip| grip.torque(&target(grip), self.state.q, self.state.omega))
    }

    /// Stores the hand's torque in `told` from now on, whenever a command arrives.
    pub fn tell_hand_torque(&mut self, told: HandTorque) {
        self.hand_torque = Some(told);
    }

    /// Sets a constant torque on the sphere in frame N, in N m. It is added to the torques of the
    /// wheels and of the simulated hand.
    pub fn set_external(&mut self, torque: Vec3) {
        self.external = torque;
    }

    /// Returns the simulated motor controllers, so that a test can change their settings and ids.
    pub fn controllers_mut(&mut self) -> &mut SimulatedControllers {
        &mut self.controllers
    }

    /// Switches a fault of the motor controllers on or off.
    pub fn inject(&mut self, fault: InjectedFault) {
        self.controllers.inject(fault, &self.dynamics.encoder_angles(&self.state));
    }

    /// Returns the number of received frames that were refused since power-up because they were
    /// damaged or invalid.
    #[must_use]
    pub fn refused_frames(&self) -> u64 {
        self.controllers.refused()
    }
}

/// Returns `phenomena` with the imbalance that the sphere has by itself.
fn with_own(phenomena: &Phenomena, imperfect: Option<&Compensation>) -> Phenomena {
    let mut all = *phenomena;
    if let Some(own) = imperfect.filter(|own| own.imbalance != Vec3::ZERO) {
        let other = phenomena.imbalance.map_or(Vec3::ZERO, |it| Vec3::from_array(it.torque));
        all.imbalance = Some(Imbalance { torque: (own.imbalance + other).to_array() });
    }
    all
}

/// Returns the friction of the joints and of the sphere, or `None` if nothing rubs.
fn frictions(imperfect: &Compensation) -> Option<Frictions> {
    let joints = imperfect.joints.map(|joint| joint.friction);
    let rubs = imperfect.sphere.is_some() || joints.iter().any(|friction| friction.is_some());
    rubs.then_some(Frictions { joints, sphere: imperfect.sphere })
}
