//! A rig on a test bench: a sphere that turns as commanded, encoders that read it, and a
//! controller.

use hbot_core::design::device::{MAX_JOINTS, MAX_WHEELS};
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::{Joint, Limits, Methods, OdometryMethod, Rig, RigParts, Traction, Zero};
use hbot_core::inputs::{Command, Inputs, JointReadings, Stamp};
use hbot_core::outputs::{Outputs, Reply};
use hbot_core::render::effects::{Anchor, Effect, Kind, Spring, SpringLaw};
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Controller, Device, Mat3, Quat, Vec3, rotation};
use hbot_testing::prototype::device;

/// Period of the loop, s.
pub const DT: f64 = 1e-3;
/// Slew limit of the torque in [`rig`], N m/s.
pub const TORQUE_RATE: f64 = 200.0;

/// Returns the prototype's rig with motors strong enough for 1 N m about any axis.
pub fn rig() -> Rig {
    let joint = |peak| Joint { zero: Zero::Assume, ..Joint::new(16384, peak) };
    let parts = RigParts::new(device()).with_joints(joint(2.0), Joint { gear: 17.0, ..joint(0.5) });
    let limits = Limits {
        torque: 2.0,
        torque_rate: TORQUE_RATE,
        align_rate: 0.5,
        reference_rate: 5.0,
        max_age_ticks: 50,
        ..Limits::default()
    };
    let methods = Methods { odometry: OdometryMethod::Magnus4, ..Methods::BALANCED };
    Rig::new(RigParts { limits, methods, ..parts }).expect("a legal rig")
}

/// Returns `rig` as changed by `alter`.
pub fn altered(rig: &Rig, alter: impl FnOnce(&mut RigParts)) -> Rig {
    rig.with(alter).expect("still a legal rig")
}

/// Returns [`rig`] with contacts that hold the force `grip`, N.
pub fn rig_with_grip(grip: f64) -> Rig {
    altered(&rig(), |rig| rig.limits.traction = Some(Traction { mu: 1.0, normal_force: grip }))
}

/// Returns an effect in `slot` that begins with its full torque.
pub fn effect(slot: u8, epoch: u32, kind: Kind) -> Effect {
    Effect::new(slot, epoch, kind)
}

/// Returns a geodesic spring towards `reference`, with `stiffness` (N m/rad) and `damping` (N m
/// s/rad).
pub fn spring(stiffness: f64, damping: f64, reference: Quat, anchor: Anchor) -> Kind {
    let [k, d] = [stiffness, damping].map(|x| Mat3::from_diagonal(Vec3::splat(x)));
    Kind::Spring(Spring::new(SpringLaw::Geodesic, k, d, reference, anchor).unwrap())
}

/// Returns a scene with a geodesic spring in slot 0. Its reference is `turn` (rotation vector,
/// rad), so a sphere at the identity is that far from it.
pub fn spring_scene(revision: u64, stiffness: f64, turn: Vec3) -> CompiledScene {
    let kind = spring(stiffness, 0.0, rotation::exp(turn), Anchor::Absolute);
    CompiledScene::new(revision, &[effect(0, revision as u32, kind)]).unwrap()
}

/// A sphere with its wheels, which turns without slip.
#[derive(Clone)]
pub struct Sphere {
    device: Device,
    pub q: Quat,
    pub omega: Vec3,
    angle: [f64; MAX_JOINTS],
}

impl Sphere {
    pub fn new(device: Device) -> Self {
        Self { device, q: Quat::IDENTITY, omega: Vec3::ZERO, angle: [0.0; MAX_JOINTS] }
    }

    /// Turns the sphere with the angular velocity `omega` (rad/s in N) for `time` seconds.
    pub fn turn(&mut self, omega: Vec3, time: f64) {
        // The midpoint method in sixteen steps follows steering at 100 rad/s to 1e-6 rad over a
        // tick of 1 ms.
        let h = time / 16.0;
        for _ in 0..16 {
            let half = self.moved(&self.rates(omega), 0.5 * h);
            let rates = Posture::new(&self.device, &half.steering()).inverse(omega);
            let q = rotation::renormalized(rotation::exp(omega * h) * self.q);
            *self = Self { q, ..self.moved(&rates, h) };
        }
        self.omega = omega;
    }

