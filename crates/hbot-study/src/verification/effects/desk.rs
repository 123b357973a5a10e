//! A test bench with a controller and a simulated rig. Each gets recorded inputs, so that the cost
//! of its tick does not depend on the other and is equal in every run.

use std::rc::Rc;

use hbot_config::scene::{self, kinds};
use hbot_config::{RunningScene, SceneFile};
use hbot_core::inputs::{Command, Inputs, JointReadings};
use hbot_core::outputs::Drive;
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Controller, MAX_JOINTS};
use hbot_sim::exchange::Exchange;
use hbot_sim::motion::MOTIONS;
use hbot_sim::plant::PlantState;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::{Map, Value, json};

use crate::names;
use crate::verification::readings;
use crate::whole::prototype;

/// Number of ticks after which the soft start is over.
const STARTED: usize = 600;
/// Number of ticks after which a change of scene has been blended in.
const BLEND: usize = 60;
/// Number of recorded readings, one per tick. No run has more ticks than this.
const RECORDED: usize = STARTED + 2 * BLEND + 1500;
/// Sequence number of the first command. It is so large that all commands have the same number of
/// bytes on the line.
const FIRST: u32 = 1 << 20;

/// Returns the names of all kinds of effect, followed by the names of all phenomena.
pub(super) fn names() -> Vec<String> {
    let all: Vec<String> =
        kinds().iter().chain(&scene::phenomena()).map(|listed| listed.name.to_owned()).collect();
    debug_assert!(all.iter().all(|name| names::is_id(name)), "{all:?}");
    all
}

/// Returns whether `name` is a kind of effect. Otherwise it is a phenomenon.
pub(super) fn is_kind(name: &str) -> bool {
    kinds().iter().any(|listed| listed.name == name)
}

/// A set of effects and phenomena whose cost is measured.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct SceneSetup {
    /// Names of the kinds of effect and of the phenomena in this setup.
    pub(super) names: Vec<String>,
    /// Whether these effects and phenomena are removed again before the cost is measured, to check
    /// that no cost remains.
    pub(super) gone: bool,
}

impl SceneSetup {
    pub(super) fn of(names: &[&String]) -> Self {
        Self { names: names.iter().map(|name| (*name).clone()).collect(), gone: false }
    }

    /// Returns a copy of this setup whose effects and phenomena are removed again before the cost
    /// is measured.
    pub(super) fn gone(&self) -> Self {
        Self { gone: true, ..self.clone() }
    }

    /// Returns all names joined to one, for use in the id of a figure.
    pub(super) fn name(&self) -> String {
        self.names.join("_with_")
    }

    /// Returns this setup as JSON, to pass it to the worker on the command line.
    pub(super) fn to_json(&self) -> Value {
        json!({"names": self.names, "gone": self.gone})
    }

    /// Reads a setup from the JSON that the worker gets on the command line. Returns `None` if
    /// `value` is not a setup.
    pub(super) fn from_json(value: &Value) -> Option<Self> {
        let names = value["names"].as_array()?.iter();
        let names: Option<Vec<String>> = names.map(|name| name.as_str().map(str::to_owned)).collect();
        Some(Self { names: names?, gone: value["gone"].as_bool()? })
    }

    fn scene(&self) -> SceneFile {
        let mut effects = Vec::new();
        let mut simulate = Map::new();
        for name in &self.names {
            if is_kind(name) {
                effects.push(json!({"id": name, "kind": name}));
            } else {
                simulate.insert(name.clone(), json!({}));
            }
        }
        let scene = SceneFile::from_json(json!({"name": "study", "effect": effects, "simulate": simulate}));
        scene.unwrap_or_else(|error| unreachable!("every kind and phenomenon has defaults: {error}"))
    }
}

/// A test bench: a controller and a simulated rig that are active and in the middle of a motion.
/// The controller gets recorded encoder readings, and the rig gets prescribed commands.
#[derive(Clone)]
pub(in crate::verification) struct Desk {
    controller: Controller,
    running: RunningScene,
    scene: Rc<CompiledScene>,
    readings: Rc<Vec<JointReadings>>,
    exchange: Exchange,
    /// Number of the tick that runs next.
    tick: usize,
}

