//! The control law: one tick leads from a reading to joint torques.
//!
//! ```text
//! reading -> Joints (angles, rates, posture, slip) -> Orientation -> faults and commands
//!         -> Renderer (the scene) -> stream, gain, blend, passivity, limits
//!         -> allocation -> compensation -> Outputs
//! ```

mod commands;
mod compensation;
mod faults;
mod torque;

use crate::allocation::{ContactArms, Gives, JointLimits};
use crate::count::{Count, Two};
use crate::design::device::{MAX_JOINTS, MAX_WHEELS};
use crate::design::rig::Rig;
use crate::inputs::{Inputs, MAX_COMMANDS, Stamp};
use crate::motion::joints::Joints;
use crate::motion::lateness::Lateness;
use crate::motion::orientation::Orientation;
use crate::motion::reference::{Drift, Uncertainty};
use crate::outputs::{Drive, Outputs, State, TakenStream};
use crate::real::{Quat, Real, Vec3};
use crate::render::Renderer;
use crate::render::effects::Motion;
use crate::render::fades::Fades;
use crate::render::lead::Lead;
use crate::render::model::Modelled;
use crate::render::scene::CompiledScene;
use crate::safety::burst::Burst;
use crate::safety::falling::Falling;
use crate::safety::heat::Heat;
use crate::safety::mode::{Cause, ModeMachine};
use crate::safety::passivity::{Guard, Ledger, Observer};
use crate::safety::shaking;
use crate::safety::shaping::{Blend, Stream};

use self::compensation::{Compensator, Rising};
use self::faults::Silence;
pub use crate::motion::orientation::ALIGN_HISTORY;

pub use self::faults::{
    CORRUPT_FAULT, CORRUPT_FORGIVEN_TICKS, DISOBEDIENCE_S, LATE_FAULT_NS, MISSED_FAULT, MISSED_FORGIVEN,
    SKIPPED_FAULT,
};
use self::torque::{Made, Wanted};

/// The control law of one rig. Each tick computes joint torques from a reading of the motors, the
/// scene and the commands of clients.
///
/// It has no clock and does no input or output. The same inputs give the same bits on any machine.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Controller {
    rig: Rig,
    limits: JointLimits,
    gives: Gives,
    arms: [ContactArms; MAX_WHEELS],
    joints: Joints,
    orientation: Orientation,
    machine: ModeMachine,
    renderer: Renderer,
    blend: Blend,
    /// Motion of the sphere for which the effects are rendered. Until a tick renders them, it is
    /// the motion of the tick before. This is also true of `rendered_stream`.
    rendered_motion: Motion,
    stream: Stream,
    observer: Observer,
    /// Energy that the rig has given to the hand in a short time. `None` if the rig does not limit
    /// it.
    burst: Option<Burst>,
    guard: Option<Guard>,
    heat: Option<Heat>,
    /// Torque that the motors made in the last tick. The next torque may differ from it by at most
    /// the slew limit.
    made: Made,
    /// Sum of the torques of scene and stream in the last tick, after the torque limit, N m.
    last_asked: Vec3,
    rendered_stream: Stream,
    /// Size of the torque that the motors already made when a soft start began, N m. This torque
    /// fades out at the beginning of the soft start. `carried_s` is the time since then, s.
    carried: Real,
    carried_s: Real,
    last_tick: Option<u64>,
    silence: Silence,
    corrupt: Real,
    /// Number of ticks for which motors have been on or off contrary to the command.
    disobeyed_ticks: u64,
    /// True after homing. The zeros of the steer joints are then known, so the joint angles are
    /// those of the wheels.
    homed: bool,
    /// True if a motor controller has rebooted since the start. Zeros that were assumed without
    /// homing are then no longer valid.
    rebooted: bool,
    client_lost: bool,
    /// True if `enable` has just placed the effects' references relative to the present
    /// orientation. The torque then blends as after a change of scene.
    anchored: bool,
    client: Option<(Stamp, u64)>,
    /// Whether a change of scene is under way.
    fades: Fades,
    /// The guard against a sphere that shakes by itself. All bits zero: switched off.
    shaking: shaking::Guard,
    /// How far ahead of its reading the scene is rendered. `None` if it is rendered at the measured
    /// pose.
    lead: Option<Lead>,
    /// What counts of the energy for the passivity controller. `None` if all of it counts, or if
    /// the rig has no passivity controller.
    ledger: Option<Ledger>,
    /// How early the torque falls. `None` without a lead, and in older recordings.
    falling: Option<Falling>,
    /// What the guard against shaking knows of stored energy. All bits zero: nothing, as in older
    /// recordings.
    shaking_stored: shaking::Stored,
    /// What is fed forward of the rig's imperfections. `None` if none is known, and in older
    /// recordings.
    compensation: Option<Compensator>,
    /// The uncertainty of the orientation. `None` until a measurement with a sigma has been taken,
    /// and in older recordings.
    uncertainty: Option<Uncertainty>,
    /// The local model that a client streams. All bits zero: none, as in older recordings.
    model: Modelled,
    /// How the friction that is fed forward rises. `None` if nothing is known, and in older
    /// recordings.
    rising: Option<Rising>,
    /// How late the last commands were sent. All bits zero: not known, as in older recordings.
    lateness: Lateness,
    /// How fast the orientation drifts. All bits zero: as a rig as drawn, as in older recordings.
    drift: Drift,
}