    pub fn rates(&self, omega: Vec3) -> [f64; MAX_JOINTS] {
        Posture::new(&self.device, &self.steering()).inverse(omega)
    }

    pub fn angles(&self) -> [f64; MAX_JOINTS] {
        self.angle
    }

    pub fn steering(&self) -> [f64; MAX_WHEELS] {
        core::array::from_fn(|i| self.angle[2 * i])
    }

    fn moved(&self, rates: &[f64; MAX_JOINTS], time: f64) -> Self {
        Self { angle: core::array::from_fn(|j| self.angle[j] + rates[j] * time), ..self.clone() }
    }
}

/// Returns what the encoders of `rig` read of `sphere`, as the answer to the command `sequence`.
pub fn reading(rig: &Rig, sphere: &Sphere, sequence: u32) -> JointReadings {
    let mut counts = [0; MAX_JOINTS];
    for j in 0..rig.device.joints() {
        // Counts wrap as in the encoder. Counts and rates have the joint's sign, regardless of
        // `reversed`.
        counts[j] = (sphere.angle[j] / rig.joints[j].radians_per_count().abs()).round() as i64 as i32;
    }
    JointReadings::new(sequence, counts, sphere.rates(sphere.omega))
}

/// Returns what the encoders of `rig` read at these joint angles (rad) and rates (rad/s) of a
/// plant, as the answer to the command `sequence`.
pub fn encoders(
    rig: &Rig,
    angles: &[f64; MAX_JOINTS],
    rates: &[f64; MAX_JOINTS],
    sequence: u64,
) -> JointReadings {
    let (mut counts, mut read) = ([0; MAX_JOINTS], [0.0; MAX_JOINTS]);
    for (j, joint) in rig.joints[..rig.device.joints()].iter().enumerate() {
        counts[j] = (angles[j] / joint.radians_per_count()).round() as i64 as i32;
        read[j] = if joint.reversed { -rates[j] } else { rates[j] };
    }
    JointReadings::new(sequence as u32, counts, read)
}

/// The control law alone, with a sphere whose motion the test sets. It has no line, motors or
/// simulated plant, so that a test can give a tick any inputs. `TickBench` of hbot-host adds a
/// line, and `Loop` of `passivity.rs` adds a plant.
pub struct Bench {
    pub controller: Controller,
    pub scene: CompiledScene,
    pub sphere: Sphere,
    pub tick: u64,
    /// Encoder counts at the start of the bench.
    pub offset: [i32; MAX_JOINTS],
    /// Last tick whose command has arrived at the motor controllers.
    sent: u64,
    rig: Rig,
}

impl Bench {
    pub fn new(rig: Rig) -> Self {
        Self {
            controller: Controller::new(rig),
            scene: CompiledScene::empty(),
            sphere: Sphere::new(rig.device),
            tick: 1,
            offset: [0; MAX_JOINTS],
            sent: 0,
            rig,
        }
    }

    /// Creates a bench whose first tick is `tick`.
    pub fn from_tick(rig: Rig, tick: u64) -> Self {
        Self { tick, sent: tick - 1, ..Self::new(rig) }
    }

    /// Creates a bench that renders `scene` at full torque.
    pub fn active(rig: Rig, scene: CompiledScene) -> Self {
        let mut bench = Self::new(rig);
        bench.scene = scene;
        bench.step();
        assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
        // Half a second for the soft start, and one tick more for the rounding of five hundred
        // sums.
        for _ in 0..501 {
            bench.step();
        }
        assert_eq!(bench.step().state.mode, Mode::Active);
        bench
    }

    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Returns the sequence number of the last command, which feedback repeats.
    pub fn sent(&self) -> u32 {
        self.sent as u32
    }

