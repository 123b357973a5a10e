//! The spring laws and the damper, with their energies (physics notes, section 6; Caccavale et al.
//! 1999).
//!
//! Let q_d be the desired and q the actual orientation. x = q_d⁻¹ q = (eta, e), with eta >= 0, is
//! the actual orientation in the desired frame. Stiffness (N m/rad) and damping (N m s/rad) are
//! symmetric matrices in the axes of the desired frame. Torques are in frame N and act on the
//! sphere. The torque of each spring that effects use is the exact gradient of its energy: around
//! any closed path it does no net work.

use crate::real::{Mat3, Quat, Real, Vec3, fabs};
use crate::rotation::{self, angle_over_sine, shortest, vector_part};

/// The torque of a spring on the sphere and the energy stored in the spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastic {
    /// Torque on the sphere in frame N, N m.
    pub torque: Vec3,
    /// Potential energy of the spring, J.
    pub energy: Real,
}

/// Returns the torque and energy of the quaternion spring law (paper eq. 25-29): T = -R_d 2 Eᵀ K e
/// with E = eta I - \[e\], energy 2 eᵀ K e.
///
/// (eta, e) is the actual orientation in the desired frame. The law is smooth everywhere. For an
/// isotropic K the torque is K sin(angle): soft beyond a quarter turn and zero at a half turn.
#[inline]
#[must_use]
pub fn quaternion_law(desired: Quat, actual: Quat, stiffness: &Mat3) -> Elastic {
    let x = shortest(desired.conjugate() * actual);
    let e = vector_part(x);
    let ke = *stiffness * e;
    Elastic { torque: desired * quaternion_pull(x.w, e, ke), energy: 2.0 * e.dot(ke) }
}

/// Returns -2 Eᵀ f, in the desired frame: the torque of an energy that depends on e and has the
/// gradient 4 f.
#[inline]
pub(crate) fn quaternion_pull(eta: Real, e: Vec3, f: Vec3) -> Vec3 {
    // Eᵀ = eta I + [e]
    (f * eta + e.cross(f)) * -2.0
}

/// Returns the torque and energy of the geodesic spring law: T = -R_d Mᵀ K p with p = log x, energy
/// 1/2 pᵀ K p. Also returns p (rad, desired frame), which is the next `branch`.
///
/// x is the actual orientation in the desired frame. The torque is linear in the angle up to a half
/// turn. M = I - 1/2 \[p\] + (1/t²)(1 - (t/2) cot(t/2)) \[p\]² with t = |p| is the Jacobian of the
/// logarithm for a turn in the desired frame. At exactly a half turn both +p and -p are valid; the
/// one nearer to `branch`, the previous rotation vector, is kept.
#[inline]
#[must_use]
pub fn geodesic_law(desired: Quat, actual: Quat, stiffness: &Mat3, branch: Vec3) -> (Elastic, Vec3) {
    let mut x = shortest(desired.conjugate() * actual);
    if x.w == 0.0 && vector_part(x).dot(branch) < 0.0 {
        x = -x;
    }
    let e = vector_part(x);
    let factor = angle_over_sine(x.w, e);
    let p = e * factor;
    let kp = *stiffness * p;
    let torque = geodesic_pull(x.w, factor, p, kp);
    (Elastic { torque: desired * torque, energy: 0.5 * p.dot(kp) }, p)
}

/// Returns -Mᵀ f, in the desired frame: the torque of an energy that depends on p = log x and has
/// the gradient f. `factor` is t / sin(t/2).
#[inline]
pub(crate) fn geodesic_pull(eta: Real, factor: Real, p: Vec3, f: Vec3) -> Vec3 {
    let c = log_jacobian_coefficient(eta, factor, p.length_squared());
    // Mᵀ = I + 1/2 [p] + c [p]²
    let pf = p.cross(f);
    -(f + pf * 0.5 + p.cross(pf) * c)
}

/// Returns the torque T = -2 R_d K e, the first-order form of both spring laws. It serves only for
/// comparisons.
///
/// For an isotropic K it differs from the other laws by the third power of the angle: it is 2 K
/// sin(angle/2) with energy 4 K (1 - eta), still a gradient. For another K it differs by the second
/// power and is **not a gradient**: it lacks the term e x K e and releases energy around some
/// closed paths. For this reason no effect offers it. The returned energy is the isotropic formula
/// applied to any K, 4 eᵀ K e / (1 + eta).
#[inline]
#[must_use]
pub fn first_order_law(desired: Quat, actual: Quat, stiffness: &Mat3) -> Elastic {
    let x = shortest(desired.conjugate() * actual);
    let e = vector_part(x);
    let ke = *stiffness * e;
    Elastic { torque: desired * (ke * -2.0), energy: 4.0 * e.dot(ke) / (1.0 + x.w) }
}

/// Returns (1/t²)(1 - (t/2) cot(t/2)), computed from eta = cos(t/2), t / sin(t/2) and t².
#[inline]
fn log_jacobian_coefficient(eta: Real, angle_over_sine: Real, t2: Real) -> Real {
    if t2 < 0.09 {
        // 1/12 + t²/720 + t⁴/30240 + t⁶/1209600 + t⁸/47900160; the next term is below 3e-15.
        return 1.0 / 12.0
            + t2 * (1.0 / 720.0
                + t2 * (1.0 / 30_240.0 + t2 * (1.0 / 1_209_600.0 + t2 * (1.0 / 47_900_160.0))));
    }
    (1.0 - 0.5 * angle_over_sine * eta) / t2
}

/// Returns the torque of a damper, T = -R_d D R_dᵀ (w - w_d), with the rates in frame N (rad/s). It
/// takes energy out.
#[inline]
#[must_use]
pub fn damper(desired: Quat, damping: &Mat3, omega: Vec3, desired_omega: Vec3) -> Vec3 {
    -(desired * (*damping * (desired.conjugate() * (omega - desired_omega))))
}

/// Returns the rotation vector of the actual orientation in the desired frame, log(q_d⁻¹ q), rad.
#[must_use]
pub fn rotation_vector(desired: Quat, actual: Quat) -> Vec3 {
    rotation::log(desired.conjugate() * actual)
}

/// Returns true if `m` is a valid stiffness or damping: finite, symmetric and positive
/// semidefinite, up to rounding.
#[must_use]
pub fn is_impedance(m: &Mat3) -> bool {
    let [xx, yy, zz] = [m.x_axis.x, m.y_axis.y, m.z_axis.z];
    let [xy, xz, yz] = [m.x_axis.y, m.x_axis.z, m.y_axis.z];
    let scale = xx.max(yy).max(zz);
    // A value that is not finite fails one of these comparisons. NaN fails any of them. An infinity
    // fails in the difference of a pair, or in the scaled minors.
    if !(xx >= 0.0 && yy >= 0.0 && zz >= 0.0) {
        return false;
    }
    let slack = 64.0 * Real::EPSILON * scale;
    let symmetric =
        fabs(m.y_axis.x - xy) <= slack && fabs(m.z_axis.x - xz) <= slack && fabs(m.z_axis.y - yz) <= slack;
    // All principal minors of the matrix, scaled to unit size.
    let s = if scale > 0.0 { 1.0 / scale } else { 0.0 };
    let [a, b, c, d, e, f] = [xx * s, yy * s, zz * s, xy * s, xz * s, yz * s];
    let minor = -64.0 * Real::EPSILON;
    symmetric
        && a * b - d * d >= minor
        && a * c - e * e >= minor
        && b * c - f * f >= minor
        && a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e) >= minor
}
