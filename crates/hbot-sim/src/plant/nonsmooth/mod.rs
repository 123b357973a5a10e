//! The nonsmooth plant: friction that sticks, contacts that slip, and gears with play. It is stable
//! at any step.
//!
//! It uses a time-stepping scheme (Moreau 1988; Jean 1999): the set-valued laws hold between the
//! impulse of a step and the speeds at its end. Normal forces and friction limits are parameters,
//! not unknowns. Each law is therefore the gradient of a convex function, and the speeds at the end
//! of a step are the unique minimum of another convex function ([`solver`]). It follows that
//!
//! - the scheme is stable at any step and any ratio of masses, without a time constant of contact;
//! - sticking does not creep, because each step starts from the impulses of the step before;
//! - no step can raise the energy: implicit Euler meets laws that only take energy, and potentials
//!   are discrete gradients ([`weights`](super::weights));
//! - the order is 1, as for every scheme that does not locate events.
//!
//! The speeds are the sphere's angular velocity, the joint rates if contacts can slip (otherwise
//! they follow from the sphere), and the rates of motors behind a gear with play. In these speeds
//! the masses are constant, so the only inertial forces are those of the constraints.

mod body;
mod compliance;
mod law;
mod solver;

use hbot_core::design::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::{Vec3, rotation};

use self::body::{Body, Given, Instant};
use self::compliance::Bent;
use self::law::Element;
pub use self::solver::Effort;
use self::solver::{StepProblem, Workspace};
use super::weights::{Module, Spring, Weight};
use super::{Frictions, JointTorques, PlantState};
use crate::hand::Grip;
use crate::phenomena::Phenomena;

/// Largest number of speeds: 3 of the sphere, 2 of the joints of each wheel, 1 of the motor behind
/// each drive's gear, and 3 of the sphere's centre.
const MAX_SPEEDS: usize = 6 + 3 * MAX_WHEELS;
type Vector = [f64; MAX_SPEEDS];

/// Largest number of times that one step is solved. The torques of potentials and the gear losses
/// are recomputed each time, so that each solution has at least one correct digit more.
const MAX_SWEEPS: usize = 12;
/// Relative change of the speeds from one solution of a step to the next, below which the step is
/// not solved again. The torques then have an even smaller error, because they depend only on the
/// small turn within a step.
const SETTLED: f64 = 1.0e-10;
/// Smallest speed relative to which a change of the speeds is measured, rad/s. Slower speeds must
/// settle to 1e-12 rad/s, which is about the velocity that the solver leaves to a sticking part.
const RESTING: f64 = 1.0e-2;
/// Relative error up to which a gear can keep the friction loss from the previous step.
///
/// While the loss changes slowly, this error is no larger than that of the integration scheme. When
/// gear teeth come into contact, the loss changes fast and is recomputed.
const LAG: f64 = 0.05;
/// Relative error up to which a gear's friction loss is computed when it is recomputed.
const SETTLED_LOSS: f64 = 1.0e-6;

/// A simulated plant in which friction can stick, contacts can slip, or gears have play.
#[derive(Debug, Clone)]
pub(crate) struct Nonsmooth {
    body: Body,
    elements: Vec<Element>,
    /// Length of the last step, s. The impulses in `elements` belong to a step of this length.
    last_step: f64,
    problem: StepProblem,
    workspace: Workspace,
    effort: Effort,
}

/// The motor behind the gear of a drive joint. Angle and rate are scaled to the joint, as if the
/// gear ratio were 1.
#[derive(Debug, Clone, Copy, Default)]
struct Motor {
    angle: f64,
    rate: f64,
    /// Torque that the gear lost by friction under load in the last step, on the motor's side, N m.
    loss: f64,
}

