//! Rotations: exponential, logarithm and error vectors of unit quaternions.
//!
//! A quaternion q = (eta, e) maps sphere axes to frame N. `exp` and `log` are accurate to rounding
//! for angles from 1e-300 to pi. Both use a series where the closed form would divide zero by zero.
//! `log` uses atan2, which stays accurate at a half turn, where acos and asin lose half of their
//! digits.

use crate::real::{Quat, Real, TURN, Vec3, atan2, fabs, sincos, sqrt};

/// Returns the vector part e of the quaternion q = (eta, e).
#[inline]
#[must_use]
pub fn vector_part(q: Quat) -> Vec3 {
    Vec3::new(q.x, q.y, q.z)
}

/// Returns the quaternion with the scalar part `eta` and the vector part `e`.
#[inline]
#[must_use]
pub fn from_parts(eta: Real, e: Vec3) -> Quat {
    Quat::from_xyzw(e.x, e.y, e.z, eta)
}

/// Returns the unit quaternion in the direction of the four numbers `[w, x, y, z]`. Returns `None`
/// if all are zero or if one is not finite.
///
/// The numbers are first divided by the largest one, so that no square overflows or underflows.
#[must_use]
pub fn from_wxyz(c: [Real; 4]) -> Option<Quat> {
    let largest = c.iter().fold(0.0, |m: Real, x| if fabs(*x) > m || x.is_nan() { fabs(*x) } else { m });
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let q = Quat::from_xyzw(c[1] / largest, c[2] / largest, c[3] / largest, c[0] / largest);
    Some(q * (1.0 / sqrt(q.length_squared())))
}

/// Returns the four components of a quaternion as `[w, x, y, z]`.
#[inline]
#[must_use]
pub fn to_wxyz(q: Quat) -> [Real; 4] {
    [q.w, q.x, q.y, q.z]
}

/// Returns the quaternion of the rotation by the rotation vector `v` (axis times angle, rad):
/// exp(v) = (cos(|v|/2), v sin(|v|/2)/|v|).
///
/// # Preconditions
/// `v` is finite and |v|² does not overflow.
#[inline]
#[must_use]
pub fn exp(v: Vec3) -> Quat {
    let t2 = v.length_squared();
    // Below 1/32 rad the series to t^6 is exact to rounding: the next terms are t^8/1e7 and
    // t^8/2e8.
    if t2 < 1.0 / 1024.0 {
        let eta = 1.0 - t2 * (1.0 / 8.0) * (1.0 - t2 * (1.0 / 48.0) * (1.0 - t2 * (1.0 / 120.0)));
        let k = 0.5 - t2 * (1.0 / 48.0) * (1.0 - t2 * (1.0 / 80.0) * (1.0 - t2 * (1.0 / 168.0)));
        return from_parts(eta, v * k);
    }
    let t = sqrt(t2);
    let (s, c) = sincos(0.5 * t);
    from_parts(c, v * (s / t))
}

/// Returns the rotation vector of the unit quaternion `q` (axis times angle, rad). Its length is at
/// most pi. `q` and `-q` give the same vector, as they are the same rotation.
///
/// At exactly a half turn (eta = 0) the two vectors `pi e` and `-pi e` are both valid. The result
/// is then `pi e`.
#[inline]
#[must_use]
pub fn log(q: Quat) -> Vec3 {
    let q = shortest(q);
    vector_part(q) * (angle_over_sine(q.w, vector_part(q)))
}

/// Returns `q` or `-q`, the one whose scalar part eta is not negative. Both are the same rotation.
#[inline]
#[must_use]
pub fn shortest(q: Quat) -> Quat {
    if q.w < 0.0 { -q } else { q }
}

/// Returns the factor t / sin(t/2), where t is the rotation angle of the unit quaternion (eta, e)
/// with eta >= 0. The rotation vector is this factor times e.
#[inline]
#[must_use]
pub(crate) fn angle_over_sine(eta: Real, e: Vec3) -> Real {
    let s2 = e.length_squared();
    // 2 atan(x)/x with x = s/eta. With terms to x^8 the remainder is 2 x^10/11 < 2e-16 for x² <
    // 8e-4.
    if s2 < 8.0e-4 * eta * eta {
        let x2 = s2 / (eta * eta);
        let series = 1.0 - x2 * (1.0 / 3.0 - x2 * (0.2 - x2 * (1.0 / 7.0 - x2 * (1.0 / 9.0))));
        return 2.0 * series / eta;
    }
    let s = sqrt(s2);
    2.0 * atan2(s, eta) / s
}

