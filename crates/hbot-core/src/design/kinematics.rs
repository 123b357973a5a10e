//! Contact frames and the no-slip kinematics at a posture (physics notes, sections 1 and 2; paper
//! eq. 1-13).
//!
//! The steer angles determine a [`Posture`]: the contact frame of each wheel and the rows of the
//! matrix G. From it follow the joint rates for a rate of the sphere (`inverse`), the rate of the
//! sphere and the slip for joint rates (`forward`), and the torque on the sphere for joint torques
//! (`torque_on_sphere`).

use crate::count::Count;
use crate::design::device::{Device, MAX_JOINTS, MAX_WHEELS, Wheel};
use crate::linear::Sym3;
use crate::real::{Real, Vec3, sincos};

/// A wheel's contact frame, expressed in frame N: the columns of C = A0 Rz(th) Rx(a) Rz(b).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactFrame {
    /// Direction of the wheel's axle, a unit vector.
    pub c1: Vec3,
    /// Rolling direction of the wheel, a unit vector.
    pub c2: Vec3,
    /// Outward normal of the sphere at the contact. The contact point is R c3, with the sphere's
    /// radius R.
    pub c3: Vec3,
}

impl ContactFrame {
    /// Returns the contact frame of `wheel` at the steer angle `th` (rad).
    #[inline(always)]
    #[must_use]
    pub fn at(wheel: &Wheel, th: Real) -> Self {
        let (sin, cos) = sincos(th);
        let column = |k: usize| wheel.p[k] * cos + wheel.q[k] * sin + wheel.s[k];
        Self { c1: column(0), c2: column(1), c3: column(2) }
    }
}

/// The contact frames of all wheels and the rows of the matrix G, for given steer angles. G maps
/// the sphere's angular velocity to joint rates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Posture {
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, MAX_WHEELS>"))]
    wheels: usize,
    frames: [ContactFrame; MAX_WHEELS],
    rows: [Vec3; MAX_JOINTS],
}

/// The motion of the sphere and the slip of the wheels, computed from joint rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forward {
    /// Angular velocity of the sphere in frame N, rad/s. If it was computed from changes of joint
    /// angles instead of rates, it is the turn in rad.
    pub omega: Vec3,
    /// Slip velocity of each wheel (wheel minus sphere) along its axes c1 and c2, m/s. It is the
    /// part of the wheels' motion that no angular velocity of the sphere can explain.
    pub slip: [[Real; 2]; MAX_WHEELS],
}

impl Posture {
    /// Computes the posture of `device` at the steer angles `th` (rad, one per wheel).
    #[inline]
    #[must_use]
    pub fn new(device: &Device, th: &[Real]) -> Self {
        let mut posture =
            Self { wheels: 0, frames: [ContactFrame::default(); MAX_WHEELS], rows: [Vec3::ZERO; MAX_JOINTS] };
        posture.update(device, th);
        posture
    }

    /// Updates the posture in place to the steer angles `th` (rad, one per wheel). Elements beyond
    /// the device's wheels are not cleared.
    #[inline]
    pub fn update(&mut self, device: &Device, th: &[Real]) {
        self.wheels = device.wheels().len();
        for (i, (wheel, th)) in device.wheels().iter().zip(th).enumerate() {
            self.steer(device, wheel, i, *th);
        }
    }

    /// Updates the posture in place to `angle`, the angles of all joints (rad), of which only those
    /// of the steer joints matter. Returns the motion of the sphere and the slip for the joint
    /// rates `zd` (rad/s), like [`forward`](Self::forward).
    ///
    /// It uses local copies of the contact frames, which the compiler holds in registers. To read
    /// the frames that have just been written would stop the processor for some nanoseconds.
    #[inline(always)]
    pub(crate) fn follow<C: Count>(
        &mut self,
        count: C,
        device: &Device,
        angle: &[Real; MAX_JOINTS],
        zd: &[Real; MAX_JOINTS],
    ) -> Forward {
        self.wheels = count.wheels();
        let mut frames = [ContactFrame::default(); MAX_WHEELS];
        for (i, wheel) in device.first(count).iter().enumerate() {
            frames[i] = self.steer(device, wheel, i, angle[2 * i]);
        }
        forward_at(device, device.first(count), &frames, zd)
    }

