//! The plant's constants and what they give at one instant: physics notes, section 5, arranged for few operations.
//!
//! With l a wheel's steering axis, rows g_th and g_ph of G, J_th, J_ph and J_c its inertias, let
//! x = g_th + (J_c / J_th) g_ph and y = g_ph. Then
//!
//! - g_th = l + (a vector that turns about l with th), and g_ph turns about l with th, so that six numbers times
//!   sine and cosine give each row;
//! - Gᵀ J_q G is the sum of J_x x xᵀ + J_y y yᵀ with J_x = J_th and J_y = J_ph - J_c² / J_th: no mixed terms;
//! - both rows turn rigidly about l, so (dx/dt).w = (dth/dt) x.(w x l), and no derivative of a row is ever formed.
//!
//! Wheels go in pairs (see [`Pair`]). An odd last one is paired with nothing: all its constants are zero.

use hbot_core::device::{Device, MAX_WHEELS, Wheel};
use hbot_core::kinematics::ContactFrame;
use hbot_core::{Quat, Vec3};

use super::pair::Pair;
use super::trig::sincos;

/// The most pairs of wheels.
pub(crate) const MAX_PAIRS: usize = MAX_WHEELS / 2;

/// A vector for each of two wheels.
type Vectors = [Pair; 3];

/// The constants of two wheels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WheelPair {
    /// x = `x_cos` cos th + `x_sin` sin th + `axis`.
    x_cos: Vectors,
    x_sin: Vectors,
    axis: Vectors,
    /// y = `y_cos` cos th + `y_sin` sin th.
    y_cos: Vectors,
    y_sin: Vectors,
    /// J_c / J_th: dth/dt = x.w - mix y.w.
    mix: Pair,
    /// J_th, kg m².
    x_inertia: Pair,
    /// J_ph - J_c² / J_th, kg m².
    y_inertia: Pair,
}

/// The constants of one wheel that does not exist.
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

/// Joint torques of `P` pairs of wheels along x and y rather than g_th and g_ph, N m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Push<const P: usize> {
    x: [Pair; P],
    y: [Pair; P],
}

/// The rows of `P` pairs of wheels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows<const P: usize> {
    x: [Vectors; P],
    y: [Vectors; P],
}

/// Where everything is heading.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flow<const P: usize> {
    /// dw/dt in N, rad/s².
    pub(crate) acceleration: Vec3,
    /// dth/dt, rad/s.
    pub(crate) steer: [Pair; P],
    /// dph/dt, rad/s.
    pub(crate) drive: [Pair; P],
}

/// All wheels, and the sphere's own inertia.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    /// I_s and what is held to the sphere, kg m².
    pub(crate) inertia: f64,
    pub(crate) pairs: [WheelPair; MAX_PAIRS],
}

impl Model {
    /// The constants of `device`, or the first wheel whose inertias are no positive semidefinite matrix.
    pub(crate) fn new(device: &Device) -> Result<Self, usize> {
        let mut pairs = [NO_WHEEL; MAX_PAIRS];
        for (i, wheel) in device.wheels().iter().enumerate() {
            pairs[i / 2].set(i % 2, device, wheel).ok_or(i)?;
        }
        Ok(Self { inertia: device.sphere_inertia(), pairs })
    }

    /// The rows at steering angles `steer`, rad.
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

    /// Joint rates (dth/dt, dph/dt) of a sphere turning with `omega`, rad/s.
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

    /// Torques at the joints in the order steer, drive of each wheel, N m, made ready for [`Model::flow`].
    #[inline(always)]
    pub(crate) fn push<const P: usize>(&self, tau: &[f64; 2 * MAX_WHEELS]) -> Push<P> {
        let mut push = Push { x: [Pair::ZERO; P], y: [Pair::ZERO; P] };
        for p in 0..P {
            push.x[p] = Pair([tau[4 * p], tau[4 * p + 2]]);
            push.y[p] = Pair([tau[4 * p + 1], tau[4 * p + 3]]) - self.pairs[p].mix * push.x[p];
        }
        push
    }

    /// Accelerations and rates at `rows` of a sphere turning with `omega` under the joint torques `push` and the
    /// torque `external` on the sphere (in N, N m).
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

    /// The apparent inertia I_s I + Gᵀ J_q G.
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
    /// Sets one of the two wheels; `None` where J_c² > J_th J_ph.
    fn set(&mut self, lane: usize, device: &Device, wheel: &Wheel) -> Option<()> {
        let spec = wheel.spec();
        let (l1, l2) = (wheel.axis_along_axle(), wheel.axis_along_roll());
        let coupling = spec.axial_inertia * l1;
        let mix = if coupling == 0.0 { 0.0 } else { coupling / spec.steer_inertia };
        let rest = spec.drive_inertia - mix * coupling;
        if !(rest >= 0.0) {
            return None;
        }
        // At th = 0 the rows are axis + x_cos and y_cos; what turns about an axis is a quarter turn on the axis cross it.
        let frame = ContactFrame::at(wheel, 0.0);
        let steer = frame.c2 / l2;
        let drive = (steer * l1 - frame.c1) * (device.sphere_radius() / spec.radius);
        // l.g_th = 1 and l.g_ph = 0 whatever th is: made exact here.
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

/// A symmetric 3 x 3 matrix in N.
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
    /// v with A v = b for a positive definite A, by cofactors: one division.
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

/// dq/dt of a sphere turning with `omega` in N: 1/2 (0, w) q.
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
