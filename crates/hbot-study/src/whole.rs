//! The whole loop in virtual time: a controller, its line and its simulated rig in lock-step.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Commands, Inputs, JointReadings};
use hbot_core::outputs::{Drive, Outputs};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS};
use hbot_sim::exchange::Exchange;
use hbot_sim::phenomena::Phenomena;
use hbot_sim::plant::PlantState;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::Value;

/// Number of the tick in which the controller is told to enable torque. The controller refuses to
/// enable before it has readings, and the ticks before this one bring them.
const ENABLE: u32 = 6;

/// Returns the configuration of the prototype's rig, with the values in `with` for some of its
/// keys.
pub(crate) fn prototype(with: &[(&'static str, Value)]) -> RigConfig {
    let each =
        |(path, value): &(&'static str, Value)| Override { path, value: value.clone(), from: "the study" };
    let with: Vec<Override> = with.iter().map(each).collect();
    RigConfig::load(None, &with).unwrap_or_else(|error| unreachable!("a legal rig: {error}"))
}

/// The whole control loop in virtual time: controller, line and simulated rig. The delay from a
/// reading to the torque computed from it is one period.
pub(crate) struct Whole {
    controller: Controller,
    scene: CompiledScene,
    exchange: Exchange,
    drive: Drive,
    feedback: Option<JointReadings>,
    tick: u32,
    period_ns: u64,
}

impl Whole {
    /// Creates the loop at time 0. The simulated rig has the configuration `config` and the
    /// phenomena `phenomena`, and starts in the state `start`. `scene` is a scene file as JSON.
    pub(crate) fn new(config: &RigConfig, scene: Value, phenomena: Phenomena, start: PlantState) -> Self {
        let scene =
            SceneFile::from_json(scene).unwrap_or_else(|error| unreachable!("a legal scene: {error}"));
        Self::with(config, scene, phenomena, start)
    }

    /// Creates the loop as [`new`](Self::new) does, with a scene file that has been read.
    pub(crate) fn with(
        config: &RigConfig,
        scene: SceneFile,
        phenomena: Phenomena,
        start: PlantState,
    ) -> Self {
        let rig =
            SimulatedRig::new(&SimulatedConfig { start, phenomena, ..SimulatedConfig::new(&config.rig) });
        let rig = rig.unwrap_or_else(|error| unreachable!("the prototype can be simulated: {error}"));
        Self {
            controller: Controller::new(config.rig),
            scene: RunningScene::new().load(scene),
            exchange: Exchange::new(rig, config.rig.device.joints()),
            drive: Drive { enable: false, torque: [0.0; MAX_JOINTS] },
            feedback: None,
            tick: 0,
            period_ns: config.rig.timing.period_ns,
        }
    }

    /// Replaces the scene from the next tick on.
    pub(crate) fn load(&mut self, scene: CompiledScene) {
        self.scene = scene;
    }

    /// Returns the number of ticks that the loop makes in `seconds`.
    pub(crate) fn ticks(&self, seconds: f64) -> u32 {
        (seconds * 1.0e9 / self.period_ns as f64) as u32
    }

    /// Returns the period of the loop, s.
    pub(crate) fn period(&self) -> f64 {
        self.period_ns as f64 / 1.0e9
    }

    /// Returns whether the motors can make torque: the last command asked for it.
    pub(crate) fn is_active(&self) -> bool {
        self.drive.enable
    }

    pub(crate) fn controller(&self) -> &Controller {
        &self.controller
    }

    pub(crate) fn scene(&self) -> &CompiledScene {
        &self.scene
    }

    pub(crate) fn rig(&self) -> &SimulatedRig {
        self.exchange.rig()
    }

    pub(crate) fn rig_mut(&mut self) -> &mut SimulatedRig {
        self.exchange.rig_mut()
    }

    /// Runs one tick: the controller reads the answers to the last tick, and its joint torques act
    /// from this tick on. In tick 6, counted from 0, torque is also enabled.
    pub(crate) fn step(&mut self, command: Option<Command>) -> Outputs {
        let outputs =
            self.listen(command.into_iter().chain((self.tick == ENABLE).then_some(Command::Enable)));
        self.drive = outputs.drive;
        self.exchange();
        outputs
    }

    /// Runs one tick with joint torques (N m) that `torque` computes from the controller's outputs.
    /// They act from this tick on. The controller only reads the joints and is never enabled.
    pub(crate) fn step_driven(&mut self, torque: impl FnOnce(&Outputs) -> [f64; MAX_JOINTS]) -> Outputs {
        let outputs = self.listen(None);
        self.drive = Drive { enable: true, torque: torque(&outputs) };
        self.exchange();
        outputs
    }

    fn listen(&mut self, commands: impl IntoIterator<Item = Command>) -> Outputs {
        let mut inputs = Inputs { feedback: self.feedback.take(), ..Inputs::quiet(u64::from(self.tick)) };
        inputs.commands = Commands::default();
        for command in commands {
            // There are at most two commands, which fit.
            let _ = inputs.commands.push(command);
        }
        self.controller.tick(&self.scene, &inputs)
    }

    fn exchange(&mut self) {
        self.feedback = self.exchange.tick(u64::from(self.tick) * self.period_ns, self.tick, &self.drive);
        self.tick += 1;
    }
}
