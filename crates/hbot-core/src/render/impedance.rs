//! The spring laws and the damper, with their energies (physics notes, section 6; Caccavale et al.
//! 1999).
//!
//! Let q_d be the desired and q the actual orientation. x = q_d⁻¹ q = (eta, e), with eta >= 0, is
//! the actual orientation in the desired frame. Stiffness (N m/rad) and damping (N m s/rad) are
//! symmetric matrices in the axes of the desired frame. Torques are in frame N and act on the
//! sphere. The torque of each spring that effects use is the exact gradient of its energy: around
//! any closed path it does no net work.

use crate::real::{Mat3, Quat, Real, Vec3, fabs};
use crate::rotation::{angle_over_sine, shortest, vector_part};

/// The torque of a spring on the sphere, and the energy stored in the spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastic {
    /// Torque on the sphere in frame N, N m.
    pub torque: Vec3,
    /// Potential energy of the spring, J.
    pub energy: Real,
}

/// Returns the torque and energy of the quaternion spring law (paper eq. 25-29). The torque is T =
/// -R_d 2 Eᵀ K e with E = eta I - \[e\], and the energy is 2 eᵀ K e.
///
/// (eta, e) is the actual orientation relative to the desired one. The law is smooth everywhere. If
/// the stiffness is K about all axes, the torque is K sin(angle): it falls beyond a quarter turn
/// and is zero at a half turn.
#[inline]
#[must_use]
pub fn quaternion_law(desired: Quat, actual: Quat, stiffness: &Mat3) -> Elastic {
    let x = shortest(desired.conjugate() * actual);
    let e = vector_part(x);
    let ke = *stiffness * e;
    Elastic { torque: desired * quaternion_pull(x.w, e, ke), energy: 2.0 * e.dot(ke) }
}

/// Returns the torque -2 Eᵀ f in the desired frame. It belongs to an energy that depends on the
/// quaternion's vector part e and has the gradient 4 f with respect to e.
#[inline]
pub(crate) fn quaternion_pull(eta: Real, e: Vec3, f: Vec3) -> Vec3 {
    // Eᵀ = eta I + [e]
    (f * eta + e.cross(f)) * -2.0
}

/// Returns the torque and energy of the geodesic spring law. The torque is T = -R_d Mᵀ K p with p =
/// log x, and the energy is 1/2 pᵀ K p. Also returns the rotation vector p (rad, in the desired
/// frame), which the caller passes as `branch` in the next call.
///
/// x is the actual orientation relative to the desired one. The torque is linear in the angle up to
/// a half turn. M = I - 1/2 \[p\] + (1/t²)(1 - (t/2) cot(t/2)) \[p\]² with t = |p| is the Jacobian
/// of the logarithm for a turn in the desired frame. At exactly a half turn both +p and -p are
/// valid. The function then takes the one nearer to `branch`, the rotation vector of the previous
/// call.
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

/// Returns the torque -Mᵀ f in the desired frame. It belongs to an energy that depends on the
/// rotation vector p = log x and has the gradient f with respect to p. `factor` is t / sin(t/2)
/// with t = |p|.
#[inline]
pub(crate) fn geodesic_pull(eta: Real, factor: Real, p: Vec3, f: Vec3) -> Vec3 {
    let c = log_jacobian_coefficient(eta, factor, p.length_squared());
    // Mᵀ = I + 1/2 [p] + c [p]²
    let pf = p.cross(f);
    -(f + pf * 0.5 + p.cross(pf) * c)
}

/// Returns the torque T = -2 R_d K e, to which both spring laws simplify for small angles. It
/// serves only for comparisons.
///
/// If the stiffness is K about all axes, the torque differs from the other laws only by the third
/// power of the angle. It is 2 K sin(angle/2) with the energy 4 K (1 - eta), so it is still a
/// gradient. For any other K it differs by the second power and is **not a gradient**: it lacks the
/// term e x K e and releases energy around some closed paths. For this reason no effect uses it.
/// The returned energy is 4 eᵀ K e / (1 + eta), which is correct only if the stiffness is equal
/// about all axes.
#[inline]
#[must_use]
pub fn first_order_law(desired: Quat, actual: Quat, stiffness: &Mat3) -> Elastic {
    let x = shortest(desired.conjugate() * actual);
    let e = vector_part(x);
    let ke = *stiffness * e;
    Elastic { torque: desired * (ke * -2.0), energy: 4.0 * e.dot(ke) / (1.0 + x.w) }
}

/// Returns the coefficient (1/t²)(1 - (t/2) cot(t/2)) in the Jacobian of the logarithm of a turn by
/// the angle t. The arguments are eta = cos(t/2), t / sin(t/2) and t².
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

/// Returns the torque of a viscous damper, T = -R_d D R_dᵀ (w - w_d). The rates w and w_d are in
/// frame N (rad/s), the matrix D in the desired frame. The damper absorbs energy of motion relative
/// to w_d.
#[inline]
#[must_use]
pub fn damper(desired: Quat, damping: &Mat3, omega: Vec3, desired_omega: Vec3) -> Vec3 {
    -(desired * (*damping * (desired.conjugate() * (omega - desired_omega))))
}

/// Returns true if `m` is valid as a stiffness or damping matrix: finite, symmetric and positive
/// semidefinite, up to rounding.
#[must_use]
pub fn is_impedance(m: &Mat3) -> bool {
    let [xx, yy, zz] = [m.x_axis.x, m.y_axis.y, m.z_axis.z];
    let [xy, xz, yz] = [m.x_axis.y, m.x_axis.z, m.y_axis.z];
    // With what is off the diagonal: a matrix whose diagonal is zero is not small for that.
    let scale = [yy, zz, fabs(xy), fabs(xz), fabs(yz)].into_iter().fold(xx, Real::max);
    // A value that is not finite fails one of these comparisons. NaN fails any of them. An infinity
    // fails in the difference of a pair, or in the scaled minors.
    if !(xx >= 0.0 && yy >= 0.0 && zz >= 0.0) {
        return false;
    }
    let slack = 64.0 * Real::EPSILON * scale;
    let symmetric =
        fabs(m.y_axis.x - xy) <= slack && fabs(m.z_axis.x - xz) <= slack && fabs(m.z_axis.y - yz) <= slack;
    // All principal minors of the matrix, scaled to unit size.
    let s = if scale >= Real::MIN_POSITIVE { 1.0 / scale } else { 0.0 };
    let [a, b, c, d, e, f] = [xx * s, yy * s, zz * s, xy * s, xz * s, yz * s];
    let minor = -64.0 * Real::EPSILON;
    symmetric
        && a * b - d * d >= minor
        && a * c - e * e >= minor
        && b * c - f * f >= minor
        && a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e) >= minor
}
