//! The plant's constants, and the accelerations that follow from them (physics notes, section 5).
//!
//! The equations are arranged for few operations. With l the steering axis of a wheel, g_th and
//! g_ph its rows of G, and J_th, J_ph and J_c its inertias, let x = g_th + (J_c / J_th) g_ph and
//! y = g_ph. Then
//!
//! - g_th is l plus a vector that turns about l with th, and g_ph turns about l with th. Six
//!   numbers times sine and cosine therefore give each row.
//! - Gᵀ J_q G is the sum of J_x x xᵀ + J_y y yᵀ with J_x = J_th and J_y = J_ph - J_c² / J_th. It
//!   has no mixed terms.
//! - Both rows turn rigidly about l, so (dx/dt).w = (dth/dt) x.(w x l). No derivative of a row is
//!   computed.
//!
//! Wheels are computed in pairs (see [`Pair`]). If the number of wheels is odd, the last wheel's
//! partner has zeros for all its constants.

use hbot_core::design::device::{Device, MAX_WHEELS, Wheel};
use hbot_core::design::kinematics::ContactFrame;
use hbot_core::{Quat, Vec3};

use super::pair::Pair;
use super::trig::sincos;

/// Largest number of wheel pairs of a device.
pub(crate) const MAX_PAIRS: usize = MAX_WHEELS / 2;

/// One three-component vector for each of the two wheels of a pair.
type Vectors = [Pair; 3];

/// The constants of a pair of wheels. The vectors x and y are defined in the module documentation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WheelPair {
    /// Coefficient vectors that give x = `x_cos` cos th + `x_sin` sin th + `axis` at the steer
    /// angle th.
    x_cos: Vectors,
    x_sin: Vectors,
    axis: Vectors,
    /// Coefficient vectors that give y = `y_cos` cos th + `y_sin` sin th at the steer angle th.
    y_cos: Vectors,
    y_sin: Vectors,
    /// Ratio J_c / J_th of the coupling to the steer inertia. The steer rate is dth/dt = x.w - mix
    /// y.w.
    mix: Pair,
    /// Steer inertia J_th, which acts along x, kg m².
    x_inertia: Pair,
    /// Drive inertia less the coupled part, J_ph - J_c² / J_th, which acts along y, kg m².
    y_inertia: Pair,
}

/// Constants of a pair that has no wheels.
const NO_WHEEL: WheelPair = WheelPair {
    x_cos: [Pair::ZERO; 3],
    x_sin: [Pair::ZERO; 3],
    axis: [Pair::ZERO; 3],
    y_cos: [Pair::ZERO; 3],
    y_sin: [Pair::ZERO; 3],
    mix: Pair::ZERO,
    x_inertia: Pair::ZERO,
    y_inertia: Pair::ZERO,
};

/// Joint torques of `P` wheel pairs, N m. They are components along the vectors x and y of each
/// wheel, instead of along the rows g_th and g_ph of G.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Push<const P: usize> {
    x: [Pair; P],
    y: [Pair; P],
}

/// The vectors x and y (see the module documentation) of `P` wheel pairs at given steer angles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows<const P: usize> {
    x: [Vectors; P],
    y: [Vectors; P],
}

/// The time derivatives of a plant's speeds and joint angles at one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flow<const P: usize> {
    /// Angular acceleration dw/dt of the sphere in frame N, rad/s².
    pub(crate) acceleration: Vec3,
    /// Steer rates dth/dt of all wheel pairs, rad/s.
    pub(crate) steer: [Pair; P],
    /// Drive rates dph/dt of all wheel pairs, rad/s.
    pub(crate) drive: [Pair; P],
}

/// The constants of all wheels and the inertia of the sphere, from which the accelerations follow.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    /// Inertia of the sphere (I_s) and of anything attached to it, such as a hand, kg m².
    pub(crate) inertia: f64,
    pub(crate) pairs: [WheelPair; MAX_PAIRS],
}

