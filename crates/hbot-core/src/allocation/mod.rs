//! Joint torques for a torque on the sphere (physics notes, section 7).
//!
//! Given the torque T wanted, find the largest s in \[0, 1\] for which some joint torques tau within their limits have
//! Gᵀ tau = s T, and of those the ones of least cost 1/2 sum w_j tau_j². Both are unique; the direction of T is kept.
//!
//! From the quickest way to the slowest:
//!
//! 1. the torques of least cost, limits aside: if none is over its limit, that is all ([`allocate`] itself);
//! 2. two wheels: closed forms (`pair`);
//! 3. more wheels: s by the facets of the polytope of torques within reach (`facets`), then tau by that facet, or by a
//!    dual problem of three variables (`dual`);
//! 4. driven rows close to losing rank: the same in their principal axes (`reach`), for what is kept of T there (`weak`).
//!
//! Contact forces and the limit of traction come after (`traction`).

mod dual;
mod facets;
mod nearest;
mod pair;
mod problem;
mod reach;
mod traction;
mod weak;

pub(crate) use nearest::{Bounds, nearest};
pub use traction::{ContactArms, traction};

use crate::device::{Device, MAX_JOINTS};
use crate::linear::Sym3;
use crate::real::{Real, Vec3, fabs};
use crate::rig::Rig;
use reach::Reach;
use weak::Share;

/// A singular value of the peak-scaled driven rows (rows t_j g_j) beside what it is held against, from which on its direction is
/// there as any other (see [`allocate`]).
///
/// The prototype with all four motors never comes below 0.119. At 0.01 a torque in the weak direction has 1 % of the
/// size that one in the strong direction has: keeping T's direction would let its other parts go limp as well.
pub const WHOLE: Real = 0.01;

/// The same ratio up to which a direction counts as lost: the part of T along it is left out. In between a part of that part is
/// asked for, so that nothing jumps as the ratio moves through.
pub const LOST: Real = 0.002;

/// What each joint can give, and what its torque costs. Joints in the order steer, drive per wheel.
///
/// A joint gives nothing (a dead motor, no motor) where its peak is 0; likewise where its peak or weight is not
/// positive and finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Largest torque t_j, N m.
    pub peak: [Real; MAX_JOINTS],
    /// Weight w_j in the cost 1/2 sum w_j tau_j², 1/m² for the default of [`ContactArms::weights`]. Only ratios matter.
    pub weight: [Real; MAX_JOINTS],
}

impl JointLimits {
    /// No joint gives anything; each weighs 1.
    pub const NONE: Self = Self { peak: [0.0; MAX_JOINTS], weight: [1.0; MAX_JOINTS] };

    /// The joints of `rig`: its peaks, and the weights with which the least-cost torques least load the contacts.
    #[must_use]
    pub fn of(rig: &Rig) -> Self {
        Self::of_device(&rig.device, |joint| rig.joints[joint].peak)
    }

    /// The joints of `device` with these peaks (N m, one a joint), weighed as [`of`](Self::of) does.
    #[must_use]
    pub fn of_device(device: &Device, peak: impl Fn(usize) -> Real) -> Self {
        let mut limits = Self::NONE;
        for (i, wheel) in device.wheels().iter().enumerate() {
            let weights = ContactArms::of(wheel, device.sphere_radius()).weights();
            for (joint, weight) in (2 * i..).zip(weights) {
                (limits.peak[joint], limits.weight[joint]) = (peak(joint), weight);
            }
        }
        limits
    }

    #[inline]
    fn driven(&self, k: usize) -> bool {
        let (t, w) = (self.peak[k], self.weight[k]);
        t > 0.0 && t < Real::INFINITY && w > 0.0 && w < Real::INFINITY
    }
}

/// Joint torques, and what they make of the torque wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocation {
    /// Joint torques tau, N m, in the order steer, drive per wheel; 0 beyond the device's joints.
    pub torque: [Real; MAX_JOINTS],
    /// The s in Gᵀ tau = s T, 0 to 1: what saturation left of the torque wanted. Where `deficient`, T is what was kept of it, T*.
    pub scale: Real,
    /// T had a part that the driven joints cannot make, here or in any size, and that was left out, whole or a part of it.
    pub deficient: bool,
}

impl Allocation {
    /// No torque at all.
    const fn nothing(scale: Real, deficient: bool) -> Self {
        Self { torque: [0.0; MAX_JOINTS], scale, deficient }
    }
}

