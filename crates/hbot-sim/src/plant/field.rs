//! The interface between the integration methods and the plant: accelerations and rates at a state.
//!
//! There are two fields: the ideal plant, and the plant with off-centre masses or viscous joints.
//! The compiler builds each method separately for each field, so the ideal plant does not pay for
//! the extras.

use hbot_core::design::device::{Device, MAX_WHEELS};
use hbot_core::design::kinematics::ContactFrame;
use hbot_core::{Quat, Vec3};

use super::JointTorques;
use super::load::Load;
use super::model::{Flow, Model, Push, Rows, Symmetric};
use super::pair::Pair;
use super::weights::{Module, Weight};
use crate::phenomena::Phenomena;

/// The accelerations and rates of a plant, as an integration method needs them. `P` is the number
/// of wheel pairs.
pub(super) trait Field<const P: usize> {
    /// Quantities that depend on time alone, such as the target of a hand. They are computed once
    /// for each time of a step.
    type Instant;
    /// Quantities that depend on the orientation and the steer angles alone, such as the directions
    /// at the contacts.
    type Geometry;

    /// Returns the quantities that depend on time alone, at time `t`, s.
    fn at(&self, t: f64) -> Self::Instant;
    /// Returns the geometrical quantities at the orientation `q` and the steer angles `steer`, rad.
    fn geometry(&self, q: Quat, steer: &[Pair; P]) -> Self::Geometry;
    /// Returns the accelerations and joint rates for the geometry `at`, the time-dependent
    /// quantities `now`, the orientation `q` and the angular velocity `omega`.
    fn flow(&self, at: &Self::Geometry, now: &Self::Instant, q: Quat, omega: Vec3) -> Flow<P>;
    /// Returns the steer rates and the drive rates while the sphere turns at the angular velocity
    /// `omega`, rad/s.
    fn rates(&self, at: &Self::Geometry, omega: Vec3) -> ([Pair; P], [Pair; P]);
}

/// The ideal plant, without phenomena, under joint torques and a load on the sphere.
pub(super) struct Ideal<'a, const P: usize, L> {
    pub(super) model: &'a Model,
    pub(super) push: Push<P>,
    pub(super) load: &'a L,
}

impl<const P: usize, L: Load> Field<P> for Ideal<'_, P, L> {
    type Instant = L::Instant;
    type Geometry = Rows<P>;

    #[inline(always)]
    fn at(&self, t: f64) -> L::Instant {
        self.load.at(t)
    }

    #[inline(always)]
    fn geometry(&self, _: Quat, steer: &[Pair; P]) -> Rows<P> {
        self.model.rows(steer)
    }

    #[inline(always)]
    fn flow(&self, rows: &Rows<P>, now: &L::Instant, q: Quat, omega: Vec3) -> Flow<P> {
        self.model.flow(rows, omega, &self.push, self.load.torque(now, q, omega))
    }

    #[inline(always)]
    fn rates(&self, rows: &Rows<P>, omega: Vec3) -> ([Pair; P], [Pair; P]) {
        self.model.rates(rows, omega)
    }
}

/// The phenomena that make a plant no longer ideal but keep it smooth: off-centre masses and
/// viscous joint friction.
#[derive(Debug, Clone)]
pub(super) struct Extras {
    device: Device,
    offset: Vec3,
    weight: Option<Weight>,
    modules: Option<[Module; MAX_WHEELS]>,
    /// Viscous friction coefficient of each joint, N m s/rad.
    viscous: f64,
}

impl Extras {
    /// Returns the smooth phenomena that `phenomena` ask for, or `None` if there are none.
    pub(super) fn new(device: &Device, phenomena: &Phenomena) -> Option<Self> {
        let viscous = phenomena.joint_friction.map_or(0.0, |friction| friction.viscous);
        let weight = Weight::of(device, phenomena);
        if weight.is_none() && phenomena.wheel_modules.is_none() && viscous == 0.0 {
            return None;
        }
        let offset = phenomena.eccentric.map_or(Vec3::ZERO, |eccentric| Vec3::from_array(eccentric.offset));
        Some(Self {
            device: *device,
            offset,
            weight,
            modules: phenomena.wheel_modules.map(|modules| Module::all(device, modules.mass)),
            viscous,
        })
    }

    /// Returns the potential energy of the off-centre masses, up to a constant, J. `steer` are the
    /// steer angles, rad.
    pub(super) fn energy(&self, q: Quat, steer: &[f64; MAX_WHEELS]) -> f64 {
        let modules =
            self.modules.iter().flatten().zip(steer).map(|(module, th)| module.energy(*th)).sum::<f64>();
        modules + self.weight.map_or(0.0, |weight| weight.energy(q))
    }
}

/// A plant with off-centre masses or viscous joints, under joint torques and a load on the sphere.
pub(super) struct Loaded<'a, L> {
    pub(super) inertia: f64,
    pub(super) extras: &'a Extras,
    pub(super) tau: &'a JointTorques,
    pub(super) load: &'a L,
}

/// The directions and distances at the contact of one wheel with the sphere.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Contact {
    th: f64,
    normal: Vec3,
    steer: Vec3,
    /// The drive joint's row of the matrix G (from the sphere's angular velocity to joint rates),
    /// divided by `ratio`: (l.c1) g_th - c1.
    per_radius: Vec3,
    /// Distance of the contact from the centre O of rotation, divided by the wheel's radius.
    ratio: f64,
}