    /// Sets the steer angle of `wheel`, which has the index `i`, to `th` (rad). Returns its contact
    /// frame.
    #[inline(always)]
    fn steer(&mut self, device: &Device, wheel: &Wheel, i: usize, th: Real) -> ContactFrame {
        let frame = ContactFrame::at(wheel, th);
        let [steer, drive] = rows_of(device, wheel, &frame);
        self.frames[i] = frame;
        self.rows[2 * i] = steer;
        self.rows[2 * i + 1] = drive;
        frame
    }

    /// Returns the contact frames of all wheels, in frame N.
    #[inline]
    #[must_use]
    pub fn frames(&self) -> &[ContactFrame] {
        &self.frames[..self.wheels]
    }

    /// Returns the contact frames of the first `count` wheels, in frame N.
    #[inline]
    pub(crate) fn first_frames<C: Count>(&self, count: C) -> &[ContactFrame] {
        &self.frames[..count.wheels()]
    }

    /// Returns the rows of the matrix G of the first `count` wheels, like [`rows`](Self::rows).
    #[inline]
    pub(crate) fn first_rows<C: Count>(&self, count: C) -> &[Vec3] {
        &self.rows[..count.joints()]
    }

    /// Returns the rows of the matrix G (2n x 3, dimensionless), in the order steer, drive of each
    /// wheel. The product G w gives the joint rates for the angular velocity w of the sphere.
    #[inline]
    #[must_use]
    pub fn rows(&self) -> &[Vec3] {
        &self.rows[..2 * self.wheels]
    }

    /// Returns the joint rates zd = G w (rad/s) at which the wheels roll without slip, if the
    /// sphere turns with the angular velocity `omega` (frame N, rad/s).
    #[must_use]
    pub fn inverse(&self, omega: Vec3) -> [Real; MAX_JOINTS] {
        let mut rates = [0.0; MAX_JOINTS];
        for (rate, row) in rates.iter_mut().zip(self.rows()) {
            *rate = row.dot(omega);
        }
        rates
    }

    /// Returns the torque on the sphere in frame N, in N m, that the joint torques `tau` (N m)
    /// make: T = Gᵀ tau. Power is conserved: T.w = tau.zd.
    #[inline]
    #[must_use]
    pub fn torque_on_sphere(&self, tau: &[Real]) -> Vec3 {
        torque_of(self.rows(), tau)
    }

    /// Returns the angular velocity of the sphere that fits the joint rates `zd` (rad/s) best, and
    /// the slip that remains at each wheel. The best fit has the smallest sum of squared slip
    /// velocities.
    #[inline]
    #[must_use]
    pub fn forward(&self, device: &Device, zd: &[Real]) -> Forward {
        forward_at(device, device.wheels(), self.frames(), zd)
    }

    /// Returns the angular velocity of the sphere that [`forward`](Self::forward) returns, without
    /// the slip, for a device with `count` wheels.
    #[inline(always)]
    pub(crate) fn omega_of<C: Count>(&self, count: C, device: &Device, zd: &[Real]) -> Vec3 {
        omega_at(device, device.first(count), self.first_frames(count), zd)
    }
}

/// Implements [`Posture::forward`] for `wheels` with the contact frames `frames`.
#[inline(always)]
fn forward_at(device: &Device, wheels: &[Wheel], frames: &[ContactFrame], zd: &[Real]) -> Forward {
    let omega = omega_at(device, wheels, frames, zd);
    let mut slip = [[0.0; 2]; MAX_WHEELS];
    for (i, (wheel, frame)) in wheels.iter().zip(frames).enumerate() {
        let [u, v] = wheel_velocity(device, wheel, zd[2 * i], zd[2 * i + 1]);
        let r = device.sphere_radius();
        slip[i] = [u - r * frame.c2.dot(omega), v + r * frame.c1.dot(omega)];
    }
    Forward { omega, slip }
}

