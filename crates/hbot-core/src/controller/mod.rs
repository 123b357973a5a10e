//! One tick: from feedback to joint torques.
//!
//! ```text
//! feedback -> Joints (angles, rates, posture, slip) -> Orientation -> faults and commands -> Renderer (the scene)
//!          -> blend, stream, gain, passivity, limits -> allocation -> Outputs
//! ```

mod commands;

use crate::allocation::{self, ContactArms, JointLimits};
use crate::burst::Burst;
use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::effects::Motion;
use crate::heat::Heat;
use crate::inputs::{Command, Inputs, JointFeedback, Stamp};
use crate::joints::Joints;
use crate::mode::{Cause, Machine, Mode};
use crate::orientation::Orientation;
use crate::outputs::{Client, Drive, Outputs, Reply, State};
use crate::passivity::{Guard, Moment, Observer};
use crate::real::{Quat, Real, Vec3};
use crate::render::Renderer;
use crate::rig::{AllocationMethod, Rig};
use crate::scene::CompiledScene;
use crate::shaping::{Blend, Stream, limited, shortened, slewed};

/// A tick later than this is a fault, ns.
pub const LATE_FAULT_NS: u64 = 20_000_000;
/// As many skipped ticks in a row are a fault.
pub const SKIPPED_FAULT: u64 = 10;
/// Damaged frames that a link may owe before it is a fault; one is forgiven every [`CORRUPT_FORGIVEN_TICKS`] ticks, so that 1 %
/// of noise rides through and 50 % does not.
pub const CORRUPT_FAULT: Real = 10.0;
/// See [`CORRUPT_FAULT`].
pub const CORRUPT_FORGIVEN_TICKS: Real = 20.0;

/// The control law of one rig: a pure function of its state and inputs.
///
/// It has no clock and does no input or output. Same inputs, same bits, on any machine.
#[derive(Debug, Clone)]
pub struct Controller {
    rig: Rig,
    limits: JointLimits,
    arms: [ContactArms; MAX_WHEELS],
    joints: Joints,
    orientation: Orientation,
    machine: Machine,
    renderer: Renderer,
    blend: Blend,
    /// What the effects were rendered at in the last tick.
    last_motion: Motion,
    stream: Stream,
    observer: Observer,
    /// Energy given out in bursts, where the rig limits it.
    burst: Option<Burst>,
    guard: Option<Guard>,
    heat: Option<Heat>,
    /// A motor is too hot by its torques.
    hot: bool,
    /// Torque of the last tick, from which the next may differ by the slew limit.
    torque: Vec3,
    last_tick: Option<u64>,
    since_feedback: u64,
    corrupt: Real,
    /// The angles are those of the wheels.
    referenced: bool,
    /// A controller has rebooted since the start: zeros that were assumed can't be assumed again.
    rebooted: bool,
    client_lost: bool,
    /// References have just been anchored anew.
    anchored: bool,
    client: Option<(Stamp, u64)>,
}

impl Controller {
    /// A controller for `rig`, unreferenced, at the identity.
    #[must_use]
    pub fn new(rig: Rig) -> Self {
        let mut limits = JointLimits { peak: [0.0; MAX_JOINTS], weight: [1.0; MAX_JOINTS] };
        let first = ContactArms::of(&rig.device.wheels()[0], rig.device.sphere_radius());
        let mut arms = [first; MAX_WHEELS];
        for (i, wheel) in rig.device.wheels().iter().enumerate() {
            arms[i] = ContactArms::of(wheel, rig.device.sphere_radius());
            let [steer, drive] = arms[i].weights();
            limits.weight[2 * i] = steer;
            limits.weight[2 * i + 1] = drive;
        }
        for i in 0..rig.device.joints() {
            limits.peak[i] = rig.joints[i].peak;
        }
        Self {
            limits,
            arms,
            joints: Joints::new(&rig),
            guard: rig.methods.passivity.map(Guard::new),
            burst: rig.limits.energy.map(Burst::new),
            heat: rig.limits.thermal_time.map(|time_s| Heat::new(&rig, time_s)),
            hot: false,
            rig,
            orientation: Orientation::new(),
            machine: Machine::START,
            renderer: Renderer::new(&rig),
            blend: Blend::DONE,
            last_motion: Motion { q: Quat::IDENTITY, omega: Vec3::ZERO },
            stream: Stream::NONE,
            observer: Observer::START,
            torque: Vec3::ZERO,
            last_tick: None,
            since_feedback: 0,
            corrupt: 0.0,
            referenced: false,
            rebooted: false,
            client_lost: false,
            anchored: false,
            client: None,
        }
    }

