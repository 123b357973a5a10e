//! Allocates joint torques: finds the joint torques that make a given torque on the sphere (physics
//! notes, section 7).
//!
//! Let T be the torque wanted on the sphere. The allocation finds the largest s in \[0, 1\] for
//! which joint torques tau within their limits satisfy Gᵀ tau = s T. Of all such torques it takes
//! those of least cost 1/2 sum w_j tau_j². Both s and tau are unique. The direction of T is kept;
//! only its size is reduced.
//!
//! The methods, from the fastest to the slowest:
//!
//! 1. The torques of least cost without limits. If none exceeds its limit, they are the result.
//!    [`allocate`] does this itself.
//! 2. For two wheels, closed forms (`pair`).
//! 3. For more wheels, s comes from the facets of the polytope of reachable torques (`facets`).
//!    Then tau comes from the facet, or from a dual problem in three variables (`dual`).
//! 4. If the driven rows of G are close to losing rank, the problem is solved in their principal
//!    axes (`reach`), for the part of T that can be kept (`weak`).
//!
//! Contact forces and the traction limit are computed afterwards (`traction`).

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

use crate::count::Count;
use crate::design::device::{Device, MAX_JOINTS};
use crate::design::rig::Rig;
use crate::linear::Sym3;
use crate::real::{Real, Vec3, fabs};
use reach::Reach;
use weak::Share;

/// Relative strength above which a direction of torque counts as fully available.
///
/// The strength of a direction is a singular value of the peak-scaled driven rows. These are the
/// rows g_j of G that belong to joints with a motor, each times the joint's largest torque t_j. The
/// strength is divided by a reference level, which [`allocate`] defines.
///
/// The prototype with all four motors never falls below 0.119. At 0.01, the torque in the weak
/// direction is only 1 % of that in the strong direction. If the allocation still kept the
/// direction of the wanted torque, all components of the torque would become very small.
pub const WHOLE: Real = 0.01;

/// Relative strength below which a direction of torque counts as lost. It is on the same scale as
/// [`WHOLE`].
///
/// The component of the wanted torque along a lost direction is left out. Between `LOST` and
/// [`WHOLE`], a fraction of the component is made. So the torque does not jump when the strength
/// changes.
pub const LOST: Real = 0.002;

/// Largest torque and cost weight of each joint, in the order steer, drive of each wheel.
///
/// A joint is not driven if it has no motor or a dead one: its peak is then 0. A joint whose peak
/// or weight is zero, negative, infinite or NaN is also treated as not driven.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct JointLimits {
    /// Largest torque t_j of each joint, N m.
    pub peak: [Real; MAX_JOINTS],
    /// Weight w_j of each joint in the cost 1/2 sum w_j tau_j² of the joint torques tau_j. Only
    /// ratios of weights matter. The default weights of [`ContactArms::weights`] are in 1/m².
    pub weight: [Real; MAX_JOINTS],
}

impl JointLimits {
    /// Limits for a rig in which no joint is driven: every peak is 0 and every weight is 1.
    pub const NONE: Self = Self { peak: [0.0; MAX_JOINTS], weight: [1.0; MAX_JOINTS] };

    /// Returns the torque limits of the joints of `rig`, with the default cost weights. With these
    /// weights, the least-cost joint torques are those with the smallest contact forces.
    ///
    /// If the rig knows that a motor makes less torque than it is commanded to make, the limit is
    /// what it makes at its largest command.
    #[must_use]
    pub fn of(rig: &Rig) -> Self {
        Self::of_device(&rig.device, |joint| match &rig.compensation {
            None => rig.joints[joint].peak,
            Some(known) => rig.joints[joint].peak * known.joints[joint].torque_scale.min(1.0),
        })
    }

    /// Returns the torque limits of the joints of `device`, with the default cost weights of
    /// [`ContactArms::weights`].
    ///
    /// `peak` maps the index of a joint to its largest torque, N m.
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
        // A comparison with infinity would become a slow test of the bits of the number.
        t > 0.0 && t <= Real::MAX && w > 0.0 && w <= Real::MAX
    }
}

/// Numbers of the least-cost solution that follow from the joint limits alone. A controller
/// computes them once, and not in every tick.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Gives {
    /// 1/w_j of each driven joint, 0 of the others.
    give: [Real; MAX_JOINTS],
    /// t_j² of each joint.
    square: [Real; MAX_JOINTS],
    /// Number of joints up to the first one that is not driven.
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, MAX_JOINTS>"))]
    driven: usize,
}

impl Gives {
    /// Returns the numbers for the first `joints` joints of `limits`.
    #[inline(always)]
    pub(crate) fn of(limits: &JointLimits, joints: usize) -> Self {
        let mut gives = Self { give: [0.0; MAX_JOINTS], square: [0.0; MAX_JOINTS], driven: 0 };
        for k in 0..joints {
            if limits.driven(k) {
                gives.give[k] = 1.0 / limits.weight[k];
                gives.driven += usize::from(gives.driven == k);
            }
            gives.square[k] = limits.peak[k] * limits.peak[k];
        }
        gives
    }
}

