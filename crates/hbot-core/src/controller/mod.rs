//! The control law: one tick leads from a reading to joint torques.
//!
//! ```text
//! reading -> Joints (angles, rates, posture, slip) -> Orientation -> faults and commands
//!         -> Renderer (the scene) -> stream, gain, blend, passivity, limits
//!         -> allocation -> Outputs
//! ```

mod commands;
mod faults;
mod torque;

use crate::allocation::{ContactArms, JointLimits};
use crate::burst::Burst;
use crate::device::{MAX_JOINTS, MAX_WHEELS};
use crate::effects::Motion;
use crate::heat::Heat;
use crate::inputs::{Command, Inputs, Stamp};
use crate::joints::Joints;
use crate::mode::{Cause, ModeMachine};
use crate::orientation::Orientation;
use crate::outputs::{Drive, Outputs, State, TakenStream};
use crate::passivity::{Guard, Observer};
use crate::real::{Quat, Real, Vec3};
use crate::render::Renderer;
use crate::rig::Rig;
use crate::scene::CompiledScene;
use crate::shaping::{Blend, Stream};

use self::faults::Silence;
pub use crate::orientation::ALIGN_HISTORY;

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
    arms: [ContactArms; MAX_WHEELS],
    joints: Joints,
    orientation: Orientation,
    machine: ModeMachine,
    renderer: Renderer,
    blend: Blend,
    /// Motion of the sphere for which the effects were rendered in the last tick.
    last_motion: Motion,
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
    last_stream: Stream,
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
        Self {
            limits: JointLimits::of(&rig),
            arms,
            joints: Joints::new(&rig),
            guard: rig.methods.passivity.map(Guard::new),
            burst: rig.limits.energy.map(Burst::new),
            heat: rig.limits.thermal_time.map(|time_s| Heat::new(&rig, time_s)),
            rig,
            orientation: Orientation::new(),
            machine: ModeMachine::START,
            renderer: Renderer::new(&rig),
            blend: Blend::DONE,
            last_motion: Motion { q: Quat::IDENTITY, omega: Vec3::ZERO },
            stream: Stream::NONE,
            observer: Observer::START,
            made: Made::NOTHING,
            last_asked: Vec3::ZERO,
            last_stream: Stream::NONE,
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
        }
    }

    /// Returns the rig that this control law is for.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Runs one tick: takes the reading, executes the commands, renders `scene`, and returns joint
    /// torques and the state.
    pub fn tick(&mut self, scene: &CompiledScene, inputs: &Inputs) -> Outputs {
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

        let measured = self.measure(inputs, elapsed);
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
        let mut replies = [None; crate::inputs::MAX_COMMANDS];
        for (reply, command) in replies.iter_mut().zip(inputs.commands.iter()) {
            *reply = Some(self.obey(scene, inputs.tick, command));
        }
        // A stop overrides all other commands of its tick, also later ones.
        if inputs.commands.iter().any(|command| matches!(command, Command::Estop)) {
            self.machine.estop();
        }
        self.machine.ramp(dt);

        let wanted = self.render(scene, inputs.tick, dt, changed);
        self.hold(inputs.tick, &wanted);
        let state = self.state(scene, inputs.tick, matches!(measured, Ok(true)));
        Outputs { drive: self.drive(), replies, state }
    }

    /// Takes the motors' reading if it is new. Returns true if it was taken, false if there was no
    /// new reading, and the cause of a fault if the reading is invalid.
    #[inline]
    fn measure(&mut self, inputs: &Inputs, elapsed: u64) -> Result<bool, Cause> {
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
        let step = self.joints.advance(&self.rig, feedback, late, judged)?;
        self.orientation.advance(step.turn);
        let given = self.observer.advance(step.answered[0], step.answered[1], step.turn);
        if let Some(guard) = &mut self.guard {
            guard.add(given);
        }
        if let Some(burst) = &mut self.burst {
            burst.add(given);
        }
        Ok(true)
    }

    /// Sets the torque that the motors make from this tick on: as much of `wanted` as motors and
    /// contacts can make.
    #[inline]
    fn hold(&mut self, tick: u64, wanted: &Wanted) {
        let made = if wanted.torque == Vec3::ZERO {
            Made { scale: wanted.share, ..Made::NOTHING }
        } else if wanted.torque.is_finite() {
            self.feasible(wanted)
        } else {
            Made { torque: wanted.torque, ..Made::NOTHING }
        };
        self.send(tick, made);
    }

    /// Sends `made` to the motors in this tick. If one of its numbers is not finite, the rig goes
    /// to fault and the motors make no torque.
    #[inline]
    fn send(&mut self, tick: u64, made: Made) {
        self.made = if made.is_finite() {
            made
        } else {
            self.machine.take_condition(Some(Cause::NonFinite));
            Made::NOTHING
        };
        self.observer.record(tick as u32, self.made.torque);
        if let Some(heat) = &mut self.heat {
            heat.hold(&self.made.joints);
        }
    }

    /// Returns the command to the motors. Each torque has the sign convention of the joint's motor
    /// controller.
    #[inline]
    fn drive(&self) -> Drive {
        let mut drive = Drive { enable: self.powered(), torque: [0.0; MAX_JOINTS] };
        for i in 0..self.rig.device.joints() {
            drive.torque[i] = self.joints.in_controller_sense(i, self.made.joints[i]);
        }
        drive
    }

    /// Returns the state of this tick, which is published to clients. `fresh` is true if the tick
    /// took a new reading.
    #[inline]
    fn state(&self, scene: &CompiledScene, tick: u64, fresh: bool) -> State {
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
            reference: self.renderer.reference(scene),
            torque: made.torque,
            joints: self.rig.device.joints(),
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
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::device::{Device, WheelSpec};
    use crate::rig::{Joint, RigParts};

    /// A torque that is not finite, in any one of its numbers, is not sent. The allocation makes no
    /// such torque, so it is given here.
    #[test]
    fn a_torque_that_is_not_finite_is_a_fault_and_no_torque() {
        let wheel = |side: Real| WheelSpec {
            axis: Vec3::new(side, 0.0, -1.0),
            cone: 0.1745,
            radius: 0.0155,
            ..WheelSpec::default()
        };
        let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)]).unwrap();
        let joint = Joint::new(16384, 2.0);
        let rig = Rig::new(RigParts::new(device).with_joints(joint, joint)).unwrap();
        let sent = |alter: &dyn Fn(&mut Made)| {
            let mut controller = Controller::new(rig);
            let mut made = Made { torque: Vec3::X, joints: [0.1; MAX_JOINTS], ..Made::NOTHING };
            alter(&mut made);
            controller.send(1, made);
            (controller.machine.cause, controller.made.torque, controller.drive().torque)
        };
        let whole = sent(&|_| ());
        assert_eq!((whole.0, whole.1, whole.2[3]), (None, Vec3::X, 0.1));
        let stopped = (Some(Cause::NonFinite), Vec3::ZERO, [0.0; MAX_JOINTS]);
        for bad in [Real::NAN, Real::INFINITY, Real::NEG_INFINITY] {
            for j in 0..4 {
                assert_eq!(sent(&|made| made.joints[j] = bad), stopped, "{bad} at joint {j}");
            }
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                assert_eq!(sent(&|made| made.torque += axis * bad), stopped, "{bad} about {axis}");
            }
            let both = |made: &mut Made| (made.torque.x, made.joints[0]) = (bad, bad);
            assert_eq!(sent(&both), stopped, "{bad}");
        }
    }

    /// Checks that the table of memory sizes in the documentation of the crate is correct. It lists
    /// the sizes for a 64-bit machine.
    #[test]
    #[cfg(target_pointer_width = "64")]
    fn a_controller_takes_as_much_memory_as_the_docs_say() {
        let width = if size_of::<Real>() == 8 { "f64" } else { "f32" };
        let row = std::format!(
            "//! | {width} | {} | {} | {} |",
            size_of::<Controller>(),
            size_of::<Orientation>(),
            size_of::<CompiledScene>()
        );
        assert!(include_str!("../lib.rs").contains(&row), "{row}");
    }
}
