//! The whole loop: the prototype's controller, its line and its simulated rig in lock-step.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Inputs, JointFeedback};
use hbot_core::mode::Mode;
use hbot_core::outputs::{Drive, State as Told};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, Vec3, rotation};
use hbot_sim::exchange::Exchange;
use hbot_sim::phenomena::Phenomena;
use hbot_sim::plant::{Plant, State};
use hbot_sim::rig::{RigConfig as SimulatedConfig, SimulatedRig};
use serde_json::json;

/// Soft start, s.
const START_S: f64 = 0.6;

/// What is rendered, how, and on what.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// Loop rate, Hz.
    pub(super) rate: u32,
    /// Of the spring, N m/rad.
    pub(super) stiffness: f64,
    /// Of the spring, N m s/rad.
    pub(super) damping: f64,
    /// What the rig shows.
    pub(super) phenomena: Phenomena,
    /// Whether the passivity stage is on.
    pub(super) guard: bool,
}

/// A loop that is active, with a sphere at rest in the middle of a spring.
pub(super) struct Loop {
    controller: Controller,
    scene: CompiledScene,
    exchange: Exchange,
    drive: Drive,
    feedback: Option<JointFeedback>,
    tick: u32,
    period_ns: u64,
    /// Energy that the motors have given out, J: torque held times turn made, joint by joint.
    given: f64,
}

impl Loop {
    pub(super) fn new(wanted: &Wanted) -> Self {
        let with = |path, value| Override { path, value, from: "the study" };
        let with = [with("loop.rate_hz", json!(wanted.rate)), with("loop.passivity", json!(wanted.guard))];
        let config = RigConfig::load(None, &with);
        let config = config.unwrap_or_else(|error| unreachable!("a legal rig: {error}"));
        let scene = json!({"name": "study", "effect": [
            {"id": "spring", "kind": "spring", "stiffness": wanted.stiffness, "damping": wanted.damping, "fade_s": 0}
        ]});
        let scene =
            SceneFile::from_json(scene).unwrap_or_else(|error| unreachable!("a legal scene: {error}"));
        let rig = SimulatedRig::new(&SimulatedConfig::new(&config.rig));
        let mut rig = rig.unwrap_or_else(|error| unreachable!("the prototype can be simulated: {error}"));
        rig.set_phenomena(wanted.phenomena);
        let mut new = Self {
            controller: Controller::new(config.rig),
            scene: RunningScene::new().load(scene),
            exchange: Exchange::new(rig, config.rig.device.joints()),
            drive: Drive { enable: false, torque: [0.0; MAX_JOINTS] },
            feedback: None,
            tick: 0,
            period_ns: config.rig.timing.period_ns,
            given: 0.0,
        };
        for _ in 0..new.ticks(START_S) {
            new.step();
        }
        new
    }

    /// Ticks of so many seconds.
    pub(super) fn ticks(&self, seconds: f64) -> u32 {
        (seconds * 1.0e9 / self.period_ns as f64) as u32
    }

    /// The apparent inertia about n1, kg m².
    pub(super) fn inertia(&self) -> f64 {
        let Ok(mut plant) = Plant::new(&self.controller.rig().device) else {
            unreachable!("the prototype is a plant")
        };
        plant.set_sphere_inertia(self.exchange.rig().dynamics().sphere_inertia());
        plant.apparent_inertia(self.state()).x_axis.x
    }

    /// The rig's.
    pub(super) fn state(&self) -> &State {
        self.exchange.rig().state()
    }

    /// Has the sphere turn at `omega`, rad/s in N; what was given out before does not count.
    pub(super) fn tap(&mut self, omega: Vec3) {
        let state = State { omega, ..*self.state() };
        self.exchange.rig_mut().set_state(state);
        self.given = 0.0;
    }

    /// Energy of the motion and of a spring of so many N m/rad, J.
    pub(super) fn energy(&self, stiffness: f64) -> f64 {
        let turned = rotation::log(self.state().q);
        self.exchange.rig().dynamics().energy(self.state()) + 0.5 * stiffness * turned.length_squared()
    }

    /// Energy that the motors have given out since the tap, J.
    pub(super) fn given(&self) -> f64 {
        self.given
    }

    /// One tick: the reading that came back in the last one, and a command that acts from this one on. From a reading to its torque
    /// is one period.
    pub(super) fn step(&mut self) -> Told {
        let mut inputs = Inputs::quiet(u64::from(self.tick));
        inputs.feedback = self.feedback.take();
        if self.tick == 2 + START_LATEST {
            // A tick without any other command has room.
            let _ = inputs.commands.push(Command::Enable);
        }
        let outputs = self.controller.tick(&self.scene, &inputs);
        self.drive = outputs.drive;
        let rig = self.exchange.rig();
        let (held, before) = (*rig.joint_torque(), rig.state().joints());
        self.feedback = self.exchange.tick(u64::from(self.tick) * self.period_ns, self.tick, &self.drive);
        let after = self.state().joints();
        self.given += (0..MAX_JOINTS).map(|j| held[j] * (after[j] - before[j])).sum::<f64>();
        self.tick += 1;
        outputs.state
    }

    /// Whether motors may push.
    pub(super) fn is_active(told: &Told) -> bool {
        told.mode == Mode::Active
    }
}

/// The most ticks that a reading is late in, before the motors are enabled: without one there is nothing to enable.
const START_LATEST: u32 = 4;