impl Model {
    /// Computes the constants of `device`. Fails with the index of the first wheel whose inertias
    /// are physically impossible (its inertia matrix is not positive semidefinite).
    pub(crate) fn new(device: &Device) -> Result<Self, usize> {
        let mut pairs = [NO_WHEEL; MAX_PAIRS];
        for (i, wheel) in device.wheels().iter().enumerate() {
            pairs[i / 2].set(i % 2, device, wheel).ok_or(i)?;
        }
        Ok(Self { inertia: device.sphere_inertia(), pairs })
    }

    /// Returns the vectors x and y (see the module documentation) of every wheel at the steer
    /// angles `steer`, rad.
    #[inline(always)]
    pub(crate) fn rows<const P: usize>(&self, steer: &[Pair; P]) -> Rows<P> {
        let mut rows = Rows { x: [[Pair::ZERO; 3]; P], y: [[Pair::ZERO; 3]; P] };
        for p in 0..P {
            let pair = &self.pairs[p];
            let (s, c) = sincos(steer[p]);
            for k in 0..3 {
                rows.x[p][k] = pair.x_cos[k] * c + pair.x_sin[k] * s + pair.axis[k];
                rows.y[p][k] = pair.y_cos[k] * c + pair.y_sin[k] * s;
            }
        }
        rows
    }

    /// Returns the joint rates dth/dt (steer) and dph/dt (drive) while the sphere turns at the
    /// angular velocity `omega`, rad/s.
    #[inline(always)]
    pub(crate) fn rates<const P: usize>(&self, rows: &Rows<P>, omega: Vec3) -> ([Pair; P], [Pair; P]) {
        let w = splat(omega);
        let (mut steer, mut drive) = ([Pair::ZERO; P], [Pair::ZERO; P]);
        for p in 0..P {
            drive[p] = dot(&rows.y[p], &w);
            steer[p] = dot(&rows.x[p], &w) - self.pairs[p].mix * drive[p];
        }
        (steer, drive)
    }

    /// Converts joint torques (N m, in the order steer, drive of each wheel) to the form that
    /// [`Model::flow`] takes.
    #[inline(always)]
    pub(crate) fn push<const P: usize>(&self, tau: &[f64; 2 * MAX_WHEELS]) -> Push<P> {
        let mut push = Push { x: [Pair::ZERO; P], y: [Pair::ZERO; P] };
        for p in 0..P {
            push.x[p] = Pair([tau[4 * p], tau[4 * p + 2]]);
            push.y[p] = Pair([tau[4 * p + 1], tau[4 * p + 3]]) - self.pairs[p].mix * push.x[p];
        }
        push
    }

    /// Returns the sphere's acceleration and the joint rates while the sphere turns at `omega`. The
    /// joint torques `push` and the torque `external` on the sphere (frame N, N m) act. `rows` are
    /// the vectors x and y at the present steer angles.
    #[inline(always)]
    pub(crate) fn flow<const P: usize>(
        &self,
        rows: &Rows<P>,
        omega: Vec3,
        push: &Push<P>,
        external: Vec3,
    ) -> Flow<P> {
        let w = splat(omega);
        let (steer, drive) = self.rates(rows, omega);
        let mut b = [Pair::ZERO; 3];
        for p in 0..P {
            let (pair, x, y) = (&self.pairs[p], &rows.x[p], &rows.y[p]);
            let across = cross(&w, &pair.axis);
            let along_x = push.x[p] - pair.x_inertia * dot(x, &across) * steer[p];
            let along_y = push.y[p] - pair.y_inertia * dot(y, &across) * steer[p];
            for k in 0..3 {
                b[k] = b[k] + (x[k] * along_x + y[k] * along_y);
            }
        }
        let b = Vec3::new(b[0].sum(), b[1].sum(), b[2].sum()) + external;
        Flow { acceleration: self.apparent(rows).solve(b), steer, drive }
    }

    /// Returns the apparent inertia of sphere and wheels in frame N, I_s I + Gᵀ J_q G, in kg m².
    #[inline(always)]
    pub(crate) fn apparent<const P: usize>(&self, rows: &Rows<P>) -> Symmetric {
        let mut m = [Pair::ZERO; 6];
        for p in 0..P {
            let (pair, x, y) = (&self.pairs[p], &rows.x[p], &rows.y[p]);
            let jx = x.map(|c| c * pair.x_inertia);
            let jy = y.map(|c| c * pair.y_inertia);
            for (m, (i, j)) in m.iter_mut().zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]) {
                *m = *m + (x[i] * jx[j] + y[i] * jy[j]);
            }
        }
        let [xx, yy, zz, xy, xz, yz] = m.map(Pair::sum);
        Symmetric { xx: self.inertia + xx, yy: self.inertia + yy, zz: self.inertia + zz, xy, xz, yz }
    }
}

