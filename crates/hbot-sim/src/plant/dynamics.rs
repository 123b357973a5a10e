//! Chooses the plant that the requested phenomena need: smooth or nonsmooth. Steps for which the
//! smooth plant is too stiff are made by the nonsmooth one, which is stable at any step.

use hbot_core::Vec3;
use hbot_core::design::device::{Device, MAX_JOINTS, MAX_WHEELS};

use super::fastest::FastestRate;
use super::nonsmooth::{Effort, Nonsmooth};
use super::{Frictions, ImpossibleInertia, JointTorques, Method, Plant, PlantState, Sum};
use crate::hand::Grip;
use crate::phenomena::Phenomena;

/// Longest step of the implicit scheme if it steps a smooth plant that is too stiff, s. It is the
/// longest step of a nonsmooth plant in a simulated rig too.
const IMPLICIT_STEP_S: f64 = 250.0e-6;

/// The mechanics of a rig with the requested phenomena.
///
/// If nothing sticks, slips or has play, the plant is smooth: all its speeds follow from the
/// sphere's angular velocity, and it is integrated by a [`Method`]. Otherwise friction, contacts
/// and play follow set-valued laws, and a time-stepping scheme of order 1 is used
/// (`docs/internals/plant.md`). The scheme is implicit. So it also makes those steps of a smooth
/// plant that would be too long for an explicit method, for example if a strong damping acts on a
/// light sphere.
#[derive(Debug, Clone)]
pub struct Dynamics {
    device: Device,
    method: Method,
    /// Friction that is added to that of the phenomena.
    frictions: Option<Frictions>,
    kind: Kind,
}

// Both variants are boxed, so both have the size of a pointer.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone)]
enum Kind {
    Smooth(Box<Smooth>),
    Nonsmooth(Box<Nonsmooth>),
}

/// A smooth plant, with the same plant for the steps in which it is too stiff for an explicit
/// method.
#[derive(Debug, Clone)]
struct Smooth {
    plant: Plant,
    method: Method,
    fastest: FastestRate,
    implicit: Nonsmooth,
}

impl Dynamics {
    /// Creates the plant of `device` at `state`, with those of `phenomena` that act in the plant.
    /// `method` is used if the plant is smooth.
    ///
    /// A hand in `phenomena` is ignored. Add its inertia with [`Dynamics::set_sphere_inertia`].
    ///
    /// # Errors
    ///
    /// Fails if the inertias of a wheel are physically impossible (see [`ImpossibleInertia`]).
    pub fn new(
        device: &Device,
        phenomena: &Phenomena,
        method: Method,
        state: &PlantState,
    ) -> Result<Self, ImpossibleInertia> {
        Self::rubbing(device, phenomena, None, method, state)
    }

    /// Creates the plant of `device` as [`Dynamics::new`] does, with the friction `frictions` in
    /// addition to that of `phenomena`. It stays when phenomena are replaced.
    ///
    /// # Errors
    ///
    /// Fails if the inertias of a wheel are physically impossible (see [`ImpossibleInertia`]).
    pub fn rubbing(
        device: &Device,
        phenomena: &Phenomena,
        frictions: Option<Frictions>,
        method: Method,
        state: &PlantState,
    ) -> Result<Self, ImpossibleInertia> {
        let plant = Plant::with(device, phenomena)?;
        let kind = Kind::new(plant, method, device, phenomena, frictions, state);
        Ok(Self { device: *device, method, frictions, kind })
    }

    /// Replaces all phenomena of the plant, which is now at `state`. The inertia of sphere and hand
    /// is kept.
    pub fn set_phenomena(&mut self, phenomena: &Phenomena, state: &PlantState) {
        let inertia = self.sphere_inertia();
        // This cannot fail: the device's inertias were checked when the plant was created.
        if let Ok(plant) = Plant::with(&self.device, phenomena) {
            self.kind = Kind::new(plant, self.method, &self.device, phenomena, self.frictions, state);
            self.set_sphere_inertia(inertia);
        }
    }

    /// Returns whether the plant is nonsmooth, which means that something in it sticks, slips or
    /// has play.
    #[must_use]
    pub fn is_nonsmooth(&self) -> bool {
        matches!(self.kind, Kind::Nonsmooth(_))
    }

    /// Returns the inertia of the sphere and of anything attached to it, such as a hand, in kg m².
    /// It is equal about all axes. The wheels' inertia is not included.
    #[must_use]
    pub fn sphere_inertia(&self) -> f64 {
        match &self.kind {
            Kind::Smooth(smooth) => smooth.plant.sphere_inertia(),
            Kind::Nonsmooth(plant) => plant.sphere_inertia(),
        }
    }

    /// Sets the inertia of the sphere and of anything attached to it, such as a hand, in kg m². It
    /// must be positive.
    pub fn set_sphere_inertia(&mut self, inertia: f64) {
        match &mut self.kind {
            Kind::Smooth(smooth) => {
                smooth.plant.set_sphere_inertia(inertia);
                smooth.implicit.set_sphere_inertia(inertia);
                smooth.fastest.set_inertia(inertia);
            }
            Kind::Nonsmooth(plant) => plant.set_sphere_inertia(inertia),
        }
    }

    /// Restricts the sphere to turn only about the unit vector `axis` (frame N), as on a test
    /// bench. `None` lets it turn freely again.
    ///
    /// Any angular velocity about other axes is lost. Returns false if `axis` is given and the
    /// plant is smooth, because a smooth plant cannot be restricted.
    pub fn set_hinge(&mut self, axis: Option<Vec3>) -> bool {
        match &mut self.kind {
            Kind::Smooth(_) => axis.is_none(),
            Kind::Nonsmooth(plant) => {
                plant.set_hinge(axis);
                true
            }
        }
    }