/// Returns `q` normalised to unit length. The length of `q` must differ from 1 only by rounding
/// errors.
///
/// It takes one step of Newton's iteration for 1/sqrt. A deviation d of |q|² from 1 becomes 3/8 d²,
/// which is below rounding for d < 1e-8.
#[inline]
#[must_use]
pub fn renormalized(q: Quat) -> Quat {
    q * (1.5 - 0.5 * q.length_squared())
}

/// Returns the orientation that `q` becomes after the turn `v` (rotation vector in frame N, rad):
/// the product exp(v) q, normalised to unit length.
///
/// The product multiplies each component of `q` by the cosine of half the turn. If the turns are
/// small, that cosine is 1 or one of the numbers next to it, and its rounding error turns the
/// sphere a little in the same direction in every step. [`turned_by_change`] has no such error.
///
/// # Preconditions
/// `v` is finite and |v|² does not overflow. `q` is of unit length except for rounding.
#[inline(always)]
#[must_use]
pub fn turned_by_product(q: Quat, v: Vec3) -> Quat {
    renormalized(exp(v) * q)
}

/// Returns the orientation that `q` becomes after the turn `v` (rotation vector in frame N, rad),
/// normalised to unit length. It is the sum of `q` and the change (exp(v) - 1) q.
///
/// No number near 1 is multiplied, so the rounding errors of many small turns do not add up in one
/// direction: after n turns they have grown by about the square root of n.
///
/// # Preconditions
/// `v` is finite and |v|² does not overflow. `q` is of unit length except for rounding.
#[inline]
#[must_use]
pub fn turned_by_change(q: Quat, v: Vec3) -> Quat {
    let (less, s) = exp_less_one(v);
    let e = vector_part(q);
    let change = from_parts(less * q.w - s.dot(e), e * less + s * q.w + s.cross(e));
    // The length is corrected by a change too, the Newton step of `renormalized`. A step below one
    // rounding error would change only the small components of `q`, which turns it.
    let short = 0.5 - 0.5 * q.length_squared();
    if fabs(short) < Real::EPSILON { q + change } else { q + (change + q * short) }
}

/// Returns exp(v) - 1: its scalar part cos(|v|/2) - 1, without the rounding error of a number near
/// 1, and its vector part.
#[inline]
fn exp_less_one(v: Vec3) -> (Real, Vec3) {
    let t2 = v.length_squared();
    if t2 < 1.0 / 1024.0 {
        // The series of `exp`.
        let less = -t2 * (1.0 / 8.0) * (1.0 - t2 * (1.0 / 48.0) * (1.0 - t2 * (1.0 / 120.0)));
        let k = 0.5 - t2 * (1.0 / 48.0) * (1.0 - t2 * (1.0 / 80.0) * (1.0 - t2 * (1.0 / 168.0)));
        return (less, v * k);
    }
    let t = sqrt(t2);
    let (s, c) = sincos(0.25 * t);
    (-2.0 * s * s, v * (2.0 * s * c / t))
}

/// Returns the turn that leads from the orientation `from` to the orientation `to`, as a rotation
/// vector in frame N (rad): log(to from⁻¹).
#[inline]
#[must_use]
pub fn difference(to: Quat, from: Quat) -> Vec3 {
    log(to * from.conjugate())
}

/// Returns the angle of the turn from one orientation to the other, rad, 0 to pi.
#[must_use]
pub fn angle_between(a: Quat, b: Quat) -> Real {
    let x = shortest(a * b.conjugate());
    2.0 * atan2(vector_part(x).length(), x.w)
}

/// Returns the orientation error of the paper's eq. 24 in frame N: eta e_d - eta_d e - \[e_d\] e.
/// It is the vector part of the quaternion q_d q⁻¹.
#[must_use]
pub fn error_eq24(desired: Quat, actual: Quat) -> Vec3 {
    let (ed, e) = (vector_part(desired), vector_part(actual));
    ed * actual.w - e * desired.w - ed.cross(e)
}