/// The joint torques found for a wanted torque T on the sphere, and the fraction of T that they
/// make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocation {
    /// Joint torques tau, N m, in the order steer, drive of each wheel. Entries beyond the device's
    /// joints are 0.
    pub torque: [Real; MAX_JOINTS],
    /// Fraction s of the wanted torque T that the joint torques make, 0 to 1: Gᵀ tau = s T. It is
    /// below 1 if a joint is at its limit. If `deficient` is true, T here means the part of the
    /// wanted torque that was not left out.
    pub scale: Real,
    /// True if a component of the wanted torque was left out or reduced, because the driven joints
    /// cannot make torque in its direction at this posture.
    pub deficient: bool,
}

impl Allocation {
    /// Returns an allocation with zero torque at every joint.
    const fn nothing(scale: Real, deficient: bool) -> Self {
        Self { torque: [0.0; MAX_JOINTS], scale, deficient }
    }
}

/// Returns the joint torques that make the torque `wanted` on the sphere (in frame N, in N m), as
/// far as the joint limits allow.
///
/// If a joint reaches its limit, the torque becomes smaller but keeps its direction. Of all
/// solutions, the result is the one of least cost. `rows` are the rows of G, in the order steer,
/// drive of each wheel. Rows beyond [`MAX_JOINTS`] are ignored.
///
/// No joint torque exceeds the joint's peak, and none is NaN. If `wanted` is zero, the result is
/// zero torque with a scale of 1. If `wanted` is not finite or no joint is driven, the result is
/// zero torque with a scale of 0.
///
/// # When the driven joints lose a direction
///
/// At some postures the driven joints can make almost no torque in one direction. The component of
/// the wanted torque T in that direction is then reduced or left out, because to keep the direction
/// of T would make all of its components small. [`Allocation::deficient`] is then true.
///
/// In detail, let sigma_i be the singular values of the peak-scaled driven rows, largest first, and
/// u_i their principal axes. Along u_i the joints can make a torque of at least sigma_i, and of at
/// most sigma_i times the square root of the number of joints. A direction is lost if the wheels
/// cancel each other there, so that little is left of what each can make alone. Therefore sigma_i
/// is compared with a level that depends on the strength of single wheels:
///
/// ```text
/// level = min(sigma_1, 5 sigma_w)
/// ```
///
/// For each wheel with two motors, take the smaller singular value of its two peak-scaled rows.
/// sigma_w is the largest of these values. It is a constant of the design. It matters for a wheel
/// with a very small cone angle: at 1e-3 rad its steer joint is about a thousand times as strong as
/// its drive joint. The steer direction is then strong, but the others are no weaker than before. A
/// direction that is dominated by rounding counts as lost in any case.
///
/// Let b_i be a smooth step of sigma_i / level, from 0 at [`LOST`] to 1 at [`WHOLE`]. Let T_i be
/// the component of T along u_i, and tau(P) the exact solution for a torque P. The result is
///
/// ```text
/// b_3 tau(T)  +  (b_2 - b_3) tau(T_1 u_1 + T_2 u_2)  +  (1 - b_2) tau(T_1 u_1)
/// ```
///
/// If all ratios are at least [`WHOLE`], this is tau(T). `scale` is the mean of the three scales
/// with the same factors. No term works against T, so the sum never does. The solution for a part
/// of T holds the torque along the remaining axes at zero. An axis is left uncontrolled if its
/// torque would be below 1 % of the torque made: to hold it would only use up joint torque.
///
/// The result is continuous: it does not jump when the posture or T changes, nor when two singular
/// values become equal.
#[must_use]
pub fn allocate(rows: &[Vec3], limits: &JointLimits, wanted: Vec3) -> Allocation {
    if let Ok(four) = <&[Vec3; 4]>::try_from(rows) {
        allocate_rows(four, limits, &Gives::of(limits, 4), wanted)
    } else {
        let rows = &rows[..rows.len().min(MAX_JOINTS)];
        allocate_rows(rows, limits, &Gives::of(limits, rows.len()), wanted)
    }
}

/// Does the same as [`allocate`], for the `rows` of `count` wheels. `gives` must be those of
/// `limits`. The tick takes the fast method for two wheels inline, because a torque that is passed
/// through memory costs some nanoseconds.
#[inline(always)]
pub(crate) fn allocate_in_tick<C: Count>(
    count: C,
    rows: &[Vec3],
    limits: &JointLimits,
    gives: &Gives,
    wanted: Vec3,
) -> Allocation {
    match rows.first_chunk::<4>() {
        Some(four) if count.joints() == 4 => allocate_rows(four, limits, gives, wanted),
        _ => allocate(rows, limits, wanted),
    }
}

