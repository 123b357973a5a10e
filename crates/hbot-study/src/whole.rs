//! The whole loop in virtual time: a controller, its line and its simulated rig in lock-step.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Commands, Inputs, JointReadings};
use hbot_core::outputs::{Drive, Outputs};
use hbot_core::{CompiledScene, Controller, Device, MAX_JOINTS, Vec3, rotation};
use hbot_sim::exchange::Exchange;
use hbot_sim::phenomena::{Motor, Phenomena};
use hbot_sim::plant::{Plant, PlantState};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::{Value, json};

/// Number of the tick in which the controller is told to enable torque. The controller refuses to
/// enable before it has readings, and the ticks before this one bring them.
const ENABLE: u32 = 6;

/// Returns the configuration of the prototype's rig, with the values in `with` for some of its
/// keys. The lead and the passivity stage are off unless `with` says otherwise, because studies
/// measure the laws themselves.
pub(crate) fn prototype(with: &[(&'static str, Value)]) -> RigConfig {
    let each =
        |(path, value): &(&'static str, Value)| Override { path, value: value.clone(), from: "the study" };
    let own = ["loop.passivity", "loop.lead"].map(|path| (path, Value::Bool(false)));
    let with: Vec<Override> = own.iter().chain(with).map(each).collect();
    RigConfig::load(None, &with).unwrap_or_else(|error| unreachable!("a legal rig: {error}"))
}

/// Returns the sphere's apparent inertia about `axis` with all steer angles at zero, kg m².
pub(crate) fn inertia(device: &Device, axis: Vec3) -> f64 {
    let plant = Plant::new(device).unwrap_or_else(|error| unreachable!("a rig that is a plant: {error}"));
    axis.dot(plant.apparent_inertia(&PlantState::default()) * axis)
}

/// Makes the encoders of `config` `times` as fine.
pub(crate) fn refine(config: &mut RigConfig, times: u32) {
    let finer = config.rig.with(|rig| rig.joints.iter_mut().for_each(|joint| joint.counts_per_turn *= times));
    config.rig = finer.unwrap_or_else(|error| unreachable!("counts that fit the counters: {error}"));
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

/// Duration of the soft start, s, after which the loop gives its full torque.
pub(crate) const START_S: f64 = 0.6;

/// Returns ideal motors that follow their commands with the lag `lag_s`, s: no loss, and no limit
/// of speed or heat in reach.
pub(crate) const fn motor(lag_s: f64) -> Motor {
    Motor {
        lag_s,
        torque_scale: 1.0,
        steer_no_load_rate: 1.0e5,
        drive_no_load_rate: 1.0e5,
        thermal_time_s: 1.0e5,
    }
}

impl Whole {
    /// Creates the loop at time 0. The simulated rig has the configuration `config` and the
    /// phenomena `phenomena`.
    pub(crate) fn new(config: &RigConfig, scene: SceneFile, phenomena: Phenomena) -> Self {
        let simulated = SimulatedConfig { phenomena, ..SimulatedConfig::new(&config.rig) };
        Self::simulated(config, scene, &simulated)
    }

    /// Lets the soft start end, and gives the sphere the angular velocity `omega`, rad/s. Returns
    /// the energy of the swing on a spring of `stiffness`, N m/rad, in each fifth of the next
    /// `watch_s` seconds, J times ticks.
    ///
    /// The sphere exchanges energy between its axes, with the spring and with parts that give way,
    /// so the energy of all of them is summed. Its ripple within a swing averages out over a fifth.
    pub(crate) fn swung(&mut self, omega: Vec3, stiffness: f64, watch_s: f64) -> [f64; 5] {
        self.run(START_S);
        self.tap(omega);
        let part = self.ticks(watch_s / 5.0);
        [(); 5].map(|()| {
            let energy = (0..part).map(|_| {
                self.step(None);
                self.energy(stiffness)
            });
            energy.sum::<f64>()
        })
    }

    /// Returns the energy of sphere, wheels and parts that give way, with that of a spring of
    /// `stiffness` (N m/rad), J.
    pub(crate) fn energy(&self, stiffness: f64) -> f64 {
        let state = self.rig().state();
        let turned = rotation::log(state.q).length_squared();
        self.rig().dynamics().energy(state) + 0.5 * stiffness * turned
    }

    /// Creates the loop as [`new`](Self::new) does, with any settings of the simulated rig.
    pub(crate) fn simulated(config: &RigConfig, scene: SceneFile, simulated: &SimulatedConfig) -> Self {
        let rig = SimulatedRig::new(simulated);
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

    /// Runs the loop for `seconds`.
    pub(crate) fn run(&mut self, seconds: f64) {
        for _ in 0..self.ticks(seconds) {
            self.step(None);
        }
    }

    /// Gives the sphere the angular velocity `omega` (frame N, rad/s), as a tap does.
    pub(crate) fn tap(&mut self, omega: Vec3) {
        let state = PlantState { omega, ..*self.rig().state() };
        self.rig_mut().set_state(state);
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

/// Returns a scene with a spring that acts at once. `stiffness` is in N m/rad, and `damping` in N m
/// s/rad.
pub(crate) fn spring(stiffness: f64, damping: f64) -> SceneFile {
    scene_of(json!({"name": "study", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": stiffness, "damping": damping, "fade_s": 0}
    ]}))
}

/// Returns the scene file `scene`, given as JSON.
pub(crate) fn scene_of(scene: Value) -> SceneFile {
    SceneFile::from_json(scene).unwrap_or_else(|error| unreachable!("a legal scene: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_config::advice::StiffnessBound;
    use hbot_core::design::rig::{Joint, RateEstimate};

    /// Taps the sphere on a spring with 0.01 N m s/rad by `tap` rad/s about n1. Returns the size of
    /// the swing after 2.25 s relative to its size at first, and the largest slip that was seen,
    /// m/s. A fault counts as a swing without bound.
    fn swing(config: &RigConfig, stiffness: f64, tap: f64) -> [f64; 2] {
        let phenomena = Phenomena { motor: Some(motor(5.0e-4)), ..Phenomena::default() };
        let mut whole = Whole::new(config, spring(stiffness, 0.01), phenomena);
        whole.run(START_S);
        whole.tap(Vec3::X * tap);
        let (mut early, mut late, mut slip) = (0.0, 0.0, 0.0_f64);
        for tick in 0..2500 {
            let state = whole.step(None).state;
            slip = slip.max(state.slip);
            if !whole.is_active() {
                return [f64::INFINITY, slip];
            }
            let square = rotation::log(whole.rig().state().q).length_squared();
            early += if tick < 250 { square } else { 0.0 };
            late += if tick >= 2250 { square } else { 0.0 };
        }
        [(late / early).sqrt(), slip]
    }

    /// Returns the first unstable spring with 0.01 N m s/rad about n1, N m/rad, to 2 %.
    fn border(config: &RigConfig, from: f64) -> f64 {
        let mut stiffness = from;
        while swing(config, stiffness, 0.5)[0] < 0.4 {
            stiffness *= 1.04;
            assert!(stiffness < 1000.0, "it is stable with any stiffness");
        }
        stiffness / 1.02
    }

    /// Returns the prototype with a lead, its joints changed by `alter`.
    fn led(estimate: &str, alter: impl Fn(&mut Joint)) -> RigConfig {
        let mut config = prototype(&[
            ("loop.lead", json!(true)),
            ("loop.passivity", json!(false)),
            ("loop.shaking_guard", json!(false)),
            ("loop.rate_estimate", json!(estimate)),
        ]);
        let changed = config.rig.with(|parts| {
            parts.limits.slip = 10.0;
            parts.joints.iter_mut().for_each(&alter);
        });
        config.rig = changed.unwrap_or_else(|error| panic!("{error}"));
        config
    }

    /// The first unstable spring with the rates that `rate_estimate = "auto"` picks for 4096 x 4
    /// counts is to be at least 60 N m/rad. A part of the rate comes from the drives, whose counts
    /// are finer and whose filter is quicker, so the loop is stable with more than the bound says.
    #[test]
    fn the_rates_that_are_picked_keep_stiff_springs_stable() {
        let config = led("auto", |_| ());
        let found = border(&config, 40.0);
        let bound = StiffnessBound::of(&config).expect("legal inertias").stable(0.01);
        assert!(bound > 60.0 && found > 60.0, "{found}, {bound} N m/rad");
        assert!((0.95..2.0).contains(&(found / bound)), "{found}, {bound} N m/rad");
        let [swings, slip] = swing(&config, 15.0, 2.0);
        assert!(swings < 0.4 && slip < 0.05, "a tap of 2 rad/s causes the fault slip: {slip} m/s");
    }

    /// If all joints have counts of one size, all rates are equally late, and the whole loop shakes
    /// where the sampled loop says.
    #[test]
    fn the_lag_of_an_estimate_moves_the_border_as_the_sampled_loop_says() {
        for rate in [
            RateEstimate::Difference,
            RateEstimate::LowPass { cutoff_hz: 100.0 },
            RateEstimate::Kalman { acceleration: 3.0 },
            RateEstimate::Kalman { acceleration: 10.0 },
        ] {
            let mut config = led("controller", |joint| (joint.counts_per_turn, joint.gear) = (65536, 1.0));
            let estimated = config.rig.with(|parts| parts.methods.rate = rate);
            config.rig = estimated.unwrap_or_else(|error| panic!("{error}"));
            let bound = StiffnessBound::of(&config).expect("legal inertias").stable(0.01);
            let found = border(&config, 0.7 * bound);
            // The search has a step of 4 %, and the swing must have decayed by 0.4 in 2.25 s.
            assert!((found / bound - 1.0).abs() < 0.08, "{rate:?}: {found}, {bound} N m/rad");
        }
    }
}