/// Returns the unit quaternion with the Hopf coordinates theta (0 to pi), phi and psi (0 to 2 pi),
/// rad (paper eq. 23, as corrected in the physics notes, section 10).
#[must_use]
pub fn from_hopf(theta: Real, phi: Real, psi: Real) -> Quat {
    let (st, ct) = sincos(0.5 * theta);
    let (sp, cp) = sincos(0.5 * psi);
    let (sb, cb) = sincos(phi + 0.5 * psi);
    Quat::from_xyzw(ct * sp, st * cb, st * sb, ct * cp)
}

/// Returns `angle` (rad) plus or minus as many whole turns as bring it into the interval (-pi, pi].
#[must_use]
pub fn wrap_angle(angle: Real) -> Real {
    let r = crate::real::fmod(angle, TURN);
    if r > 0.5 * TURN {
        r - TURN
    } else if r <= -0.5 * TURN {
        r + TURN
    } else {
        r
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    #[test]
    fn both_ways_to_apply_a_turn_agree_to_rounding_and_keep_the_length() {
        let (mut product, mut change) = (Quat::IDENTITY, Quat::IDENTITY);
        // Turns on both sides of the border of the series, 1/32 rad, and up to a full turn.
        for (k, t) in
            [1e-9, 1e-4, 0.0312, 0.0313, 0.5, 1.5, 3.0, 6.0].into_iter().cycle().take(800).enumerate()
        {
            let axis = Vec3::new(libm::sin(k as f64), libm::cos(k as f64), 0.5).normalize();
            product = turned_by_product(product, axis * t);
            change = turned_by_change(change, axis * t);
            // Both errors grow by at most a few units in the last place in each turn.
            let apart = (product - change).length();
            assert!(apart < 4.0 * f64::EPSILON * (k + 1) as f64, "{apart:e} after {k} turns");
            assert!((change.length_squared() - 1.0).abs() < 16.0 * f64::EPSILON, "turn {k} by {t}");
        }
    }

    #[test]
    fn the_change_by_a_turn_is_its_exponential_less_one() {
        let axis = Vec3::new(0.6, -0.48, 0.64);
        for t in [0.0, 1e-200, 1e-9, 1e-4, 0.02, 0.0312, 0.0313, 0.5, 1.5] {
            let (less, s) = exp_less_one(axis * t);
            // A few roundings of the vector part, which is about half as long as the turn.
            let off = (s - vector_part(exp(axis * t))).length();
            assert!(off <= 2.0 * f64::EPSILON * t, "vector part at {t:e}: {off:e}");
            // The quaternion is of unit length: (1 + less)² + s² = 1.
            let s2 = s.length_squared();
            let want = -s2 / (1.0 + sqrt(1.0 - s2));
            assert!(
                (less - want).abs() <= 8.0 * f64::EPSILON * want.abs(),
                "{less:e} at {t:e}, not {want:e}"
            );
        }
    }

    #[test]
    fn the_roundings_of_many_small_changes_grow_only_by_their_root() {
        const TURNS: u32 = 100_000;
        let turn = Vec3::new(0.6, -0.48, 0.64) * 1e-9;
        for start in [[0.5, 0.5, 0.5, 0.5], [0.9, 0.4, 0.1, 0.15]] {
            let start = from_wxyz(start).unwrap();
            let q = (0..TURNS).fold(start, |q, _| turned_by_change(q, turn));
            let off = difference(q, exp(turn * f64::from(TURNS)) * start).length();
            assert!(off < f64::EPSILON * sqrt(f64::from(TURNS)), "{off:e} rad from {start}");
        }
    }

    #[test]
    fn wrap_angle_keeps_the_interval() {
        assert_eq!(wrap_angle(PI), PI);
        assert!((wrap_angle(-PI - 0.25) - (PI - 0.25)).abs() < 1e-15);
        assert!((wrap_angle(100.0 * PI + 0.5) - 0.5).abs() < 1e-13);
        for k in -400..=400 {
            let angle = 0.05 * f64::from(k);
            let wrapped = wrap_angle(angle);
            let turns = (angle - wrapped) / TURN;
            assert!(-PI < wrapped && wrapped <= PI, "{angle} becomes {wrapped}");
            assert!((turns - libm::round(turns)).abs() < 1e-14, "{angle} less {turns} turns");
        }
    }
}
