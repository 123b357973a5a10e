//! The mechanics of the simulated rig: the sphere on wheels that do not slip (physics notes,
//! section 5).
//!
//! A [`Plant`] holds the constants of a device. A [`PlantState`] holds its angles and the sphere's
//! angular velocity. A [`Load`] gives the torques on the sphere other than the wheels'.
//! [`Plant::step`] advances a state by one fixed step of a [`Method`]. [`Plant::advance_exactly`]
//! is the adaptive reference against which the methods are compared. [`Dynamics`] chooses between
//! this plant and one with stick, slip and play, which also makes the steps for which this plant is
//! too stiff.
//!
//! Steps allocate nothing, call no function of the platform, and fuse no operations. They therefore
//! give the same bits on every machine.

mod dynamics;
mod fastest;
mod field;
mod load;
mod method;
mod model;
mod nonsmooth;
mod pair;
mod reference;
mod trig;
mod weights;

use core::fmt;

use hbot_core::design::device::{Device, MAX_JOINTS, MAX_WHEELS};
use hbot_core::design::rig::Friction;
use hbot_core::{Mat3, Quat, Vec3};

pub use dynamics::Dynamics;
pub use load::{Load, Sine, SpringDamper, Sum};
pub use method::Method;
pub use nonsmooth::Effort;
pub use reference::StepTooSmall;

use field::{Extras, Field, Ideal, Loaded};
use model::{Model, Symmetric};
use pair::Pair;

use crate::phenomena::Phenomena;

/// Joint torques in N m, in the order steer, drive of each wheel. Entries beyond the device's
/// joints must be finite and have no effect.
pub type JointTorques = [f64; MAX_JOINTS];

/// The friction of each joint and of the sphere in its cage, as a rig file says it. A part that
/// rests sticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frictions {
    /// Friction of the joints, in the order steer, drive of each wheel.
    pub joints: [Friction; MAX_JOINTS],
    /// Friction of the sphere. Its torque is one on the sphere, and its rate the angular speed of
    /// the sphere.
    pub sphere: Friction,
}

/// The mechanics of a device whose wheels do not slip: its constants, and the phenomena that keep
/// it smooth, such as viscous joint friction.
#[derive(Debug, Clone)]
pub struct Plant {
    model: Model,
    wheels: usize,
    extras: Option<Box<Extras>>,
}

/// The state of a plant: the sphere's orientation and angular velocity, and the joint angles. Joint
/// rates follow from `omega` and the steer angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantState {
    /// Orientation of the sphere as a unit quaternion that maps sphere axes to frame N.
    pub q: Quat,
    /// Angular velocity of the sphere in frame N, rad/s.
    pub omega: Vec3,
    /// Steer angle th of each wheel, rad. It counts whole turns and is not reduced to one turn.
    /// Entries beyond the device's wheels do not change.
    pub steer: [f64; MAX_WHEELS],
    /// Drive angle ph of each wheel, rad. It counts whole turns and is not reduced to one turn.
    /// Entries beyond the device's wheels do not change.
    pub drive: [f64; MAX_WHEELS],
}

impl Default for PlantState {
    /// Returns a state at rest, with the identity as orientation and all joint angles zero.
    fn default() -> Self {
        Self { q: Quat::IDENTITY, omega: Vec3::ZERO, steer: [0.0; MAX_WHEELS], drive: [0.0; MAX_WHEELS] }
    }
}

impl PlantState {
    /// Returns the joint angles in the order steer, drive of each wheel, rad.
    #[must_use]
    pub fn joints(&self) -> [f64; MAX_JOINTS] {
        core::array::from_fn(|j| if j % 2 == 0 { self.steer[j / 2] } else { self.drive[j / 2] })
    }
}

/// Error: the inertias of a wheel are physically impossible.
///
/// The coupling J_c = I_axial sin a sin b (a: cone angle, b: toe angle) has J_c² > J_th J_ph, so
/// some motion of the wheel's joints would have negative kinetic energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImpossibleInertia {
    /// Index of the wheel, counted from 0.
    pub wheel: usize,
}

impl fmt::Display for ImpossibleInertia {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "wheel {}: its axial inertia couples the joints more than their own inertias allow; (axial inertia x \
             sin(cone) x sin(toe))² must not exceed steer inertia x drive inertia",
            self.wheel + 1
        )
    }
}

impl core::error::Error for ImpossibleInertia {}

/// Runs an expression with `P` as a compile-time constant: the number of wheel pairs that holds all
/// wheels of the plant. Plants with three pairs use `P` = 4, to save one more copy of the compiled
/// code.
macro_rules! with_pairs {
    ($plant:expr, $P:ident => $body:expr) => {
        match $plant.wheels.div_ceil(2) {
            1 => {
                const $P: usize = 1;
                $body
            }
            2 => {
                const $P: usize = 2;
                $body
            }
            _ => {
                const $P: usize = 4;
                $body
            }
        }
    };
}

/// Runs an expression with `field` bound to the plant under joint torques and a load. `field` is
/// the ideal plant, or the plant with off-centre masses or viscous joints.
macro_rules! with_field {
    ($plant:expr, $tau:expr, $load:expr, $P:ident, $field:ident => $body:expr) => {
        match &$plant.extras {
            None => with_pairs!($plant, $P => {
                let $field = Ideal::<'_, $P, _> { model: &$plant.model, push: $plant.model.push($tau), load: $load };
                $body
            }),
            Some(extras) => with_pairs!($plant, $P => {
                let $field = Loaded { inertia: $plant.model.inertia, extras, tau: $tau, load: $load };
                $body
            }),
        }
    };
}