impl Controller {
    /// Creates the control law for `rig`. The steer joints are not homed yet, and the orientation
    /// is the identity.
    #[must_use]
    pub fn new(rig: Rig) -> Self {
        let first = ContactArms::of(&rig.device.wheels()[0], rig.device.sphere_radius());
        let mut arms = [first; MAX_WHEELS];
        for (i, wheel) in rig.device.wheels().iter().enumerate() {
            arms[i] = ContactArms::of(wheel, rig.device.sphere_radius());
        }
        let limits = JointLimits::of(&rig);
        Self {
            gives: Gives::of(&limits, rig.device.joints()),
            limits,
            arms,
            joints: Joints::new(&rig),
            guard: rig.methods.passivity.map(Guard::new),
            burst: rig.limits.energy.map(Burst::new),
            lead: Lead::new(&rig),
            falling: rig.lead.map(|_| Falling::NONE),
            compensation: Compensator::new(&rig),
            uncertainty: None,
            heat: rig.limits.thermal_time.map(|time_s| Heat::new(&rig, time_s)),
            rig,
            orientation: Orientation::new(),
            machine: ModeMachine::START,
            renderer: Renderer::new(&rig),
            blend: Blend::DONE,
            rendered_motion: Motion { q: Quat::IDENTITY, omega: Vec3::ZERO },
            stream: Stream::NONE,
            observer: Observer::START,
            made: Made::NOTHING,
            last_asked: Vec3::ZERO,
            rendered_stream: Stream::NONE,
            carried: 0.0,
            carried_s: 0.0,
            last_tick: None,
            silence: Silence::default(),
            corrupt: 0.0,
            disobeyed_ticks: 0,
            homed: false,
            rebooted: false,
            client_lost: false,
            anchored: false,
            client: None,
            fades: Fades::Running,
            shaking: shaking::Guard::OFF,
            ledger: rig.methods.passivity.filter(|limit| !limit.strict).map(|_| Ledger::START),
            shaking_stored: shaking::Stored::OFF,
            model: Modelled::NONE,
            rising: Compensator::rising(&rig),
            lateness: Lateness::OFF,
            drift: Drift::of(&rig),
        }
    }

    /// Sets whether each reading names the command that it answers. Then the rates that follow from
    /// angles count how late that command was sent. It is off at first.
    #[must_use]
    pub fn with_named_commands(mut self, on: bool) -> Self {
        self.lateness.switch(on);
        self
    }

    /// Switches the guard against a sphere that shakes by itself on or off (see
    /// [`shaking`]). It is off at first.
    #[must_use]
    pub fn with_shaking_guard(mut self, on: bool) -> Self {
        self.shaking.switch(on);
        self.shaking_stored.switch(on);
        self
    }