/// Returns the least-cost joint torques for `wanted`, all scaled down by one factor until no joint
/// exceeds its limit. It is a faster substitute for [`allocate`].
///
/// If no joint reaches its limit, the result equals that of [`allocate`]. If a joint does, the
/// torque on the sphere still keeps its direction, but it can be smaller than the best possible
/// one. If the driven rows are close to losing rank, [`allocate`] is called instead.
#[must_use]
pub fn allocate_clipped(rows: &[Vec3], limits: &JointLimits, wanted: Vec3) -> Allocation {
    let rows = &rows[..rows.len().min(MAX_JOINTS)];
    let size = wanted.abs().max_element();
    if size > 0.0 && wanted.is_finite() {
        let least = LeastCost::of(rows, &Gives::of(limits, rows.len()), wanted / size);
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
                // Clamped, because rounding could exceed the limit. A joint that is not driven has
                // 0 here, whatever its peak.
                let tau = least.tau[k] * reached;
                torque[k] =
                    if tau == 0.0 { 0.0 } else { Real::max(-limits.peak[k], Real::min(limits.peak[k], tau)) };
            }
            return Allocation { torque, scale: reached / size, deficient: false };
        }
    }
    allocate(rows, limits, wanted)
}

/// Returns the largest torque on the sphere, N m, that the joints can make along the unit vector
/// `direction` (frame N), with no torque at right angles to it. Returns 0 if the driven joints
/// cannot make torque along `direction`.
///
/// The value is the minimum over pairs i < j of sum_k t_k |g_k.n| / |direction.n| with n = g_i x
/// g_j. g_k are the rows of G and t_k the largest joint torques. Each pair of rows spans a facet of
/// the zonotope of reachable torques.
#[must_use]
pub fn capability(rows: &[Vec3], limits: &JointLimits, direction: Vec3) -> Real {
    // A singular value below this fraction of the largest is rounding.
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

/// The least-cost joint torques that make a torque in a given direction, if joints have no limits.
struct LeastCost {
    tau: [Real; MAX_JOINTS],
    /// True if `tau` is accurate enough to use: the driven rows of G are far from losing rank.
    sound: bool,
}

impl LeastCost {
    #[inline(always)]
    fn of(rows: &[Vec3], gives: &Gives, u: Vec3) -> Self {
        if rows.len() <= gives.driven {
            Self::of_driven::<true>(rows, gives, u)
        } else {
            Self::of_driven::<false>(rows, gives, u)
        }
    }

    /// Implements [`of`](Self::of). `ALL` is true if all joints are driven, which saves the
    /// question for each joint.
    #[inline(always)]
    fn of_driven<const ALL: bool>(rows: &[Vec3], gives: &Gives, u: Vec3) -> Self {
        // Below this ratio of determinant to spread, rounding dominates the solution.
        const SPOILT: Real = if Real::EPSILON < 1.0e-10 { 1.0e-6 } else { 1.0e-4 };
        let give = &gives.give;
        let (mut moment, mut peaks) = (Sym3::ZERO, Sym3::ZERO);
        for (k, g) in rows.iter().enumerate() {
            if ALL || give[k] > 0.0 {
                moment.add(*g, give[k]);
                peaks.add(*g, gives.square[k]);
            }
        }
        let peaks = peaks.adjugate();
        let inverse = moment.adjugate();
        let sound = peaks.rank_above(WHOLE * WHOLE) && inverse.rank_above(SPOILT);
        let mut tau = [0.0; MAX_JOINTS];
        let y = inverse.solve(u);
        for (k, g) in rows.iter().enumerate() {
            // The row of a joint that is not driven can hold anything, even NaN.
            tau[k] = if ALL || give[k] > 0.0 { give[k] * g.dot(y) } else { 0.0 };
        }
        // One step of iterative refinement. The adjugate alone loses accuracy with the square of
        // the rows' condition number.
        let mut left = u;
        for (k, g) in rows.iter().enumerate() {
            left -= if ALL || give[k] > 0.0 { *g * tau[k] } else { Vec3::ZERO };
        }
        let y = inverse.solve(left);
        for (k, g) in rows.iter().enumerate() {
            tau[k] += if ALL || give[k] > 0.0 { give[k] * g.dot(y) } else { 0.0 };
        }
        Self { tau, sound }
    }
}

/// Implements [`allocate`]. The compiler makes two copies: a fast one for exactly four rows, and
/// one for any number of rows.
#[inline(always)]
fn allocate_rows<R: AsRef<[Vec3]> + ?Sized>(
    rows: &R,
    limits: &JointLimits,
    gives: &Gives,
    wanted: Vec3,
) -> Allocation {
    let rows = rows.as_ref();
    if !wanted.is_finite() {
        return Allocation::nothing(0.0, false);
    }
    // Scaled to a size of about 1, so that no step below overflows or underflows, however large or
    // small T is.
    let size = wanted.abs().max_element();
    if size == 0.0 {
        return Allocation::nothing(1.0, false);
    }
    let u = wanted / size;
    let least = LeastCost::of(rows, gives, u);
    if !least.sound {
        return allocate_any(rows, limits, u, size);
    }
    let mut torque = [0.0; MAX_JOINTS];
    let mut within = true;
    for k in 0..rows.len() {
        torque[k] = least.tau[k] * size;
        // A joint that is not driven has zero torque here, whatever its peak.
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

/// Allocates the torque `size * u` for any number of rows of G, also if they lose rank. Slower than
/// the method for rows that are far from losing rank.
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
