//! The plant with friction that sticks, contacts that slip and gears with play: set-valued laws, stable at any step.
//!
//! A time-stepping scheme (Moreau 1988; Jean 1999): the laws hold between the impulse of a step and the speeds at its
//! end. Normal forces and friction limits are given, not found, so each law is the gradient of a convex function and the
//! speeds at the end are the unique minimum of another ([`solver`]). From that follow
//!
//! - stability at any step and any ratio of masses, without a time constant of contact;
//! - sticking that does not creep: the impulse of the last step is where the next one starts;
//! - energy that no step can raise: implicit Euler against laws that only take, and potentials as discrete gradients
//!   ([`weights`](super::weights));
//! - order 1 in the step, like every scheme that looks for no event.
//!
//! Speeds are the sphere's angular velocity, the joint rates where contacts may slip (else they follow from the sphere),
//! and the rates of motors behind a gear with play. In these the masses are constant: no force of inertia but those of the
//! constraints.

mod body;
mod law;
mod solver;

use hbot_core::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::{Vec3, rotation};

use self::body::{Body, Given, Instant};
use self::law::Element;
pub use self::solver::Effort;
use self::solver::{StepProblem, Workspace};
use super::weights::{GRAVITY, Module, Spring, Weight};
use super::{JointTorques, PlantState};
use crate::hand::Grip;
use crate::phenomena::Phenomena;

/// The sphere, two joints a wheel, a motor behind each drive's gear.
const MAX_SPEEDS: usize = 3 + 3 * MAX_WHEELS;
type Vector = [f64; MAX_SPEEDS];

/// How often discrete gradients and losses of gears are taken anew within a step, at most; each time gains a digit or more.
const MAX_SWEEPS: usize = 12;
/// They stand when the speeds change by no more than this part: the torque is then off by a step's turn less.
const SETTLED: f64 = 1.0e-10;
/// Speeds below this settle as if they were it, rad/s: to 1e-12, about what the solver leaves of those that stick.
const RESTING: f64 = 1.0e-2;
/// A gear's loss may be that of the step before where the two are this near, for then it changes slowly: of the
/// scheme's order. Where gears meet it does not.
const LAG: f64 = 0.05;
/// Else it is found anew, to this part.
const SETTLED_LOSS: f64 = 1.0e-6;

/// A device whose friction sticks, contacts slip, or gears have play.
#[derive(Debug, Clone)]
pub(crate) struct Nonsmooth {
    body: Body,
    elements: Vec<Element>,
    /// The step that the elements' impulses are of, s.
    last_step: f64,
    problem: StepProblem,
    workspace: Workspace,
    effort: Effort,
}

/// A drive's motor behind its gear, in the joint's measure.
#[derive(Debug, Clone, Copy, Default)]
struct Motor {
    angle: f64,
    rate: f64,
    /// What the gear lost in the last step by passing torque on, N m at the motor.
    loss: f64,
}

impl Nonsmooth {
    /// The plant of `device` with what `phenomena` name, at `state`.
    pub(super) fn new(device: &Device, phenomena: Phenomena, state: &PlantState) -> Self {
        let capacity = 2 + 5 * device.wheels().len();
        let mut plant = Self {
            body: Body {
                device: *device,
                phenomena,
                inertia: device.sphere_inertia(),
                modules: phenomena.wheel_modules.map(|modules| Module::all(device, modules.mass)),
                rates: [0.0; MAX_JOINTS],
                motors: [Motor::default(); MAX_WHEELS],
                hinge: None,
            },
            elements: Vec::with_capacity(capacity),
            last_step: 1.0,
            problem: StepProblem::EMPTY,
            workspace: Workspace::new(capacity),
            effort: Effort::default(),
        };
        plant.adopt(state);
        plant
    }

    /// Takes over a state that something else has made: joints roll without slip, motors in the middle of their play,
    /// nothing held yet.
    pub(super) fn adopt(&mut self, state: &PlantState) {
        let now = self.body.instant(state, 0.0);
        for i in 0..self.body.wheels() {
            for k in 0..2 {
                self.body.rates[2 * i + k] = now.rows[i][k].dot(state.omega);
            }
            self.body.motors[i] =
                Motor { angle: state.drive[i], rate: self.body.rates[2 * i + 1], loss: 0.0 };
        }
        self.elements.clear();
    }

    pub(super) fn set_sphere_inertia(&mut self, inertia: f64) {
        self.body.inertia = inertia;
    }

    pub(super) fn sphere_inertia(&self) -> f64 {
        self.body.inertia
    }

    pub(super) fn set_hinge(&mut self, axis: Option<Vec3>) {
        self.body.hinge = axis;
        self.elements.clear();
    }

    /// How hard the last step was.
    pub(super) fn effort(&self) -> Effort {
        self.effort
    }

    /// What the encoders sit on: joint angles, at the motor's side of a gear, rad.
    pub(super) fn encoder_angles(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        let mut angles = state.joints();
        if self.body.phenomena.gear.is_some() {
            for i in 0..self.body.wheels() {
                angles[2 * i + 1] = self.body.motors[i].angle;
            }
        }
        angles
    }

    /// Rates of what the encoders sit on, rad/s.
    pub(super) fn encoder_rates(&self) -> [f64; MAX_JOINTS] {
        let mut rates = self.body.rates;
        if self.body.phenomena.gear.is_some() {
            for i in 0..self.body.wheels() {
                rates[2 * i + 1] = self.body.motors[i].rate;
            }
        }
        rates
    }

