//! The whole loop: a controller, its line and its simulated rig in lock-step.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Commands, Inputs, JointFeedback};
use hbot_core::outputs::{Drive, Outputs};
use hbot_core::{CompiledScene, Controller, MAX_JOINTS};
use hbot_sim::exchange::Exchange;
use hbot_sim::phenomena::Phenomena;
use hbot_sim::plant::PlantState;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::Value;

/// The tick that enables: the first ones bring the readings without which there is nothing to enable.
const ENABLE: u32 = 6;

/// The prototype with other values of some keys of its rig file.
pub(crate) fn prototype(with: &[(&'static str, Value)]) -> RigConfig {
    let each =
        |(path, value): &(&'static str, Value)| Override { path, value: value.clone(), from: "the study" };
    let with: Vec<Override> = with.iter().map(each).collect();
    RigConfig::load(None, &with).unwrap_or_else(|error| unreachable!("a legal rig: {error}"))
}

/// A loop in virtual time. From a reading to its torque is one period.
pub(crate) struct Whole {
    controller: Controller,
    scene: CompiledScene,
    exchange: Exchange,
    drive: Drive,
    feedback: Option<JointFeedback>,
    tick: u32,
    period_ns: u64,
}

impl Whole {
    /// The rig of `config` at `start`, at the time 0, to render `scene` (a scene file as JSON), showing `phenomena`.
    pub(crate) fn new(config: &RigConfig, scene: Value, phenomena: Phenomena, start: PlantState) -> Self {
        let scene =
            SceneFile::from_json(scene).unwrap_or_else(|error| unreachable!("a legal scene: {error}"));
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

    /// Ticks of so many seconds.
    pub(crate) fn ticks(&self, seconds: f64) -> u32 {
        (seconds * 1.0e9 / self.period_ns as f64) as u32
    }

    /// The period, s.
    pub(crate) fn period(&self) -> f64 {
        self.period_ns as f64 / 1.0e9
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

    /// One tick: the reading that came back in the last one, and a command that acts from this one on. It is enabled in the
    /// sixth.
    pub(crate) fn step(&mut self, command: Option<Command>) -> Outputs {
        let outputs =
            self.listen(command.into_iter().chain((self.tick == ENABLE).then_some(Command::Enable)));
        self.drive = outputs.drive;
        self.exchange();
        outputs
    }

    /// One tick whose torques are not the controller's: it is never enabled and reads the joints, `torque` makes joint torques
    /// (N m) of what it knows, and those act from this tick on.
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
            // Two at most.
            let _ = inputs.commands.push(command);
        }
        self.controller.tick(&self.scene, &inputs)
    }

    fn exchange(&mut self) {
        self.feedback = self.exchange.tick(u64::from(self.tick) * self.period_ns, self.tick, &self.drive);
        self.tick += 1;
    }
}