impl Contact {
    fn drive(&self) -> Vec3 {
        self.per_radius * self.ratio
    }
}

impl<L> Loaded<'_, L> {
    pub(super) fn contacts<const P: usize>(&self, q: Quat, steer: &[Pair; P]) -> [Contact; MAX_WHEELS] {
        let mut contacts = [Contact::default(); MAX_WHEELS];
        let offset = q * self.extras.offset;
        for (i, wheel) in self.extras.device.wheels().iter().enumerate() {
            let th = steer[i / 2].0[i % 2];
            let frame = ContactFrame::at(wheel, th);
            let row = frame.c2 / wheel.axis_along_roll();
            contacts[i] = Contact {
                th,
                normal: frame.c3,
                steer: row,
                per_radius: row * wheel.axis_along_axle() - frame.c1,
                ratio: (self.extras.device.sphere_radius() + offset.dot(frame.c3)) / wheel.spec().radius,
            };
        }
        contacts
    }

    /// Returns the apparent inertia of the sphere in frame N, kg m². It includes the inertia of the
    /// wheels, which turn with the sphere.
    pub(super) fn apparent(&self, contacts: &[Contact; MAX_WHEELS]) -> Symmetric {
        let i = self.inertia;
        let mut m = Symmetric { xx: i, yy: i, zz: i, xy: 0.0, xz: 0.0, yz: 0.0 };
        for (wheel, at) in self.extras.device.wheels().iter().zip(contacts) {
            let spec = wheel.spec();
            let coupling = spec.axial_inertia * wheel.axis_along_axle();
            let (steer, drive) = (at.steer, at.drive());
            // Gᵀ J G as steer row x its momentum + drive row x its momentum.
            let (of_steer, of_drive) = (
                steer * spec.steer_inertia + drive * coupling,
                steer * coupling + drive * spec.drive_inertia,
            );
            m.xx += steer.x * of_steer.x + drive.x * of_drive.x;
            m.yy += steer.y * of_steer.y + drive.y * of_drive.y;
            m.zz += steer.z * of_steer.z + drive.z * of_drive.z;
            m.xy += steer.x * of_steer.y + drive.x * of_drive.y;
            m.xz += steer.x * of_steer.z + drive.x * of_drive.z;
            m.yz += steer.y * of_steer.z + drive.y * of_drive.z;
        }
        m
    }
}

impl<const P: usize, L: Load> Field<P> for Loaded<'_, L> {
    type Instant = L::Instant;
    type Geometry = [Contact; MAX_WHEELS];

    fn at(&self, t: f64) -> L::Instant {
        self.load.at(t)
    }

    fn geometry(&self, q: Quat, steer: &[Pair; P]) -> [Contact; MAX_WHEELS] {
        self.contacts(q, steer)
    }

    /// Computes the accelerations by the equations of the physics notes, section 5. If the sphere
    /// is off centre, the drive's row of G also changes with the distance of the contact from O.
    fn flow(&self, contacts: &[Contact; MAX_WHEELS], now: &L::Instant, q: Quat, omega: Vec3) -> Flow<P> {
        let (mut steer_rates, mut drive_rates) = ([Pair::ZERO; P], [Pair::ZERO; P]);
        let offset = q * self.extras.offset;
        let mut b = self.load.torque(now, q, omega);
        if let Some(weight) = &self.extras.weight {
            b += weight.torque(q);
        }
        for (i, wheel) in self.extras.device.wheels().iter().enumerate() {
            let (at, spec, axis) = (&contacts[i], wheel.spec(), wheel.spec().axis);
            let (steer, drive) = (at.steer.dot(omega), at.drive().dot(omega));
            let away = omega.cross(offset).dot(at.normal) + offset.dot(axis.cross(at.normal)) * steer;
            // (dG/dt) w of the steer row and the drive row.
            let steer_bend = steer * axis.cross(at.steer).dot(omega);
            let drive_bend = steer * at.ratio * axis.cross(at.per_radius).dot(omega)
                + away / spec.radius * at.per_radius.dot(omega);
            let coupling = spec.axial_inertia * wheel.axis_along_axle();
            let mut steer_torque = self.tau[2 * i] - self.extras.viscous * steer;
            if let Some(modules) = &self.extras.modules {
                steer_torque += modules[i].torque(at.th);
            }
            let drive_torque = self.tau[2 * i + 1] - self.extras.viscous * drive;
            b += at.steer * (steer_torque - spec.steer_inertia * steer_bend - coupling * drive_bend);
            b += at.drive() * (drive_torque - coupling * steer_bend - spec.drive_inertia * drive_bend);
            steer_rates[i / 2].0[i % 2] = steer;
            drive_rates[i / 2].0[i % 2] = drive;
        }
        Flow { acceleration: self.apparent(contacts).solve(b), steer: steer_rates, drive: drive_rates }
    }

    fn rates(&self, contacts: &[Contact; MAX_WHEELS], omega: Vec3) -> ([Pair; P], [Pair; P]) {
        let (mut steer, mut drive) = ([Pair::ZERO; P], [Pair::ZERO; P]);
        for i in 0..self.extras.device.wheels().len() {
            steer[i / 2].0[i % 2] = contacts[i].steer.dot(omega);
            drive[i / 2].0[i % 2] = contacts[i].drive().dot(omega);
        }
        (steer, drive)
    }
}
