//! The sphere on wheels that do not slip (physics notes, section 5).
//!
//! A [`Plant`] holds the constants of a device, a [`PlantState`] is where it is and how fast it turns, a [`Load`] is what
//! acts on the sphere besides the wheels. [`Plant::step`] moves a state on by one fixed step of a [`Method`];
//! [`Plant::advance_exactly`] is the adaptive reference that the methods are held against.
//!
//! Steps allocate nothing, call no function of the platform, and fuse no operations: the same bits on every machine.

mod dynamics;
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

use hbot_core::device::{Device, MAX_JOINTS, MAX_WHEELS};
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

/// Torques at the joints in the order steer, drive of each wheel, N m; entries past the device's joints have no
/// effect as long as they are finite.
pub type JointTorques = [f64; MAX_JOINTS];

/// The constants of a device that moves without slip.
#[derive(Debug, Clone)]
pub struct Plant {
    model: Model,
    wheels: usize,
    extras: Option<Box<Extras>>,
}

/// Where the plant is and how fast it turns. The joints' rates follow from `omega` and the steering angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantState {
    /// Orientation of the sphere, sphere axes to N, unit.
    pub q: Quat,
    /// Angular velocity of the sphere in N, rad/s.
    pub omega: Vec3,
    /// Steering angle th of each wheel, rad, never reduced; entries past the device's wheels stay as they are.
    pub steer: [f64; MAX_WHEELS],
    /// Drive angle ph of each wheel, rad, never reduced; likewise.
    pub drive: [f64; MAX_WHEELS],
}

impl Default for PlantState {
    /// At rest, unturned, all joints at zero.
    fn default() -> Self {
        Self { q: Quat::IDENTITY, omega: Vec3::ZERO, steer: [0.0; MAX_WHEELS], drive: [0.0; MAX_WHEELS] }
    }
}

impl PlantState {
    /// Joint angles in the order steer, drive of each wheel, rad.
    #[must_use]
    pub fn joints(&self) -> [f64; MAX_JOINTS] {
        core::array::from_fn(|j| if j % 2 == 0 { self.steer[j / 2] } else { self.drive[j / 2] })
    }
}

/// A wheel whose inertias no wheel can have: J_c = I_axial sin a sin b with J_c² > J_th J_ph, so that some motion of
/// its joints would have negative energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImpossibleInertia {
    /// Which wheel, counted from 0.
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

/// Runs an expression with `P`, a number of pairs that holds all wheels, as a constant. Three pairs run as four: not
/// worth code of their own.
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

/// Runs an expression with `field`, the plant as it is under joint torques and a load: the ideal one, or the one with
/// extras.
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
    /// The plant of `device`.
    ///
    /// # Errors
    /// Where the inertias of a wheel contradict each other.
    pub fn new(device: &Device) -> Result<Self, ImpossibleInertia> {
        Self::with(device, &Phenomena::default())
    }

    /// The plant of `device` with those `phenomena` that leave it smooth: a sphere out of centre, the weight of the wheels'
    /// modules, and the viscous part of joint friction. Of the others it knows nothing.
    ///
    /// # Errors
    /// Where the inertias of a wheel contradict each other.
    pub fn with(device: &Device, phenomena: &Phenomena) -> Result<Self, ImpossibleInertia> {
        let model = Model::new(device).map_err(|wheel| ImpossibleInertia { wheel })?;
        let extras = Extras::new(device, phenomena).map(Box::new);
        Ok(Self { model, wheels: device.wheels().len(), extras })
    }

    /// How many wheels.
    #[must_use]
    pub fn wheels(&self) -> usize {
        self.wheels
    }

    /// The inertia of the sphere and of what is held to it, about any axis, kg m²; the wheels' is not in it.
    #[must_use]
    pub fn sphere_inertia(&self) -> f64 {
        self.model.inertia
    }

    /// Sets the inertia of the sphere and of what is held to it, kg m² (positive): a hand that takes hold adds to it.
    pub fn set_sphere_inertia(&mut self, inertia: f64) {
        self.model.inertia = inertia;
    }

    /// dw/dt in N, rad/s², under the torque `external` on the sphere (in N, N m) and the joint torques `tau`.
    #[must_use]
    pub fn acceleration(&self, state: &PlantState, external: Vec3, tau: &JointTorques) -> Vec3 {
        with_field!(self, tau, &external, P, field => {
            let geometry = Field::<P>::geometry(&field, state.q, &gather(&state.steer));
            Field::<P>::flow(&field, &geometry, &(), state.q, state.omega).acceleration
        })
    }

    /// Joint rates in the order steer, drive of each wheel, rad/s: zd = G w.
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

    /// Kinetic energy 1/2 wᵀ (I_s I + Gᵀ J_q G) w and that of weights out of place, J; constant where no torque acts.
    #[must_use]
    pub fn energy(&self, state: &PlantState) -> f64 {
        let kinetic = 0.5 * state.omega.dot(self.apparent_inertia(state) * state.omega);
        kinetic + self.extras.as_ref().map_or(0.0, |extras| extras.energy(state.q, &state.steer))
    }

    /// The apparent inertia I_s I + Gᵀ J_q G of the turning sphere in N, kg m².
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

    /// Moves `state` on by one step of `h` seconds from the time `t` (s), with the joint torques `tau` held and
    /// `load` acting on the sphere.
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

/// One number a wheel, as pairs.
#[inline(always)]
fn gather<const P: usize>(wheels: &[f64; MAX_WHEELS]) -> [Pair; P] {
    core::array::from_fn(|p| Pair([wheels[2 * p], wheels[2 * p + 1]]))
}

/// Pairs, as one number a wheel. The lane of a wheel that does not exist is written too: its rate is zero.
#[inline(always)]
fn scatter<const P: usize>(pairs: &[Pair; P], wheels: &mut [f64; MAX_WHEELS]) {
    for p in 0..P {
        wheels[2 * p] = pairs[p].0[0];
        wheels[2 * p + 1] = pairs[p].0[1];
    }
}