    /// The rig that it controls.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// One tick.
    pub fn tick(&mut self, scene: &CompiledScene, inputs: &Inputs) -> Outputs {
        // A tick that is not after the last one takes no time.
        let elapsed = self.last_tick.map_or(1, |last| inputs.tick.saturating_sub(last));
        self.last_tick = Some(inputs.tick);
        let dt = elapsed.min(SKIPPED_FAULT) as Real * self.rig.timing.period_s();
        if let Some(heat) = &mut self.heat {
            self.hot = heat.held(dt);
        }
        if let Some(burst) = &mut self.burst {
            burst.pass(dt, self.machine.powered());
        }

        let measured = self.measure(inputs, elapsed);
        let align_step =
            if self.machine.powered() { self.rig.limits.align_rate * dt } else { Real::INFINITY };
        self.orientation.settle(inputs.tick, align_step);
        let present = self.fault(inputs, elapsed, measured);
        self.machine.observe(present);
        let changed = self.renderer.adopt(scene, self.orientation.q);
        let mut replies = [None; crate::inputs::MAX_COMMANDS];
        for (reply, command) in replies.iter_mut().zip(inputs.commands.iter()) {
            *reply = Some(self.obey(scene, inputs.tick, command));
        }
        // A stop has the last word in its tick, whatever came after it.
        if inputs.commands.iter().any(|command| matches!(command, Command::Estop)) {
            self.machine.estop();
        }
        self.machine.ramp(dt);

        let (torque, share) = self.wanted(scene, inputs.tick, dt, changed);
        self.send(scene, inputs.tick, torque, share, replies, matches!(measured, Ok(true)))
    }

    /// Takes the feedback, if there is news: whether there was, or what is wrong with it.
    #[inline]
    fn measure(&mut self, inputs: &Inputs, elapsed: u64) -> Result<bool, Cause> {
        if inputs.rebooted {
            self.referenced = false;
            self.rebooted = true;
        }
        let news = inputs.feedback.as_ref().filter(|feedback| self.joints.is_news(feedback, inputs.tick));
        let Some(feedback) = news else {
            self.since_feedback = self.since_feedback.saturating_add(elapsed);
            return Ok(false);
        };
        self.since_feedback = 0;
        if !self.referenced {
            self.joints.start(&self.rig, feedback)?;
            return Ok(true);
        }
        let step = self.joints.advance(&self.rig, feedback)?;
        self.orientation.advance(step.turn);
        let given = self.observer.turned(step.answered[0], step.answered[1], step.turn);
        if let Some(guard) = &mut self.guard {
            guard.given(given);
        }
        if let Some(burst) = &mut self.burst {
            burst.given(given);
        }
        Ok(true)
    }

    /// The fault condition of this tick, the gravest first.
    #[inline]
    fn fault(&mut self, inputs: &Inputs, elapsed: u64, feedback: Result<bool, Cause>) -> Option<Cause> {
        self.corrupt = (self.corrupt - elapsed as Real / CORRUPT_FORGIVEN_TICKS).max(0.0)
            + Real::from(inputs.corrupt_frames);
        self.corrupt = self.corrupt.min(2.0 * CORRUPT_FAULT);
        let complaints = inputs.feedback.map(|f| f.complaints).unwrap_or_default();
        let powered = self.machine.powered();
        if inputs.rebooted || complaints.fault {
            return Some(Cause::ControllerFault);
        }
        if complaints.overcurrent || (powered && self.burst.is_some_and(|burst| burst.over())) {
            return Some(Cause::Overtorque);
        }
        if complaints.overtemperature || self.hot {
            return Some(Cause::Thermal);
        }
        if feedback.is_err() {
            return feedback.err();
        }
        if self.since_feedback > u64::from(self.rig.timing.timeout_ticks) || (complaints.watchdog && powered)
        {
            return Some(Cause::LinkLost);
        }
        if self.corrupt >= CORRUPT_FAULT {
            return Some(Cause::LinkCorrupt);
        }
        if inputs.lateness_ns > LATE_FAULT_NS || elapsed > SKIPPED_FAULT {
            return Some(Cause::Deadline);
        }
        if core::mem::take(&mut self.client_lost) {
            return Some(Cause::ClientLost);
        }
        // Without power only where it is the fault to be reset: a person may spin a dead sphere.
        let judged = |cause| powered || self.machine.cause == Some(cause);
        if judged(Cause::Overspeed)
            && self.joints.omega.length_squared() > self.rig.limits.speed * self.rig.limits.speed
        {
            return Some(Cause::Overspeed);
        }
        if judged(Cause::Slip) && self.joints.slip > self.rig.limits.slip {
            return Some(Cause::Slip);
        }
        if feedback == Ok(true) {
            self.reference(inputs.feedback.as_ref());
        }
        None
    }

    /// Leaves `unreferenced` once all steering zeros are known.
    #[inline]
    fn reference(&mut self, feedback: Option<&JointFeedback>) {
        if self.referenced || self.machine.mode != Mode::Unreferenced {
            return;
        }
        if feedback.is_some_and(|feedback| Joints::zeros_known(&self.rig, feedback, !self.rebooted)) {
            self.referenced = true;
            self.machine.referenced();
        }
    }