impl WheelPair {
    /// Sets the constants of one wheel of the pair; `lane` is 0 or 1. Returns `None` if the wheel's
    /// inertias are physically impossible, J_c² > J_th J_ph.
    fn set(&mut self, lane: usize, device: &Device, wheel: &Wheel) -> Option<()> {
        let spec = wheel.spec();
        let (l1, l2) = (wheel.axis_along_axle(), wheel.axis_along_roll());
        let coupling = spec.axial_inertia * l1;
        let mix = if coupling == 0.0 { 0.0 } else { coupling / spec.steer_inertia };
        let rest = spec.drive_inertia - mix * coupling;
        if !(rest >= 0.0) {
            return None;
        }
        // At th = 0 the rows are axis + x_cos and y_cos. The sine vectors are these turned about
        // the axis by a quarter turn, which is the axis cross the vector.
        let frame = ContactFrame::at(wheel, 0.0);
        let steer = frame.c2 / l2;
        let drive = (steer * l1 - frame.c1) * (device.sphere_radius() / spec.radius);
        // l.g_th = 1 and l.g_ph = 0 at any th. This removes their rounding error.
        let drive = drive - spec.axis * drive.dot(spec.axis);
        let x = steer - spec.axis * steer.dot(spec.axis) + drive * mix;
        let vectors = [
            (&mut self.x_cos, x),
            (&mut self.x_sin, spec.axis.cross(x)),
            (&mut self.axis, spec.axis),
            (&mut self.y_cos, drive),
            (&mut self.y_sin, spec.axis.cross(drive)),
        ];
        for (pair, vector) in vectors {
            for (k, c) in vector.to_array().into_iter().enumerate() {
                pair[k].0[lane] = c;
            }
        }
        self.mix.0[lane] = mix;
        self.x_inertia.0[lane] = spec.steer_inertia;
        self.y_inertia.0[lane] = rest;
        Some(())
    }
}

/// A symmetric 3 x 3 matrix in frame N.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Symmetric {
    pub(crate) xx: f64,
    pub(crate) yy: f64,
    pub(crate) zz: f64,
    pub(crate) xy: f64,
    pub(crate) xz: f64,
    pub(crate) yz: f64,
}

impl Symmetric {
    /// Returns the vector v with A v = b, where A is this matrix, which must be positive definite.
    /// It uses cofactors and only one division.
    #[inline(always)]
    pub(crate) fn solve(&self, b: Vec3) -> Vec3 {
        let &Self { xx, yy, zz, xy, xz, yz } = self;
        let (p, q, r) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let (s, t, u) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        let scale = 1.0 / (xx * p + xy * q + xz * r);
        Vec3::new(
            (p * b.x + q * b.y + r * b.z) * scale,
            (q * b.x + s * b.y + t * b.z) * scale,
            (r * b.x + t * b.y + u * b.z) * scale,
        )
    }
}

/// Returns the rate dq/dt = 1/2 (0, w) q of the orientation of a sphere that turns at the angular
/// velocity `omega` in frame N.
#[inline(always)]
pub(crate) fn quaternion_rate(q: Quat, omega: Vec3) -> Quat {
    let w = omega * 0.5;
    Quat::from_xyzw(
        w.x * q.w + w.y * q.z - w.z * q.y,
        w.y * q.w + w.z * q.x - w.x * q.z,
        w.z * q.w + w.x * q.y - w.y * q.x,
        -(w.x * q.x + w.y * q.y + w.z * q.z),
    )
}

#[inline(always)]
fn splat(v: Vec3) -> Vectors {
    [Pair::splat(v.x), Pair::splat(v.y), Pair::splat(v.z)]
}

#[inline(always)]
fn dot(a: &Vectors, b: &Vectors) -> Pair {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: &Vectors, b: &Vectors) -> Vectors {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
