//! A prototype with its controller. The sphere rests, and the encoders read what a check sets.

use super::super::core::allocation::JointLimits;
use super::super::core::design::device::MAX_JOINTS;
use super::super::core::design::rig::{Joint, Limits, Methods, OdometryMethod, Rig, RigParts, Zero};
use super::super::core::inputs::{Command, Inputs, JointReadings};
use super::super::core::outputs::{Outputs, Reply};
use super::super::core::render::effects::{Anchor, Effect, Kind, Spring, SpringLaw};
use super::super::core::safety::mode::Mode;
use super::super::core::{CompiledScene, Controller, Device, Mat3, Quat, Real, Vec3, WheelSpec, rotation};

/// Peak torques of steer and drive in [`rig`], N m.
pub const PEAK: [Real; 2] = [0.93, 0.14];

pub fn wheels() -> [WheelSpec; 2] {
    [1.0, -1.0].map(|side| WheelSpec {
        axis: Vec3::new(side, 0.0, -1.0),
        cone: 0.1745,
        toe: 0.0,
        radius: 0.0155,
        steer_inertia: 2.7e-5,
        drive_inertia: 3.5e-6,
        axial_inertia: 0.0,
    })
}

pub fn device(wheels: &[WheelSpec]) -> Device {
    Device::new(0.102, 0.467, wheels).unwrap()
}

pub fn rig() -> Rig {
    let [steer, drive] = PEAK.map(|peak| Joint { zero: Zero::Assume, ..Joint::new(16384, peak) });
    let parts = RigParts::new(device(&wheels())).with_joints(steer, Joint { gear: 17.0, ..drive });
    let limits =
        Limits { torque: 0.5, align_rate: 0.5, reference_rate: 5.0, max_age_ticks: 50, ..Limits::default() };
    let methods = Methods { odometry: OdometryMethod::Magnus4, ..Methods::BALANCED };
    Rig::new(RigParts { limits, methods, ..parts }).expect("a legal rig")
}

pub fn limits(device: &Device) -> JointLimits {
    JointLimits::of_device(device, |joint| PEAK[joint % 2])
}

/// Returns a scene with a geodesic spring of 2 N m/rad, whose reference is `turn` (rotation vector,
/// rad).
pub fn spring_scene(revision: u64, turn: Vec3) -> CompiledScene {
    let stiffness = Mat3::from_diagonal(Vec3::splat(2.0));
    let reference = rotation::exp(turn);
    let spring =
        Spring::new(SpringLaw::Geodesic, stiffness, Mat3::ZERO, reference, Anchor::Absolute).unwrap();
    CompiledScene::new(revision, &[Effect::new(0, revision as u32, Kind::Spring(spring))]).unwrap()
}

/// The control law of the prototype, with encoder counts and rates that a check sets. It works with
/// f32 and f64. `Bench` of `tests/core/bench.rs` has a moving sphere, but only in f64.
pub struct ReadRig {
    pub controller: Controller,
    pub scene: CompiledScene,
    pub tick: u64,
    pub counts: [i32; MAX_JOINTS],
    pub rates: [Real; MAX_JOINTS],
}

impl ReadRig {
    pub fn idle() -> Self {
        Self::idle_with(rig())
    }

    pub fn idle_with(rig: Rig) -> Self {
        let mut machine = Self {
            controller: Controller::new(rig),
            scene: spring_scene(1, Vec3::X * 0.1),
            tick: 1,
            counts: [0; MAX_JOINTS],
            rates: [0.0; MAX_JOINTS],
        };
        machine.step(|_| {});
        machine
    }

    pub fn active() -> Self {
        Self::active_with(rig())
    }

    pub fn active_with(rig: Rig) -> Self {
        let mut machine = Self::idle_with(rig);
        assert_eq!(machine.command(Command::Enable), Reply::Done);
        machine.run(510);
        assert_eq!(machine.step(|_| {}).state.mode, Mode::Active);
        machine
    }

    pub fn step(&mut self, alter: impl FnOnce(&mut Inputs)) -> Outputs {
        let feedback = JointReadings::new((self.tick as u32).wrapping_sub(1), self.counts, self.rates);
        let mut inputs = Inputs { feedback: Some(feedback), ..Inputs::quiet(self.tick) };
        alter(&mut inputs);
        self.tick = inputs.tick.saturating_add(1);
        let outputs = self.controller.tick(&self.scene, &inputs);
        let s = &outputs.state;
        let sent = outputs.drive.torque;
        let all = sent.iter().chain(&s.joint_torque).chain(&s.angle).chain(&s.rate).all(|x| x.is_finite());
        assert!(all && s.q.is_finite() && s.omega.is_finite() && s.torque.is_finite(), "{outputs:?}");
        assert!(s.energy.is_finite() && s.slip.is_finite(), "{outputs:?}");
        assert!((s.q.length_squared() - 1.0).abs() <= 8.0 * Real::EPSILON, "unit to rounding: {}", s.q);
        for (j, torque) in sent.iter().enumerate() {
            assert!(torque.abs() <= PEAK[j % 2], "{outputs:?}");
        }
        if !outputs.drive.enable {
            assert!(
                sent == [0.0; MAX_JOINTS] && s.torque == Vec3::ZERO,
                "torque without enable: {outputs:?}"
            );
        }
        outputs
    }

    pub fn run(&mut self, ticks: u32) -> Outputs {
        for _ in 1..ticks {
            self.step(|_| {});
        }
        self.step(|_| {})
    }

    pub fn command(&mut self, command: Command) -> Reply {
        self.step(|inputs| inputs.commands.push(command).unwrap()).replies[0].unwrap()
    }

    /// Asserts that the machine recovers from a fault to full torque and behaves as before.
    pub fn works_again(mut self, what: &str) {
        let before = Self::active().step(|_| {}).state;
        self.rates = [0.0; MAX_JOINTS];
        self.run(60);
        assert_eq!(self.command(Command::Reset), Reply::Done, "{what}");
        self.run(60);
        assert_eq!(self.command(Command::Enable), Reply::Done, "{what}");
        let state = self.run(520).state;
        assert_eq!((state.mode, state.q), (Mode::Active, Quat::IDENTITY), "{what}: {:?}", state.cause);
        assert!((state.torque - before.torque).length() <= 8.0 * Real::EPSILON, "{what}: {}", state.torque);
    }
}