    /// The torque wanted on the sphere in N: the scene and the stream, blended, faded and limited; and the share of it that
    /// the limit of torque left, 0 to 1.
    #[inline]
    fn wanted(&mut self, scene: &CompiledScene, tick: u64, dt: Real, changed: bool) -> (Vec3, Real) {
        let gain = self.machine.gain;
        let changed = core::mem::take(&mut self.anchored) || changed;
        let motion = Motion { q: self.orientation.q, omega: self.joints.omega };
        let last_motion = core::mem::replace(&mut self.last_motion, motion);
        if gain == 0.0 {
            self.blend = Blend::DONE;
            if let Some(guard) = &mut self.guard {
                guard.rest();
            }
            // A stream goes on expiring.
            let _ = self.stream.torque(tick, dt);
            return (Vec3::ZERO, 1.0);
        }
        let limits = self.rig.limits;
        let before = changed.then(|| self.renderer.clone().torque(scene, &last_motion, tick, 0.0, 0.0));
        let rendered = self.renderer.torque(scene, &motion, tick, dt, limits.reference_rate * dt);
        let wanted = (self.blend.apply(rendered, before, dt) + self.stream.torque(tick, dt)) * gain;
        let (mut wanted, share) = shortened(wanted, limits.torque);
        if self.guard.is_some() {
            // Limited before: what is not going to be sent gives out nothing.
            wanted = limited(self.guarded(tick, wanted), limits.torque);
        }
        (slewed(self.torque, wanted, limits.torque_rate * dt), share)
    }

    /// The torque `wanted` with what the passivity controller adds. Apart, so that it costs nothing where there is none.
    #[inline(never)]
    fn guarded(&mut self, tick: u64, wanted: Vec3) -> Vec3 {
        let (Some(guard), Some(answered)) = (&mut self.guard, self.joints.answered()) else { return wanted };
        let (period, gain) = (self.rig.timing.period_s(), self.machine.gain);
        let now = Moment { tick: tick as u32, answered, period, gain };
        guard.damped(&self.observer, now, wanted, self.joints.omega)
    }

    /// Allocates the torque, a `share` of what was wanted, to the joints and makes the tick's outputs; a number that is not
    /// finite ends in a fault.
    #[inline]
    fn send(
        &mut self,
        scene: &CompiledScene,
        tick: u64,
        wanted: Vec3,
        share: Real,
        replies: [Option<Reply>; crate::inputs::MAX_COMMANDS],
        fresh: bool,
    ) -> Outputs {
        let n = self.rig.device.joints();
        let mut joint_torque = [0.0; MAX_JOINTS];
        let (mut scale, mut deficient, mut traction, mut torque) = (1.0, false, 0.0, Vec3::ZERO);
        if !wanted.is_finite() {
            self.machine.observe(Some(Cause::NonFinite));
        } else if wanted != Vec3::ZERO {
            let rows = self.joints.posture.rows();
            let mut allocation = match self.rig.methods.allocation {
                AllocationMethod::Exact => allocation::allocate(rows, &self.limits, wanted),
                AllocationMethod::Clipped => allocation::allocate_clipped(rows, &self.limits, wanted),
            };
            if let Some(grip) = self.rig.limits.traction {
                // What is sent loads no contact beyond its grip.
                traction =
                    allocation.limit_traction(&self.arms[..n / 2], grip.mu * grip.normal_force).min(1.0);
            }
            torque = self.joints.posture.torque_on_sphere(&allocation.torque[..n]);
            scale = allocation.scale * share;
            deficient = allocation.deficient;
            joint_torque = allocation.torque;
            if !(torque.is_finite() && joint_torque.iter().all(|t| t.is_finite())) {
                self.machine.observe(Some(Cause::NonFinite));
                joint_torque = [0.0; MAX_JOINTS];
                torque = Vec3::ZERO;
            }
        }
        self.torque = torque;
        self.observer.sent(tick as u32, torque);
        if let Some(heat) = &mut self.heat {
            heat.hold(&joint_torque);
        }
        let mut drive = Drive { enable: self.machine.powered(), torque: [0.0; MAX_JOINTS] };
        for i in 0..n {
            drive.torque[i] = self.joints.command(i, joint_torque[i]);
        }
        let client = self.client.map(|(stamp, taken)| Client {
            seq: stamp.seq,
            age_ticks: tick.saturating_sub(stamp.tick.unwrap_or(taken)),
        });
        let state = State {
            tick,
            mode: self.machine.mode,
            cause: self.machine.cause,
            q: self.orientation.q,
            omega: self.joints.omega,
            reference: self.renderer.reference(scene),
            torque,
            joints: n,
            angle: self.joints.angle,
            rate: self.joints.rate,
            joint_torque,
            slip: self.joints.slip,
            scale,
            deficient,
            traction,
            energy: self.observer.energy(),
            damping: self.guard.as_ref().map_or(0.0, Guard::damping),
            client,
            fresh,
        };
        Outputs { drive, replies, state }
    }
}
