//! Allocates torque if the driven joints are weak in some directions (see [`super::allocate`]).
//!
//! The result is a weighted mean of three exact solutions: for T, for the part of T in the first
//! two principal axes, and for the part in the first axis. The last two ask for no torque along the
//! remaining axes and hold it at zero. An axis along which the joints can make almost nothing is
//! not held, because to hold it uses up joint torque. The small torque along it is then
//! uncontrolled.
//!
//! Let P be the part of T that is wanted, and z_i = P_i / sigma_i its components relative to the
//! strengths of the axes. Let K be the largest ratio of the length of the least-cost torques to
//! that of the shortest torques that make the same (`Reach::spread`). Measured as parts of their
//! peaks, joint torques that make s P have a length of at most s K |z|. Along an axis that is not
//! held they make at most sigma_i s K |z|. Relative to s |P|² / |T|, which is what P makes along T,
//! this is
//!
//! ```text
//! stray_i = sigma_i K |z| |T| / |P|²
//! ```
//!
//! An axis is left uncontrolled only if its stray torque is small. For stray_i <= e, the torque
//! made differs from s P by at most sqrt 2 e |P|, since |P| <= |T|. Along T it makes at least (1 -
//! sqrt 2 e) s |P|², so it never works against T.

use super::reach::Reach;
use super::{LOST, WHOLE};
use crate::real::{Real, fabs, sqrt};

/// Two limits on the stray torque of an axis: the torque along the axis if it is left uncontrolled,
/// as a fraction of the torque made. Below the first limit the axis is left uncontrolled, and above
/// the second it is fully controlled. With these limits, uncontrolled axes add at most 0.6 % of
/// stray torque to the result.
const STRAYS: [Real; 2] = [0.002, 0.02];

/// One term of a weighted mean of solutions. The mean replaces the exact solution if the joints are
/// weak in some directions. The term makes the torque along the first `kept` principal axes and
/// controls the torque along the first `held` axes. `part` is the weight of the term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    pub(super) kept: usize,
    pub(super) held: usize,
    pub(super) part: Real,
}

/// Returns the terms of the weighted mean of solutions for a torque with the components `parts`
/// along the principal axes. The weights add up to 1. The first term is the solution for the whole
/// torque.
///
/// If the singular values of two axes are equal, any two axes in their plane could be chosen, and
/// the result must not depend on the choice. Terms that treat these two axes differently then have
/// weight zero.
pub(super) fn shares(reach: &Reach, parts: [Real; 3]) -> [Share; 6] {
    let [_, second, third] = reach.sigma().map(|sigma| smooth_step(sigma / reach.level(), [LOST, WHOLE]));
    let [line, plane, whole] = [1.0 - second, second - third, third];
    let held = |kept, axis| smooth_step(stray(reach, parts, kept, axis), STRAYS);
    let [over_plane, over_line, besides] = [held(2, 2), held(1, 2), held(1, 1)];
    [
        (3, 3, whole),
        (2, 3, plane * over_plane),
        (2, 2, plane * (1.0 - over_plane)),
        (1, 3, line * over_line),
        (1, 2, line * (besides - over_line)),
        (1, 1, line * (1.0 - besides)),
    ]
    .map(|(kept, held, part)| Share { kept, held, part })
}

/// Returns the largest possible torque along `axis` if it is not controlled. The torque is relative
/// to the torque that the first `kept` components of `parts` make along the wanted torque.
fn stray(reach: &Reach, parts: [Real; 3], kept: usize, axis: usize) -> Real {
    let sigma = reach.sigma();
    let (mut whole, mut wanted, mut effort): (Real, Real, Real) = (0.0, 0.0, 0.0);
    for k in 0..3 {
        whole += parts[k] * parts[k];
        if k < kept && sigma[k] > 0.0 {
            wanted += parts[k] * parts[k];
            effort += parts[k] / sigma[k] * (parts[k] / sigma[k]);
        }
    }
    if wanted > 0.0 { sigma[axis] * reach.spread() * sqrt(effort * whole) / wanted } else { 0.0 }
}

/// Returns true if the weighted mean of the terms `shares` leaves out more than rounding of a
/// torque with the components `parts` along the principal axes.
pub(super) fn loses(shares: &[Share; 6], parts: [Real; 3]) -> bool {
    let mut lost = 0.0;
    for share in shares {
        for part in &parts[share.kept..] {
            lost += share.part * fabs(*part);
        }
    }
    lost > 1024.0 * Real::EPSILON * (fabs(parts[0]) + fabs(parts[1]) + fabs(parts[2]))
}

/// Returns 0 if `x` is at most `from`, 1 if `x` is at least `to`, and a smooth cubic in between.
fn smooth_step(x: Real, [from, to]: [Real; 2]) -> Real {
    let x = Real::max(0.0, Real::min(1.0, (x - from) / (to - from)));
    x * x * (3.0 - 2.0 * x)
}