    /// Returns the rig that this control law is for.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Runs one tick: takes the reading, executes the commands, renders `scene`, and returns joint
    /// torques and the state.
    #[inline]
    pub fn tick(&mut self, scene: &CompiledScene, inputs: &Inputs) -> Outputs {
        if self.rig.device.wheels().len() == 2 {
            self.tick_of(Two, scene, inputs)
        } else {
            self.tick_of(self.rig.device.count(), scene, inputs)
        }
    }

    /// Implements [`tick`](Self::tick) for a rig with `count` wheels.
    #[inline(never)]
    fn tick_of<C: Count>(&mut self, count: C, scene: &CompiledScene, inputs: &Inputs) -> Outputs {
        // A tick with a number not after the last one takes no time.
        let elapsed = self.last_tick.map_or(1, |last| inputs.tick.saturating_sub(last));
        self.last_tick = Some(inputs.tick);
        let dt = elapsed.min(SKIPPED_FAULT) as Real * self.rig.timing.period_s();
        let powered = self.powered();
        if let Some(heat) = &mut self.heat {
            heat.advance(dt);
        }
        if let Some(burst) = &mut self.burst {
            burst.leak(dt, powered);
        }

        self.lateness.begin(inputs, &self.rig);
        let measured = self.measure(count, inputs, elapsed);
        let align_step = if powered { self.rig.limits.align_rate * dt } else { Real::INFINITY };
        self.orientation.settle(inputs.tick, align_step);
        self.count_complaints(inputs, elapsed);
        let present = self.fault_condition(inputs, elapsed, measured);
        match present {
            // The loss of the client is an event: it ends when it has become a fault.
            Some(Cause::ClientLost) => self.client_lost = false,
            None if measured == Ok(true) => self.home(inputs.feedback.as_ref()),
            _ => {}
        }
        self.machine.take_condition(present);
        let changed = self.renderer.adopt(scene, self.orientation.q);
        if changed {
            self.shaking.allow();
        }
        let replies = (!inputs.commands.is_empty()).then(|| self.obey_all(scene, inputs));
        self.machine.ramp(dt);
        if self.shaking.is_needed(self.joints.omega) {
            self.look_for_shaking(scene, inputs.tick, dt);
        }

        let wanted = self.render(scene, inputs.tick, dt, changed);
        self.hold(count, inputs.tick, &wanted);
        let fresh = matches!(measured, Ok(true));
        let mut outputs = Outputs {
            drive: self.drive(count),
            replies: [None; MAX_COMMANDS],
            state: self.state(count, inputs.tick, fresh),
        };
        // Most ticks have no replies. To choose between two arrays of them would copy each byte.
        if let Some(replies) = replies {
            outputs.replies = replies;
        }
        if self.compensation.is_some() {
            self.compensate(count, inputs.tick, dt, &mut outputs);
        }
        outputs
    }

    /// Takes the motors' reading if it is new. Returns true if it was taken, false if there was no
    /// new reading, and the cause of a fault if the reading is invalid.
    #[inline]
    fn measure<C: Count>(&mut self, count: C, inputs: &Inputs, elapsed: u64) -> Result<bool, Cause> {
        if inputs.rebooted {
            self.homed = false;
            self.rebooted = true;
        }
        let news = inputs.feedback.as_ref().filter(|feedback| self.joints.is_news(feedback, inputs.tick));
        self.silence.advance(elapsed, news.is_some(), self.rig.timing.timeout_ticks);
        let Some(feedback) = news else { return Ok(false) };
        if !self.homed {
            self.joints.start(&self.rig, feedback)?;
            return Ok(true);
        }
        let judged = self.powered() || self.machine.cause.is_some();
        let late = (inputs.tick as u32).wrapping_sub(feedback.sequence).saturating_sub(elapsed.max(1) as u32);
        let last = self.joints.answered().unwrap_or(feedback.sequence.wrapping_sub(1));
        let time = self.lateness.between(last, feedback.sequence);
        let step = self.joints.advance(count, &self.rig, feedback, (late, time), judged)?;
        self.orientation.advance(step.turn);
        if let Some(uncertainty) = &mut self.uncertainty {
            uncertainty.grow(step.turn, elapsed as Real * self.rig.timing.period_s(), self.drift);
        }
        let given = self.observer.advance(step.answered[0], step.answered[1], step.turn);
        if self.shaking.suspects() {
            let stored = &mut self.shaking_stored;
            self.shaking.attribute(stored, step.answered[0], step.answered[1], step.turn);
        }
        if let Some(guard) = &mut self.guard {
            match &mut self.ledger {
                Some(ledger) => ledger.turned(step.answered[0], step.answered[1], step.turn, given),
                None => guard.add(given),
            }
        }
        if let Some(burst) = &mut self.burst {
            burst.add(given);
        }
        Ok(true)
    }