    /// Tells the plant that `state` was changed from outside.
    ///
    /// Joint rates are set to those of rolling without slip, motors to the middle of their gears'
    /// play, and all stored friction impulses are cleared.
    pub fn adopt(&mut self, state: &PlantState) {
        if let Kind::Nonsmooth(plant) = &mut self.kind {
            plant.adopt(state);
        }
    }

    /// Advances `state` by `h` seconds from time `t` (s).
    ///
    /// Three torques act on the plant: the joint torques `tau` (on the motor's side of a gear), the
    /// torque `external` on the sphere (frame N, N m), and the torque of the hand, if `grip` is
    /// given.
    #[inline]
    pub fn step(
        &mut self,
        state: &mut PlantState,
        t: f64,
        h: f64,
        tau: &JointTorques,
        external: Vec3,
        grip: Option<&Grip>,
    ) {
        match &mut self.kind {
            Kind::Smooth(smooth) => smooth.step(state, t, h, tau, external, grip),
            Kind::Nonsmooth(plant) => plant.step(state, t + h, h, tau, external, grip),
        }
    }

    /// Returns the angles that the encoders measure, rad, in the order steer, drive of each wheel.
    /// If gears have play, the drive angles are those of the motors.
    #[must_use]
    pub fn encoder_angles(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        match &self.kind {
            Kind::Smooth(_) => state.joints(),
            Kind::Nonsmooth(plant) => plant.encoder_angles(state),
        }
    }

    /// Returns the rates that the encoders measure, rad/s, in the order steer, drive of each wheel.
    #[must_use]
    pub fn encoder_rates(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        match &self.kind {
            Kind::Smooth(smooth) => smooth.plant.joint_rates(state),
            Kind::Nonsmooth(plant) => plant.encoder_rates(),
        }
    }

    /// Returns the slip velocity of each wheel along its axle (c1) and its rolling direction (c2),
    /// wheel minus sphere, m/s. It is zero if the plant is smooth.
    #[must_use]
    pub fn slip(&self, state: &PlantState) -> [[f64; 2]; MAX_WHEELS] {
        match &self.kind {
            Kind::Smooth(_) => [[0.0; 2]; MAX_WHEELS],
            Kind::Nonsmooth(plant) => plant.slip(state),
        }
    }

    /// Returns the kinetic energy plus the potential energy of off-centre masses, J. The energy of
    /// a hand's spring is not included.
    #[must_use]
    pub fn energy(&self, state: &PlantState) -> f64 {
        match &self.kind {
            Kind::Smooth(smooth) => smooth.plant.energy(state),
            Kind::Nonsmooth(plant) => plant.energy(state),
        }
    }

    /// Returns how many iterations the solver needed in the last step, or `None` if the plant is
    /// smooth and has no solver.
    #[must_use]
    pub fn effort(&self) -> Option<Effort> {
        match &self.kind {
            Kind::Smooth(_) => None,
            Kind::Nonsmooth(plant) => Some(plant.effort()),
        }
    }
}

impl Kind {
    fn new(
        plant: Plant,
        method: Method,
        device: &Device,
        phenomena: &Phenomena,
        frictions: Option<Frictions>,
        state: &PlantState,
    ) -> Self {
        let nonsmooth = Nonsmooth::new(device, *phenomena, frictions, state);
        if is_nonsmooth(phenomena) || frictions.is_some() {
            Self::Nonsmooth(Box::new(nonsmooth))
        } else {
            let fastest = FastestRate::new(device, phenomena, plant.sphere_inertia());
            Self::Smooth(Box::new(Smooth { plant, method, fastest, implicit: nonsmooth }))
        }
    }
}

impl Smooth {
    /// Advances `state` by `h` seconds from time `t` (s), as [`Dynamics::step`] does.
    #[inline]
    fn step(
        &mut self,
        state: &mut PlantState,
        t: f64,
        h: f64,
        tau: &JointTorques,
        external: Vec3,
        grip: Option<&Grip>,
    ) {
        let (speed2, inertia) = (state.omega.length_squared(), self.plant.sphere_inertia());
        if !self.fastest.allows(h, speed2, grip, inertia) {
            self.step_implicitly(state, t, h, tau, external, grip);
        } else if let Some(grip) = grip {
            self.plant.step(self.method, state, t, h, tau, &Sum(*grip, external));
        } else {
            self.plant.step(self.method, state, t, h, tau, &external);
        }
    }

    /// Advances `state` as [`step`](Self::step) does, by the implicit scheme.
    #[cold]
    #[inline(never)]
    fn step_implicitly(
        &mut self,
        state: &mut PlantState,
        t: f64,
        h: f64,
        tau: &JointTorques,
        external: Vec3,
        grip: Option<&Grip>,
    ) {
        self.implicit.adopt(state);
        let steps = libm::ceil(h / IMPLICIT_STEP_S).max(1.0);
        let part = h / steps;
        for i in 1..=steps as u32 {
            self.implicit.step(state, t + f64::from(i) * part, part, tau, external, grip);
        }
    }
}

/// Returns whether `phenomena` contain one that makes something stick, slip or have play. The plant
/// is then nonsmooth.
fn is_nonsmooth(phenomena: &Phenomena) -> bool {
    let dry =
        phenomena.joint_friction.is_some_and(|friction| friction.coulomb > 0.0 || friction.breakaway > 0.0);
    dry || phenomena.cage_friction.is_some()
        || phenomena.slip.is_some()
        || phenomena.pivoting.is_some()
        || phenomena.gear.is_some()
        || phenomena.compliance.is_some()
}