impl Nonsmooth {
    /// Creates the plant of `device` with the given phenomena, at `state`.
    /// `frictions` are added to the frictions among the phenomena.
    pub(super) fn new(
        device: &Device,
        phenomena: Phenomena,
        frictions: Option<Frictions>,
        state: &PlantState,
    ) -> Self {
        let capacity = 2 + 5 * device.wheels().len();
        let mut plant = Self {
            body: Body {
                device: *device,
                phenomena,
                frictions,
                inertia: device.sphere_inertia(),
                modules: phenomena.wheel_modules.map(|modules| Module::all(device, modules.mass)),
                rates: [0.0; MAX_JOINTS],
                motors: [Motor::default(); MAX_WHEELS],
                hinge: None,
                bent: Bent::default(),
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

    /// Continues from a state that the caller has set. Afterwards joints roll without slip, motors
    /// are at the middle of their gears' play, and all friction impulses are zero.
    pub(super) fn adopt(&mut self, state: &PlantState) {
        self.body.bent = Bent::default();
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

    /// Returns how many iterations the solver needed in the last step.
    pub(super) fn effort(&self) -> Effort {
        self.effort
    }

    /// Returns the angles that the encoders measure, rad. If gears have play, the drive angles are
    /// those of the motors.
    pub(super) fn encoder_angles(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        let mut angles = state.joints();
        if self.body.phenomena.gear.is_some() {
            for i in 0..self.body.wheels() {
                angles[2 * i + 1] = self.body.motors[i].angle;
            }
        }
        angles
    }

    /// Returns the rates that the encoders measure, rad/s. If gears have play, the drive rates are
    /// those of the motors.
    pub(super) fn encoder_rates(&self) -> [f64; MAX_JOINTS] {
        let mut rates = self.body.rates;
        if self.body.phenomena.gear.is_some() {
            for i in 0..self.body.wheels() {
                rates[2 * i + 1] = self.body.motors[i].rate;
            }
        }
        rates
    }

    /// Returns the slip velocity of each wheel along its axle (c1) and its rolling direction (c2),
    /// wheel minus sphere, m/s.
    pub(super) fn slip(&self, state: &PlantState) -> [[f64; 2]; MAX_WHEELS] {
        let (now, speeds) = (self.body.instant(state, 0.0), self.body.speeds(state));
        core::array::from_fn(|i| {
            if i >= self.body.wheels() {
                return [0.0; 2];
            }
            self.body.slip_rows(&now, i).map(|row| row.dot(&speeds))
        })
    }

    /// Returns the kinetic and potential energy of the plant, J. The energy of the simulated hand's
    /// spring is not included.
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
        if let Some(parts) = &self.body.phenomena.compliance {
            energy += 0.5 * self.body.device.sphere_mass() * self.body.bent.velocity.length_squared();
            energy += self.body.bent.energy(parts);
        }
        energy + self.weight().map_or(0.0, |weight| weight.energy(state.q))
    }

    /// Advances `state` by `h` seconds to the time `end` (s).
    ///
    /// The joint torques `tau` (N m) act at the motors. The torque `external` (N m, frame N) acts
    /// on the sphere. If `grip` is given, a simulated hand holds the sphere.
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

        let angles_by_mean = self.body.has_mean_angles();
        let mut speeds = before;
        let mut effort = Effort::default();
        let potentials = weight.is_some() || hold.is_some() || self.body.modules.is_some();
        let mut settled = !potentials;
        for sweep in 0..=MAX_SWEEPS {
            let last = sweep == MAX_SWEEPS;
            // The torques of potentials depend on the speeds at the end of the step. The last guess
            // of these is used.
            let (guess, implicit) = if last {
                // If the sweeps do not settle, the last one is made so that it cannot add energy.
                // It takes the torques at the start, and adds half the largest curvature of the
                // potentials as a stiffness against the step.
                ([0.0; MAX_SPEEDS], implicit + 0.5 * h * h * weight.map_or(0.0, |weight| weight.curvature()))
            } else {
                (speeds, implicit)
            };
            let omega = Vec3::from_slice(&guess[..3]);
            let path = if angles_by_mean && !last { mean(&before, &guess) } else { guess };
            let phi = Vec3::from_slice(&path[..3]) * h;
            let mut torque = external;
            if let Some(weight) = &weight {
                torque += weight.torque_over(state.q, phi);
            }
            let mut given = Vec3::ZERO;
            if let Some((spring, damping, target)) = &hold {
                torque += spring.torque_over(state.q, phi);
                // The mass contains the change of the spring's torque with the speed. Subtracting
                // that of the guess here makes the torque exact after the sweeps have settled.
                given = omega * (0.5 * h * h * spring.stiffness) + *target * (h * damping);
            }
            let impulse = torque * h + given;
            let given = Given { h, tau, impulse, implicit, guess: &path, bounded: last };
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
        self.body.bend(&self.elements, &now, [&before, &speeds], h);
        if angles_by_mean {
            let mean = mean(&before, &speeds);
            self.move_by(state, &now, &mean, h);
            self.body.store_rates(state, &now, &speeds);
        } else {
            self.move_by(state, &now, &speeds, h);
        }
    }

    /// Advances all angles by `h` seconds at the speeds `speeds`, and stores these speeds.
    fn move_by(&mut self, state: &mut PlantState, now: &Instant, speeds: &Vector, h: f64) {
        self.body.store_rates(state, now, speeds);
        state.q = rotation::renormalized(rotation::exp(state.omega * h) * state.q);
        for i in 0..self.body.wheels() {
            state.steer[i] += h * self.body.rates[2 * i];
            state.drive[i] += h * self.body.rates[2 * i + 1];
            if let Some(at) = self.body.motor_at(i) {
                let motor = &mut self.body.motors[i];
                motor.rate = speeds[at];
                motor.angle += h * motor.rate;
            }
        }
    }

    /// Returns the sphere's weight if its centre of mass is off centre, so that gravity turns the
    /// sphere. Otherwise returns `None`.
    fn weight(&self) -> Option<Weight> {
        Weight::of(&self.body.device, &self.body.phenomena)
    }
}

/// Returns the mean of the speeds before and after a step.
fn mean(before: &Vector, after: &Vector) -> Vector {
    core::array::from_fn(|i| 0.5 * (before[i] + after[i]))
}