/// Implements [`forward`] for `wheels` with the contact frames `frames`.
#[inline(always)]
fn omega_at(device: &Device, wheels: &[Wheel], frames: &[ContactFrame], zd: &[Real]) -> Vec3 {
    let mut fit = Fit::EMPTY;
    for (i, (wheel, frame)) in wheels.iter().zip(frames).enumerate() {
        fit.add(device, wheel, frame, [zd[2 * i], zd[2 * i + 1]]);
    }
    fit.omega(device)
}

/// Returns the torque on the sphere that the joint torques `tau` make, for the given `rows` of G.
#[inline]
pub(crate) fn torque_of(rows: &[Vec3], tau: &[Real]) -> Vec3 {
    let mut torque = Vec3::ZERO;
    for (row, tau) in rows.iter().zip(tau) {
        torque += *row * *tau;
    }
    torque
}

/// Returns the two rows of G that belong to one wheel, steer then drive: g_th = c2 / (l.c2) and
/// g_ph = (R/r) ((l.c1) g_th - c1).
#[inline]
fn rows_of(device: &Device, wheel: &Wheel, frame: &ContactFrame) -> [Vec3; 2] {
    let steer = frame.c2 / wheel.axis_c2;
    let drive = (steer * wheel.axis_c1 - frame.c1) * (device.sphere_radius() / wheel.spec().radius);
    [steer, drive]
}

/// Returns the velocity of a wheel's surface at the contact, along c1 and c2, m/s: H zd. `steer`
/// and `drive` are the rates of the wheel's joints, rad/s.
#[inline]
pub(crate) fn wheel_velocity(device: &Device, wheel: &Wheel, steer: Real, drive: Real) -> [Real; 2] {
    let r = device.sphere_radius();
    [r * wheel.axis_c2 * steer, wheel.spec().radius * drive - r * wheel.axis_c1 * steer]
}

/// Returns the angular velocity of the sphere (frame N, rad/s) that fits the joint rates `zd` best:
/// w = -(ZᵀZ)⁻¹ Zᵀ H zd.
///
/// `frames` are the contact frames, one per wheel. `zd` are joint rates (rad/s), in the order
/// steer, drive of each wheel. The result is linear in `zd`: from changes of joint angles in rad it
/// gives the turn of the sphere in rad.
#[inline]
#[must_use]
pub fn forward(device: &Device, frames: &[ContactFrame], zd: &[Real]) -> Vec3 {
    omega_at(device, device.wheels(), frames, zd)
}

/// The sums over the wheels from which the angular velocity of the sphere follows: both sides of
/// the normal equations of [`forward`], divided by powers of the sphere's radius. Wheels are added
/// one by one, so that no array of contact frames is needed.
pub(crate) struct Fit {
    b: Vec3,
    planes: Sym3,
}

impl Fit {
    /// The sums over no wheels.
    pub(crate) const EMPTY: Self = Self { b: Vec3::ZERO, planes: Sym3::ZERO };

    /// Adds `wheel` with the contact frame `frame` and the `rates` of its steer and drive joint,
    /// rad/s.
    #[inline(always)]
    pub(crate) fn add(&mut self, device: &Device, wheel: &Wheel, frame: &ContactFrame, rates: [Real; 2]) {
        let [u, v] = wheel_velocity(device, wheel, rates[0], rates[1]);
        self.b += frame.c2 * u - frame.c1 * v;
        self.planes.add_plane(frame.c3);
    }

    /// Returns the angular velocity of the sphere in frame N that fits the rates of the wheels
    /// best, rad/s.
    #[inline(always)]
    pub(crate) fn omega(&self, device: &Device) -> Vec3 {
        self.planes.adjugate().solve_by_division(self.b) / device.sphere_radius()
    }
}