/// The joint torques for the torque `wanted` on the sphere, N m in N, given the rows of G (steer, drive per wheel; at
/// most [`MAX_JOINTS`], further ones are left out).
///
/// Never more than a joint's peak, never NaN. T = 0 gives no torque and scale 1; a T that is not finite, or one
/// without any motor to make it, no torque and scale 0.
///
/// # Where the driven joints lose a direction
///
/// Let sigma_i and u_i be the singular values (largest first) and principal axes of the peak-scaled driven rows: the joints make sigma_i
/// along u_i, and at most the root of their number times that. A direction is lost where wheels undo each other, so that little is left
/// of what they give. So it is not sigma_1 alone that sigma_i is held against, but
///
/// ```text
/// level = min(sigma_1, 5 sigma_w),    sigma_w = the most that one wheel with both motors gives in both directions of its contact
/// ```
///
/// which is a constant of the design. A wheel with a cone of 1e-3 has a thousand times its drive's torque at its steering; that direction is
/// strong, and the others are none the weaker for it. A direction that rounding spoils counts as lost whatever a wheel gives.
///
/// With a smooth step b_i of sigma_i / level, 0 at [`LOST`] and 1 at [`WHOLE`], and T_i the part of T along u_i, the answer is
///
/// ```text
/// b_3 tau(T)  +  (b_2 - b_3) tau(T_1 u_1 + T_2 u_2)  +  (1 - b_2) tau(T_1 u_1)
/// ```
///
/// with tau the exact answer. From [`WHOLE`] up it is that for T; `scale` is the mean of the three. As T makes no less than nothing along
/// any of its parts, what is made never works against T. In tau of a part of T the axes beyond are held at zero, or left to chance where that is
/// so little (below 1 % of what is made) that holding them would only cost the joints their strength.
///
/// A share depends on an axis by its singular value alone, and nothing jumps: not with the posture, not with T, not where
/// two singular values pass each other.
#[must_use]
pub fn allocate(rows: &[Vec3], limits: &JointLimits, wanted: Vec3) -> Allocation {
    if let Ok(four) = <&[Vec3; 4]>::try_from(rows) {
        allocate_rows(four, limits, wanted)
    } else {
        allocate_rows(&rows[..rows.len().min(MAX_JOINTS)], limits, wanted)
    }
}

/// The torque of least cost scaled as a whole until no joint is over its limit: the quick substitute for [`allocate`].
///
/// The same wherever no joint saturates; where one does, the direction of T is kept too, but `scale` may be
/// smaller than what the joints together could make. Rows that lose rank are treated as [`allocate`] does.
#[must_use]
pub fn allocate_clipped(rows: &[Vec3], limits: &JointLimits, wanted: Vec3) -> Allocation {
    let rows = &rows[..rows.len().min(MAX_JOINTS)];
    let size = wanted.abs().max_element();
    if size > 0.0 && wanted.is_finite() {
        let least = LeastCost::of(rows, limits, wanted / size);
        let mut largest: Real = 0.0;
        for k in 0..rows.len() {
            if limits.peak[k] > 0.0 {
                largest = largest.max(fabs(least.tau[k]) / limits.peak[k]);
            }
        }
        if least.sound && largest > 0.0 {
            let reached = Real::min(size, 1.0 / largest);
            let mut torque = [0.0; MAX_JOINTS];
            for k in 0..rows.len() {
                // Not above the limit by rounding either. A joint that gives nothing has 0 here, whatever its peak.
                let tau = least.tau[k] * reached;
                torque[k] =
                    if tau == 0.0 { 0.0 } else { Real::max(-limits.peak[k], Real::min(limits.peak[k], tau)) };
            }
            return Allocation { torque, scale: reached / size, deficient: false };
        }
    }
    allocate(rows, limits, wanted)
}

/// The largest torque along the unit vector `direction` (in N) that the joints can make with none across, N m.
///
/// s = min over pairs i < j of sum_k t_k |g_k.n| / |direction.n| with n = g_i x g_j: the facets of the zonotope of
/// torques within the limits. 0 where the driven rows do not reach `direction` at all.
#[must_use]
pub fn capability(rows: &[Vec3], limits: &JointLimits, direction: Vec3) -> Real {
    // Below this ratio a singular value is rounding.
    const ROUNDING: Real = if Real::EPSILON < 1.0e-10 { 1.0e-7 } else { 1.0e-5 };
    let size = direction.abs().max_element();
    let Some(reach) = Reach::of(&rows[..rows.len().min(MAX_JOINTS)], limits) else { return 0.0 };
    if !(size > 0.0 && direction.is_finite()) {
        return 0.0;
    }
    let sigma = reach.sigma();
    let rank = 1 + usize::from(sigma[1] > ROUNDING * sigma[0]) + usize::from(sigma[2] > ROUNDING * sigma[0]);
    let unit = direction / size;
    if reach.parts(unit)[rank..].iter().any(|part| fabs(*part) > ROUNDING) {
        return 0.0;
    }
    reach.capability(rank, unit) / size
}

/// The torques of least cost for a direction, limits aside.
struct LeastCost {
    tau: [Real; MAX_JOINTS],
    /// The driven rows are far from losing rank, and `tau` is not harmed by rounding.
    sound: bool,
}