    /// Sets the torque that the motors make from this tick on: as much of `wanted` as motors and
    /// contacts can make.
    #[inline]
    fn hold<C: Count>(&mut self, count: C, tick: u64, wanted: &Wanted) {
        if wanted.torque == Vec3::ZERO {
            self.made = Made { scale: wanted.share, ..Made::NOTHING };
        } else if wanted.torque.is_finite() {
            self.make(count, wanted);
        } else {
            self.made = Made { torque: wanted.torque, ..Made::NOTHING };
        }
        self.send(count, tick);
        if let Some(ledger) = &mut self.ledger {
            // What motors and contacts make of the torque that the limit of torque leaves.
            ledger.record(tick as u32, self.made.torque, self.made.scale / wanted.share);
        }
    }

    /// Sends `made` to the motors in this tick. If one of its numbers is not finite, the rig goes
    /// to fault and the motors make no torque.
    #[inline]
    fn send<C: Count>(&mut self, count: C, tick: u64) {
        if !self.made.is_finite(count) {
            self.machine.take_condition(Some(Cause::NonFinite));
            self.made = Made::NOTHING;
        }
        self.observer.record(tick as u32, self.made.torque);
        if let Some(heat) = &mut self.heat {
            heat.hold(&self.made.joints);
        }
    }

    /// Returns the command to the motors. Each torque has the sign convention of the joint's motor
    /// controller.
    #[inline]
    fn drive<C: Count>(&self, count: C) -> Drive {
        let mut drive = Drive { enable: self.powered(), torque: [0.0; MAX_JOINTS] };
        for i in 0..count.joints() {
            drive.torque[i] = self.joints.in_controller_sense(i, self.made.joints[i]);
        }
        drive
    }

    /// Returns the state of this tick, which is published to clients. `fresh` is true if the tick
    /// took a new reading.
    #[inline]
    fn state<C: Count>(&self, count: C, tick: u64, fresh: bool) -> State {
        let made = &self.made;
        let client = self.client.map(|(stamp, taken)| TakenStream {
            seq: stamp.seq,
            age_ticks: tick.saturating_sub(stamp.tick.unwrap_or(taken)),
        });
        State {
            tick,
            mode: self.machine.mode,
            cause: self.machine.cause,
            q: self.orientation.q,
            omega: self.joints.omega,
            reference: self.renderer.reference(),
            torque: made.torque,
            joints: count.joints(),
            angle: self.joints.angle,
            rate: self.joints.rate,
            joint_torque: made.joints,
            slip: self.joints.slip,
            scale: made.scale,
            deficient: made.deficient,
            traction: made.traction,
            energy: self.observer.energy(),
            damping: self.guard.as_ref().map_or(0.0, Guard::damping),
            client,
            fresh,
            shaking: self.shaking.found(),
            lead_us: self.lead.as_ref().map_or(0.0, |lead| 1.0e6 * lead.time()),
            sigma: self.uncertainty.as_ref().map(|known| known.sigma(self.orientation.q)),
        }
    }
}

#[cfg(test)]
mod tests;