impl Plant {
    /// Creates the ideal plant of `device`, without phenomena.
    ///
    /// # Errors
    /// Fails if the inertias of a wheel are physically impossible (see [`ImpossibleInertia`]).
    pub fn new(device: &Device) -> Result<Self, ImpossibleInertia> {
        Self::with(device, &Phenomena::default())
    }

    /// Creates the plant of `device` with those of `phenomena` that keep it smooth.
    ///
    /// These are an eccentric sphere, the weight of the wheel modules, and the viscous part of
    /// joint friction. Other phenomena are ignored; [`Dynamics`] handles them.
    ///
    /// # Errors
    ///
    /// Fails if the inertias of a wheel are physically impossible (see [`ImpossibleInertia`]).
    pub fn with(device: &Device, phenomena: &Phenomena) -> Result<Self, ImpossibleInertia> {
        let model = Model::new(device).map_err(|wheel| ImpossibleInertia { wheel })?;
        let extras = Extras::new(device, phenomena).map(Box::new);
        Ok(Self { model, wheels: device.wheels().len(), extras })
    }

    /// Returns the number of wheels of the device.
    #[must_use]
    pub fn wheels(&self) -> usize {
        self.wheels
    }

    /// Returns the inertia of the sphere and of anything attached to it, such as a hand, in kg m².
    /// It is equal about all axes. The wheels' inertia is not included.
    #[must_use]
    pub fn sphere_inertia(&self) -> f64 {
        self.model.inertia
    }

    /// Sets the inertia of the sphere and of anything attached to it, such as a hand, in kg m². It
    /// must be positive.
    pub fn set_sphere_inertia(&mut self, inertia: f64) {
        self.model.inertia = inertia;
    }

    /// Returns the angular acceleration dw/dt of the sphere in frame N, rad/s². `external` is the
    /// torque on the sphere (frame N, N m) in addition to the joint torques `tau`.
    #[must_use]
    pub fn acceleration(&self, state: &PlantState, external: Vec3, tau: &JointTorques) -> Vec3 {
        with_field!(self, tau, &external, P, field => {
            let geometry = Field::<P>::geometry(&field, state.q, &gather(&state.steer));
            Field::<P>::flow(&field, &geometry, &(), state.q, state.omega).acceleration
        })
    }

    /// Returns the rates of all joints, rad/s, in the order steer, drive of each wheel. They follow
    /// from the sphere's angular velocity w, because the wheels do not slip: zd = G w.
    #[must_use]
    pub fn joint_rates(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        with_field!(self, &[0.0; MAX_JOINTS], &Vec3::ZERO, P, field => {
            let geometry = Field::<P>::geometry(&field, state.q, &gather(&state.steer));
            let (steer, drive) = Field::<P>::rates(&field, &geometry, state.omega);
            let mut rates = [0.0; MAX_JOINTS];
            for p in 0..P {
                for lane in 0..2 {
                    rates[4 * p + 2 * lane] = steer[p].0[lane];
                    rates[4 * p + 2 * lane + 1] = drive[p].0[lane];
                }
            }
            rates
        })
    }

    /// Returns the energy of the plant, J: the kinetic energy of sphere and wheels, 1/2 wᵀ (I_s I +
    /// Gᵀ J_q G) w, plus the potential energy of off-centre masses.
    ///
    /// It is constant if no load, joint torque or viscous friction acts.
    #[must_use]
    pub fn energy(&self, state: &PlantState) -> f64 {
        let kinetic = 0.5 * state.omega.dot(self.apparent_inertia(state) * state.omega);
        kinetic + self.extras.as_ref().map_or(0.0, |extras| extras.energy(state.q, &state.steer))
    }

    /// Returns the apparent inertia of the sphere in frame N, kg m². It includes the inertia of the
    /// wheels, which turn with the sphere: I_s I + Gᵀ J_q G.
    #[must_use]
    pub fn apparent_inertia(&self, state: &PlantState) -> Mat3 {
        let Symmetric { xx, yy, zz, xy, xz, yz } = match &self.extras {
            None => with_pairs!(self, P => self.model.apparent(&self.model.rows::<P>(&gather(&state.steer)))),
            Some(extras) => with_pairs!(self, P => {
                let field = Loaded { inertia: self.model.inertia, extras, tau: &[0.0; MAX_JOINTS], load: &() };
                field.apparent(&field.contacts::<P>(state.q, &gather(&state.steer)))
            }),
        };
        Mat3::from_cols(Vec3::new(xx, xy, xz), Vec3::new(xy, yy, yz), Vec3::new(xz, yz, zz))
    }

    /// Advances `state` by one step of `h` seconds from time `t` (s). During the step the joint
    /// torques `tau` are constant, and `load` acts on the sphere.
    #[inline]
    pub fn step<L: Load>(
        &self,
        method: Method,
        state: &mut PlantState,
        t: f64,
        h: f64,
        tau: &JointTorques,
        load: &L,
    ) {
        with_field!(self, tau, load, P, field => method.step::<P>(&field, state, t, h));
    }
}

/// Groups an array with one number per wheel into pairs of wheels.
#[inline(always)]
fn gather<const P: usize>(wheels: &[f64; MAX_WHEELS]) -> [Pair; P] {
    core::array::from_fn(|p| Pair([wheels[2 * p], wheels[2 * p + 1]]))
}

/// Writes pairs of wheels back to an array with one number per wheel. The missing wheel of a last,
/// half-used pair is written too, but its number never changes.
#[inline(always)]
fn scatter<const P: usize>(pairs: &[Pair; P], wheels: &mut [f64; MAX_WHEELS]) {
    for p in 0..P {
        wheels[2 * p] = pairs[p].0[0];
        wheels[2 * p + 1] = pairs[p].0[1];
    }
}
