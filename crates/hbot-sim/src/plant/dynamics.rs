//! Which plant: chosen by the phenomena that are asked for.

use hbot_core::Vec3;
use hbot_core::device::{Device, MAX_JOINTS, MAX_WHEELS};

use super::nonsmooth::{Effort, Nonsmooth};
use super::{ImpossibleInertia, JointTorques, Method, Plant, PlantState, Sum};
use crate::hand::Grip;
use crate::phenomena::Phenomena;

/// A plant with the phenomena that were asked for: three speeds and a [`Method`] of its order where nothing sticks, slips
/// or has play; else speeds that set-valued laws act on, by time stepping of order 1 (`docs/simulator.md`).
#[derive(Debug, Clone)]
pub struct Dynamics {
    device: Device,
    method: Method,
    kind: Kind,
}

// The ideal plant is the one whose steps count: no pointer on its way.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone)]
enum Kind {
    Smooth(Box<Plant>),
    Nonsmooth(Box<Nonsmooth>),
}

impl Dynamics {
    /// The plant of `device` with what `phenomena` name of it, at `state`; `method` is for the smooth one. A hand in
    /// `phenomena` is not held yet: its inertia is added by [`Dynamics::set_sphere_inertia`].
    ///
    /// # Errors
    /// Where the inertias of a wheel contradict each other.
    pub fn new(
        device: &Device,
        phenomena: &Phenomena,
        method: Method,
        state: &PlantState,
    ) -> Result<Self, ImpossibleInertia> {
        let kind = Kind::new(Plant::with(device, phenomena)?, device, phenomena, state);
        Ok(Self { device: *device, method, kind })
    }

    /// Has all phenomena of the plant replaced, at `state`; the inertia of what is held to the sphere stays.
    pub fn set_phenomena(&mut self, phenomena: &Phenomena, state: &PlantState) {
        let inertia = self.sphere_inertia();
        // Of a device that has a plant there is one with any phenomena.
        if let Ok(plant) = Plant::with(&self.device, phenomena) {
            self.kind = Kind::new(plant, &self.device, phenomena, state);
            self.set_sphere_inertia(inertia);
        }
    }

    /// Whether set-valued laws are at work.
    #[must_use]
    pub fn is_nonsmooth(&self) -> bool {
        matches!(self.kind, Kind::Nonsmooth(_))
    }

    /// The inertia of the sphere and of what is held to it, about any axis, kg m²; the wheels' is not in it.
    #[must_use]
    pub fn sphere_inertia(&self) -> f64 {
        match &self.kind {
            Kind::Smooth(plant) => plant.sphere_inertia(),
            Kind::Nonsmooth(plant) => plant.sphere_inertia(),
        }
    }

    /// Sets the inertia of the sphere and of what is held to it, kg m² (positive).
    pub fn set_sphere_inertia(&mut self, inertia: f64) {
        match &mut self.kind {
            Kind::Smooth(plant) => plant.set_sphere_inertia(inertia),
            Kind::Nonsmooth(plant) => plant.set_sphere_inertia(inertia),
        }
    }

    /// Holds the sphere so that it turns about the unit vector `axis` (in N) alone, as on a test bench, or lets it go. What it
    /// turned about others is lost. Of a smooth plant nothing can be held: false then.
    pub fn set_hinge(&mut self, axis: Option<Vec3>) -> bool {
        match &mut self.kind {
            Kind::Smooth(_) => axis.is_none(),
            Kind::Nonsmooth(plant) => {
                plant.set_hinge(axis);
                true
            }
        }
    }

    /// Takes over a `state` that something else has made: wheels roll without slip, motors stand in the middle of
    /// their play, and nothing is held by friction yet.
    pub fn adopt(&mut self, state: &PlantState) {
        if let Kind::Nonsmooth(plant) = &mut self.kind {
            plant.adopt(state);
        }
    }

    /// Moves `state` on by `h` seconds from the time `t` (s): joint torques `tau` held (at the motor's side of a gear),
    /// the torque `external` on the sphere (N, N m), and perhaps a hand.
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
        match (&mut self.kind, grip) {
            (Kind::Smooth(plant), None) => plant.step(self.method, state, t, h, tau, &external),
            (Kind::Smooth(plant), Some(grip)) => {
                plant.step(self.method, state, t, h, tau, &Sum(*grip, external));
            }
            (Kind::Nonsmooth(plant), grip) => plant.step(state, t + h, h, tau, external, grip),
        }
    }

    /// What the encoders sit on: joint angles in the order steer, drive of each wheel, at the motor's side of a gear, rad.
    #[must_use]
    pub fn encoder_angles(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        match &self.kind {
            Kind::Smooth(_) => state.joints(),
            Kind::Nonsmooth(plant) => plant.encoder_angles(state),
        }
    }

    /// Rates of what the encoders sit on, rad/s.
    #[must_use]
    pub fn encoder_rates(&self, state: &PlantState) -> [f64; MAX_JOINTS] {
        match &self.kind {
            Kind::Smooth(plant) => plant.joint_rates(state),
            Kind::Nonsmooth(plant) => plant.encoder_rates(),
        }
    }

    /// Slip velocity of each wheel along its c1 and c2, wheel minus sphere, m/s; zero where nothing slips.
    #[must_use]
    pub fn slip(&self, state: &PlantState) -> [[f64; 2]; MAX_WHEELS] {
        match &self.kind {
            Kind::Smooth(_) => [[0.0; 2]; MAX_WHEELS],
            Kind::Nonsmooth(plant) => plant.slip(state),
        }
    }

    /// Kinetic energy and that of weights out of place, J; that of a hand's spring is not in it.
    #[must_use]
    pub fn energy(&self, state: &PlantState) -> f64 {
        match &self.kind {
            Kind::Smooth(plant) => plant.energy(state),
            Kind::Nonsmooth(plant) => plant.energy(state),
        }
    }

    /// How much work the last step was; `None` where every step is the same.
    #[must_use]
    pub fn effort(&self) -> Option<Effort> {
        match &self.kind {
            Kind::Smooth(_) => None,
            Kind::Nonsmooth(plant) => Some(plant.effort()),
        }
    }
}

impl Kind {
    fn new(plant: Plant, device: &Device, phenomena: &Phenomena, state: &PlantState) -> Self {
        if is_nonsmooth(phenomena) {
            Self::Nonsmooth(Box::new(Nonsmooth::new(device, *phenomena, state)))
        } else {
            Self::Smooth(Box::new(plant))
        }
    }
}

/// Whether something sticks, slips or has play.
fn is_nonsmooth(phenomena: &Phenomena) -> bool {
    let dry =
        phenomena.joint_friction.is_some_and(|friction| friction.coulomb > 0.0 || friction.breakaway > 0.0);
    dry || phenomena.cage_friction.is_some()
        || phenomena.slip.is_some()
        || phenomena.pivoting.is_some()
        || phenomena.gear.is_some()
}