impl Desk {
    /// Creates a test bench without any effect or phenomenon, and runs it until the controller is
    /// active.
    pub(super) fn active() -> Self {
        let config = prototype(&[]);
        // The angle limit at enable is raised to a half turn, as the study must be able to enable
        // with every effect.
        let rig = config.rig.with(|rig| rig.limits.enable_max_angle = core::f64::consts::PI);
        let rig = rig.unwrap_or_else(|error| unreachable!("half a turn is legal: {error}"));
        let simulated = SimulatedRig::new(&SimulatedConfig::new(&rig));
        let simulated =
            simulated.unwrap_or_else(|error| unreachable!("the prototype can be simulated: {error}"));
        // A brisk motion back and forth.
        let motion = &MOTIONS[4];
        let moments = motion.moments(&config.rig.device, 1000, RECORDED, 0);
        let mut running = RunningScene::new();
        let mut desk = Self {
            controller: Controller::new(rig),
            scene: Rc::new(running.load(SceneSetup::default().scene())),
            running,
            readings: Rc::new(readings(&config.rig, motion, &moments)),
            exchange: Exchange::new(simulated, rig.device.joints()),
            tick: 0,
        };
        desk.run(STARTED);
        desk
    }

    /// Returns a copy of this test bench on which the scene of `setup` is fully blended in.
    pub(super) fn with(&self, setup: &SceneSetup) -> Self {
        let empty = SceneSetup::default();
        let mut desk = self.clone();
        desk.change(setup);
        // There are always two changes, so that all desks are at an equal tick number afterwards.
        desk.change(if setup.gone { &empty } else { setup });
        desk
    }

    /// Loads the scene of `setup`, runs ticks until it is blended in, and then resets the state of
    /// the simulated rig.
    fn change(&mut self, setup: &SceneSetup) {
        let file = setup.scene();
        let shown = file.simulate().filter(|_| !setup.names.is_empty()).copied();
        self.exchange.rig_mut().set_phenomena(shown.unwrap_or_default());
        self.scene = Rc::new(self.running.load(file));
        self.run(BLEND);
        self.exchange.rig_mut().set_state(PlantState::default());
    }

    /// Runs `ticks` ticks. Returns a sum of their outputs, so that the compiler cannot remove the
    /// computation.
    pub(super) fn run(&mut self, ticks: usize) -> f64 {
        (0..ticks).map(|_| self.step()).sum()
    }

    /// Runs one tick of the controller and one of the simulated rig. Returns a sum of their
    /// outputs.
    fn step(&mut self) -> f64 {
        let k = self.tick;
        self.tick += 1;
        let mut inputs = Inputs::quiet(k as u64);
        inputs.feedback = self.readings.get(k).copied();
        if k == 1 {
            // There is room, as the tick has no other command.
            let _ = inputs.commands.push(Command::Enable);
        }
        let state = self.controller.tick(&self.scene, &inputs).state;
        debug_assert!(k < STARTED || state.mode == Mode::Active, "{:?} {:?}", state.mode, state.cause);
        let reading = self.exchange.tick(k as u64 * 1_000_000, FIRST + k as u32, &drive(k));
        state.torque.x + reading.map_or(0.0, |reading| reading.rates[0])
    }
}

/// Returns the command that the simulated rig gets in tick `k`. Its joint torques swing back and
/// forth.
fn drive(k: usize) -> Drive {
    let mut drive = Drive { enable: true, torque: [0.0; MAX_JOINTS] };
    for (j, torque) in drive.torque[..4].iter_mut().enumerate() {
        // A triangle wave between -8 and 8 mN m with a period of 128 ticks. Each joint lags the one
        // before by a quarter period.
        let phase = (k + 32 * j) % 128;
        *torque = 5.0e-4 * (phase.abs_diff(64) as f64 - 32.0) * 0.5;
    }
    drive
}

#[cfg(test)]
mod tests {
    use hbot_sim::phenomena::Phenomena;

    use super::*;

    /// A phenomenon acts while the scene names it, and no longer acts after a scene that does not
    /// name it. Otherwise the study would not measure the cost of the phenomenon.
    #[test]
    fn every_phenomenon_of_a_scene_is_shown_and_taken_away() {
        let active = Desk::active();
        let mut seen = Vec::new();
        for listed in scene::phenomena() {
            let setup = SceneSetup::of(&[&listed.name.to_owned()]);
            let shown = *active.with(&setup).exchange.rig().phenomena();
            assert_ne!(shown, Phenomena::default(), "{}", listed.name);
            assert!(!seen.contains(&shown), "{}", listed.name);
            seen.push(shown);
            let gone = active.with(&setup.gone());
            assert_eq!(*gone.exchange.rig().phenomena(), Phenomena::default(), "{}", listed.name);
        }
        assert_eq!(seen.len(), 15);
    }
}