    /// Returns what the encoders read now, as the answer to the last command.
    pub fn feedback(&self) -> JointReadings {
        let mut feedback = reading(&self.rig, &self.sphere, self.sent as u32);
        for (count, offset) in feedback.counts.iter_mut().zip(self.offset) {
            *count = offset.wrapping_add(*count);
        }
        feedback
    }

    pub fn inputs(&self) -> Inputs {
        Inputs { feedback: Some(self.feedback()), ..Inputs::quiet(self.tick) }
    }

    pub fn step(&mut self) -> Outputs {
        self.step_with(|_| {})
    }

    pub fn step_with(&mut self, alter: impl FnOnce(&mut Inputs)) -> Outputs {
        let mut inputs = self.inputs();
        alter(&mut inputs);
        let outputs = self.controller.tick(&self.scene, &inputs);
        self.sent = inputs.tick;
        self.tick = inputs.tick.saturating_add(1);
        assert_finite(&outputs);
        outputs
    }

    pub fn command(&mut self, command: Command) -> Outputs {
        self.step_with(|inputs| inputs.commands.push(command).unwrap())
    }

    pub fn deaf(&mut self) -> Outputs {
        self.step_with(|inputs| inputs.feedback = None)
    }

    /// Turns the sphere for a tick, and runs the tick. As on a real line, the reading was measured
    /// when the last command arrived, before the turn made under its torque.
    pub fn turn(&mut self, omega: Vec3) -> Outputs {
        let reading = self.feedback();
        self.sphere.turn(omega, DT);
        self.step_with(|inputs| inputs.feedback = Some(reading))
    }

    pub fn run(&mut self, ticks: u32) -> Outputs {
        for _ in 1..ticks {
            self.step();
        }
        self.step()
    }
}

/// Access to the reply to the first command of a tick.
pub trait FirstReply {
    fn reply(&self) -> Reply;
}

impl FirstReply for Outputs {
    fn reply(&self) -> Reply {
        self.replies[0].expect("a tick with a command has a reply")
    }
}

/// Returns a command that streams `torque` (N m in N) for `valid_ticks` ticks.
pub fn stream(torque: Vec3, valid_ticks: u32) -> Command {
    Command::Stream { torque, valid_ticks, stamp: Stamp::default() }
}

/// Returns a command that moves the reference of an effect to `q`. It turns on at `omega` (rad/s in
/// N) for `valid_ticks` ticks.
pub fn reference(slot: u8, epoch: u32, q: Quat, omega: Vec3, valid_ticks: u32) -> Command {
    Command::Reference { slot, epoch, q, omega, valid_ticks, stamp: Stamp::default() }
}

/// Asserts that every number in the outputs is finite, and that there is no torque while the motors
/// are not enabled.
pub fn assert_finite(outputs: &Outputs) {
    let s = &outputs.state;
    let all = s.q.is_finite()
        && s.omega.is_finite()
        && s.torque.is_finite()
        && s.angle.iter().chain(&s.rate).chain(&s.joint_torque).all(|x| x.is_finite())
        && outputs.drive.torque.iter().all(|x| x.is_finite())
        && [s.slip, s.scale, s.traction, s.energy].iter().all(|x| x.is_finite());
    assert!(all, "a number is not finite: {outputs:?}");
    assert!((s.q.length_squared() - 1.0).abs() < 1e-12, "the orientation is unit to rounding");
    assert!((0.0..=1.0).contains(&s.scale), "scale {}", s.scale);
    if !outputs.drive.enable {
        assert!(
            s.torque == Vec3::ZERO && outputs.drive.torque == [0.0; MAX_JOINTS],
            "torque without enable: {outputs:?}"
        );
    }
}

/// Creates an active bench with a soft spring whose reference is 0.1 rad away.
pub fn active() -> Bench {
    Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1))
}
