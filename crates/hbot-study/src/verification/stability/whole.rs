//! The whole loop for the study of stability: the prototype's controller, its line and its
//! simulated rig in lock-step, with a spring.

use hbot_core::outputs::State;
use hbot_core::safety::mode::Mode;
use hbot_core::{MAX_JOINTS, Vec3, rotation};
use hbot_sim::phenomena::Phenomena;
use hbot_sim::plant::{Plant, PlantState};
use serde_json::json;

use crate::whole::{Whole, prototype};

/// Duration of the soft start, s, after which the loop gives its full torque.
const START_S: f64 = 0.6;

/// Settings of a [`Loop`]: the rendered spring, the rate of the loop, and the simulated rig.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// Rate of the control loop, Hz.
    pub(super) rate: u32,
    /// Stiffness of the rendered spring, N m/rad.
    pub(super) stiffness: f64,
    /// Damping of the rendered spring, N m s/rad.
    pub(super) damping: f64,
    /// Phenomena of a real rig that the simulated rig shows.
    pub(super) phenomena: Phenomena,
    /// How many times as fine the encoders are as the prototype's.
    pub(super) finer: u32,
    /// Whether the controller's passivity stage is on.
    pub(super) guard: bool,
}

/// A control loop in virtual time that renders a spring on the simulated rig. It is active, and the
/// sphere starts at rest at the centre of the spring.
pub(super) struct Loop {
    whole: Whole,
    /// Energy that the motors have delivered since the last tap, J. It is the sum over all joints
    /// and ticks of the joint torque times the angle by which the joint turned.
    given: f64,
}

impl Loop {
    pub(super) fn new(wanted: &Wanted) -> Self {
        // All energy counts, so that the energy given out can be compared with its bound.
        let guard = if wanted.guard { json!({ "strict": true }) } else { json!(false) };
        let mut config = prototype(&[("loop.rate_hz", json!(wanted.rate)), ("loop.passivity", guard)]);
        let finer = config
            .rig
            .with(|rig| rig.joints.iter_mut().for_each(|joint| joint.counts_per_turn *= wanted.finer));
        config.rig = finer.unwrap_or_else(|error| unreachable!("counts that fit the counters: {error}"));
        let scene = json!({"name": "study", "effect": [
            {"id": "spring", "kind": "spring", "stiffness": wanted.stiffness, "damping": wanted.damping, "fade_s": 0}
        ]});
        let whole = Whole::new(&config, scene, wanted.phenomena, PlantState::default());
        let mut new = Self { whole, given: 0.0 };
        for _ in 0..new.ticks(START_S) {
            new.step();
        }
        new
    }

    /// Returns the number of ticks that the loop makes in `seconds`.
    pub(super) fn ticks(&self, seconds: f64) -> u32 {
        self.whole.ticks(seconds)
    }

    /// Returns the sphere's apparent inertia about n1, kg m².
    pub(super) fn inertia(&self) -> f64 {
        let Ok(mut plant) = Plant::new(&self.whole.controller().rig().device) else {
            unreachable!("the prototype is a plant")
        };
        plant.set_sphere_inertia(self.whole.rig().dynamics().sphere_inertia());
        plant.apparent_inertia(self.state()).x_axis.x
    }

    /// Returns the true state of the simulated rig.
    pub(super) fn state(&self) -> &PlantState {
        self.whole.rig().state()
    }

    /// Sets the sphere's angular velocity to `omega` (frame N, rad/s), and sets the delivered
    /// energy to zero.
    pub(super) fn tap(&mut self, omega: Vec3) {
        let state = PlantState { omega, ..*self.state() };
        self.whole.rig_mut().set_state(state);
        self.given = 0.0;
    }

    /// Returns the energy of the sphere and the wheels plus that of a spring of `stiffness` (N
    /// m/rad), J.
    pub(super) fn energy(&self, stiffness: f64) -> f64 {
        let turned = rotation::log(self.state().q);
        self.whole.rig().dynamics().energy(self.state()) + 0.5 * stiffness * turned.length_squared()
    }

    /// Returns the energy that the motors have delivered since the last tap, J.
    pub(super) fn given(&self) -> f64 {
        self.given
    }

    /// Runs one tick and returns the state that the controller reports.
    pub(super) fn step(&mut self) -> State {
        let rig = self.whole.rig();
        let (held, before) = (*rig.joint_torque(), rig.state().joints());
        let told = self.whole.step(None).state;
        let after = self.state().joints();
        self.given += (0..MAX_JOINTS).map(|j| held[j] * (after[j] - before[j])).sum::<f64>();
        told
    }

    /// Returns whether the controller's mode is active, so that the motors can give torque.
    pub(super) fn is_active(told: &State) -> bool {
        told.mode == Mode::Active
    }
}
