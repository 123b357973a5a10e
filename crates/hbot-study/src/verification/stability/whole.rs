//! The whole loop: the prototype's controller, its line and its simulated rig in lock-step.

use hbot_core::mode::Mode;
use hbot_core::outputs::State;
use hbot_core::{MAX_JOINTS, Vec3, rotation};
use hbot_sim::phenomena::Phenomena;
use hbot_sim::plant::{Plant, PlantState};
use serde_json::json;

use crate::whole::{Whole, prototype};

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
    whole: Whole,
    /// Energy that the motors have given out, J: torque held times turn made, joint by joint.
    given: f64,
}

impl Loop {
    pub(super) fn new(wanted: &Wanted) -> Self {
        let config =
            prototype(&[("loop.rate_hz", json!(wanted.rate)), ("loop.passivity", json!(wanted.guard))]);
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

    /// Ticks of so many seconds.
    pub(super) fn ticks(&self, seconds: f64) -> u32 {
        self.whole.ticks(seconds)
    }

    /// The apparent inertia about n1, kg m².
    pub(super) fn inertia(&self) -> f64 {
        let Ok(mut plant) = Plant::new(&self.whole.controller().rig().device) else {
            unreachable!("the prototype is a plant")
        };
        plant.set_sphere_inertia(self.whole.rig().dynamics().sphere_inertia());
        plant.apparent_inertia(self.state()).x_axis.x
    }

    /// The rig's.
    pub(super) fn state(&self) -> &PlantState {
        self.whole.rig().state()
    }

    /// Has the sphere turn at `omega`, rad/s in N; what was given out before does not count.
    pub(super) fn tap(&mut self, omega: Vec3) {
        let state = PlantState { omega, ..*self.state() };
        self.whole.rig_mut().set_state(state);
        self.given = 0.0;
    }

    /// Energy of the motion and of a spring of so many N m/rad, J.
    pub(super) fn energy(&self, stiffness: f64) -> f64 {
        let turned = rotation::log(self.state().q);
        self.whole.rig().dynamics().energy(self.state()) + 0.5 * stiffness * turned.length_squared()
    }

    /// Energy that the motors have given out since the tap, J.
    pub(super) fn given(&self) -> f64 {
        self.given
    }

    /// One tick.
    pub(super) fn step(&mut self) -> State {
        let rig = self.whole.rig();
        let (held, before) = (*rig.joint_torque(), rig.state().joints());
        let told = self.whole.step(None).state;
        let after = self.state().joints();
        self.given += (0..MAX_JOINTS).map(|j| held[j] * (after[j] - before[j])).sum::<f64>();
        told
    }

    /// Whether motors may push.
    pub(super) fn is_active(told: &State) -> bool {
        told.mode == Mode::Active
    }
}