    /// Slip velocity of each wheel along its c1 and c2, wheel minus sphere, m/s.
    pub(super) fn slip(&self, state: &PlantState) -> [[f64; 2]; MAX_WHEELS] {
        let (now, speeds) = (self.body.instant(state, 0.0), self.body.speeds(state));
        core::array::from_fn(|i| {
            if i >= self.body.wheels() {
                return [0.0; 2];
            }
            self.body.slip_rows(&now, i).map(|row| row.dot(&speeds))
        })
    }

    /// Kinetic and potential energy, J; a hand's spring is not in it.
    pub(super) fn energy(&self, state: &PlantState) -> f64 {
        let mut energy = 0.5 * self.body.inertia * state.omega.length_squared();
        for (i, wheel) in self.body.device.wheels().iter().enumerate() {
            let (steer, drive, motor) =
                (self.body.rates[2 * i], self.body.rates[2 * i + 1], self.body.motors[i].rate);
            let [steer_mass, coupling, drive_mass] = self.body.wheel_mass(wheel);
            energy +=
                0.5 * (steer_mass * steer * steer + drive_mass * drive * drive) + coupling * steer * drive;
            energy += 0.5 * self.body.motor_mass(wheel) * motor * motor;
            energy += self.body.modules.map_or(0.0, |modules| modules[i].energy(state.steer[i]));
        }
        energy + self.weight().map_or(0.0, |weight| weight.energy(state.q))
    }

    /// Moves `state` on by `h` seconds to the time `end` (s), with `tau` held at the motors, `external` on the sphere
    /// (in N, N m), and a hand.
    pub(super) fn step(
        &mut self,
        state: &mut PlantState,
        end: f64,
        h: f64,
        tau: &JointTorques,
        external: Vec3,
        grip: Option<&Grip>,
    ) {
        let now = self.body.instant(state, 0.5 * h);
        let hold = grip.map(|grip| {
            let target = grip.target(end);
            let spring = Spring { stiffness: grip.hand().stiffness, target: target.q };
            (spring, grip.hand().damping, target.omega)
        });
        let weight = self.weight();
        let implicit =
            hold.as_ref().map_or(0.0, |(spring, damping, _)| h * (0.5 * h * spring.stiffness + damping));
        let before = self.body.speeds(state);
        let share = h / self.last_step;
        self.body.lay_out(&mut self.elements, share, state, &now, &before, h);

        let mut speeds = before;
        let mut effort = Effort::default();
        let potentials = weight.is_some() || hold.is_some() || self.body.modules.is_some();
        let mut settled = !potentials;
        for sweep in 0..=MAX_SWEEPS {
            let last = sweep == MAX_SWEEPS;
            // What depends on the speeds at the end: torques of potentials, by the last guess.
            let (guess, implicit) = if last {
                // Sweeps that do not settle give way to what takes energy at any step: torques as they are now, and half
                // the most that a potential can curve as a stiffness against the step.
                ([0.0; MAX_SPEEDS], implicit + 0.5 * h * h * weight.map_or(0.0, |weight| weight.curvature()))
            } else {
                (speeds, implicit)
            };
            let omega = Vec3::from_slice(&guess[..3]);
            let phi = omega * h;
            let mut torque = external;
            if let Some(weight) = &weight {
                torque += weight.torque_over(state.q, phi);
            }
            let mut given = Vec3::ZERO;
            if let Some((spring, damping, target)) = &hold {
                torque += spring.torque_over(state.q, phi);
                // The spring's change with the speed stands in the mass; taken out here, it is exact at the end.
                given = omega * (0.5 * h * h * spring.stiffness) + *target * (h * damping);
            }
            let impulse = torque * h + given;
            let given = Given { h, tau, impulse, implicit, guess: &guess, bounded: last };
            self.body.assemble(&mut self.problem, state, &now, &given);
            effort = self.workspace.solve(&mut self.problem, &mut self.elements, &mut speeds);
            let lag = if sweep == 0 { LAG } else { SETTLED_LOSS };
            let meshed = self.body.mesh(&mut self.elements, &speeds, h, lag);
            if potentials {
                let moved = speeds.iter().zip(&guess).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let size = speeds.iter().zip(&before).map(|(a, b)| a.abs().max(b.abs())).fold(0.0, f64::max);
                settled = sweep > 0 && moved <= SETTLED * size.max(RESTING);
            }
            if settled && (meshed || sweep + 1 == MAX_SWEEPS) {
                break;
            }
        }
        self.effort = effort;
        self.last_step = h;
        self.take(state, &now, &speeds, h);
    }

    /// The speeds after the step become the plant's, and everything moves by them.
    fn take(&mut self, state: &mut PlantState, now: &Instant, speeds: &Vector, h: f64) {
        state.omega = Vec3::from_slice(&speeds[..3]);
        state.q = rotation::renormalized(rotation::exp(state.omega * h) * state.q);
        for i in 0..self.body.wheels() {
            for k in 0..2 {
                self.body.rates[2 * i + k] = match self.body.joint_at(i, k) {
                    Some(at) => speeds[at],
                    None => now.rows[i][k].dot(state.omega),
                };
            }
            state.steer[i] += h * self.body.rates[2 * i];
            state.drive[i] += h * self.body.rates[2 * i + 1];
            if let Some(at) = self.body.motor_at(i) {
                let motor = &mut self.body.motors[i];
                motor.rate = speeds[at];
                motor.angle += h * motor.rate;
            }
        }
    }

    /// The sphere's own weight, where it is out of centre.
    fn weight(&self) -> Option<Weight> {
        self.body.phenomena.eccentric.map(|eccentric| Weight {
            offset: Vec3::from_array(eccentric.offset),
            weight: self.body.device.sphere_mass() * GRAVITY,
        })
    }
}