impl LeastCost {
    #[inline(always)]
    fn of(rows: &[Vec3], limits: &JointLimits, u: Vec3) -> Self {
        // Ratio of det to spread below which rounding spoils all.
        const SPOILT: Real = if Real::EPSILON < 1.0e-10 { 1.0e-6 } else { 1.0e-4 };
        let mut give = [0.0; MAX_JOINTS];
        let (mut moment, mut peaks) = (Sym3::ZERO, Sym3::ZERO);
        for (k, g) in rows.iter().enumerate() {
            if limits.driven(k) {
                give[k] = 1.0 / limits.weight[k];
                moment.add(*g, give[k]);
                peaks.add(*g, limits.peak[k] * limits.peak[k]);
            }
        }
        let peaks = peaks.adjugate();
        let inverse = moment.adjugate();
        let sound = peaks.rank_above(WHOLE * WHOLE) && inverse.rank_above(SPOILT);
        let mut tau = [0.0; MAX_JOINTS];
        let y = inverse.solve(u);
        for (k, g) in rows.iter().enumerate() {
            // The row of a joint that gives nothing may be anything.
            tau[k] = if give[k] > 0.0 { give[k] * g.dot(y) } else { 0.0 };
        }
        // One step of refinement: the adjugate alone loses the square of the rows' condition.
        let mut left = u;
        for (k, g) in rows.iter().enumerate() {
            left -= if give[k] > 0.0 { *g * tau[k] } else { Vec3::ZERO };
        }
        let y = inverse.solve(left);
        for (k, g) in rows.iter().enumerate() {
            tau[k] += if give[k] > 0.0 { give[k] * g.dot(y) } else { 0.0 };
        }
        Self { tau, sound }
    }
}

/// [`allocate`], compiled once for four rows and once for any number.
#[inline(always)]
fn allocate_rows<R: AsRef<[Vec3]> + ?Sized>(rows: &R, limits: &JointLimits, wanted: Vec3) -> Allocation {
    let rows = rows.as_ref();
    if !wanted.is_finite() {
        return Allocation::nothing(0.0, false);
    }
    // A direction of size about 1: nothing below over- or underflows however large or small T is.
    let size = wanted.abs().max_element();
    if size == 0.0 {
        return Allocation::nothing(1.0, false);
    }
    let u = wanted / size;
    let least = LeastCost::of(rows, limits, u);
    if !least.sound {
        return allocate_any(rows, limits, u, size);
    }
    let mut torque = [0.0; MAX_JOINTS];
    let mut within = true;
    for k in 0..rows.len() {
        torque[k] = least.tau[k] * size;
        // A joint that gives nothing has no torque here, whatever its peak says.
        within &= fabs(torque[k]) <= limits.peak[k] || torque[k] == 0.0;
    }
    if within {
        return Allocation { torque, scale: 1.0, deficient: false };
    }
    let four = match <&[Vec3; 4]>::try_from(rows) {
        Ok(four) if four.iter().all(|g| g.is_finite()) => four,
        _ => return allocate_any(rows, limits, u, size),
    };
    let peak = [0, 1, 2, 3].map(|k| if limits.driven(k) { limits.peak[k] } else { 0.0 });
    let tau = [least.tau[0], least.tau[1], least.tau[2], least.tau[3]];
    let (tau, reached) = pair::saturated(four, &peak, &tau, u, size);
    torque = [0.0; MAX_JOINTS];
    torque[..4].copy_from_slice(&tau);
    Allocation { torque, scale: if reached < size { reached / size } else { 1.0 }, deficient: false }
}

/// Any number of rows of any rank.
#[inline(never)]
fn allocate_any(rows: &[Vec3], limits: &JointLimits, u: Vec3, size: Real) -> Allocation {
    let Some(reach) = Reach::of(rows, limits) else {
        return Allocation::nothing(0.0, true);
    };
    let parts = reach.parts(u);
    let shares = weak::shares(&reach, parts);
    let (mut x, mut scale, mut made) = ([0.0; MAX_JOINTS], 0.0, [0.0; 3]);
    for Share { kept, held, part } in shares {
        if part > 0.0 {
            let target = [0, 1, 2].map(|k| if k < kept { parts[k] } else { 0.0 });
            let (solution, reached) = reach.solve(held, target, size);
            for k in 0..MAX_JOINTS {
                x[k] += part * solution[k];
            }
            for k in 0..3 {
                made[k] += part * target[k] * Real::min(reached * size, Real::MAX);
            }
            scale += part * reached;
        }
    }
    let torque = reach.scatter(&x, limits);
    let deficient = weak::loses(&shares, parts) || (shares[0].part < 1.0 && reach.strays(&x, made));
    Allocation { torque, scale: Real::min(1.0, scale), deficient }
}

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;
