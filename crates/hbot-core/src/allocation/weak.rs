//! How a torque is made of directions in which the driven joints are weak (see [`super::allocate`]).
//!
//! The answer is a mixture: of the exact answer for T, of that for the part of T in the first two principal axes, and of that for the
//! part in the first. The last two need nothing along the axes beyond, and hold it at zero; where these make next to nothing
//! they are given up, as holding them costs the joints' strength: what comes there is left to chance.
//!
//! With P the part of T wanted, z_i = P_i / sigma_i what it asks of the axes, and K the most that torques of least cost are longer
//! than the shortest ones (`Reach::spread`): joint torques that make s P have, as parts of their peaks, a length of at most s K |z|, so
//! along an axis that is given up they make at most sigma_i s K |z|. Beside s |P|² / |T|, what P makes along T, that is
//!
//! ```text
//! stray_i = sigma_i K |z| |T| / |P|²
//! ```
//!
//! and an axis is given up only where that is small. With stray_i <= e what is made is off s P by at most sqrt 2 e |P|, since |P| <= |T|,
//! and it makes at least (1 - sqrt 2 e) s |P|² along T: it never works against T.

use super::reach::Reach;
use super::{LOST, WHOLE};
use crate::real::{Real, fabs, sqrt};

/// How much may stray: an axis is given up for good below the first figure, and not at all above the second. The share of an answer
/// that gives it up, times what strays in it, is at most 0.6 %.
const STRAYS: [Real; 2] = [0.002, 0.02];

/// A part of the answer: the torque in the first `kept` axes, with the first `held` under control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    pub(super) kept: usize,
    pub(super) held: usize,
    pub(super) part: Real,
}

/// The shares of the answer for a torque of these `parts`, 1 in sum, that of the whole torque first.
///
/// Shares that tell two axes apart are nothing where their singular values are equal: which two axes span their plane is then
/// arbitrary, and nothing may depend on it.
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

/// What may come along `axis` if nothing holds it, beside what the first `kept` of these `parts` make along the torque.
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

/// Whether shares leave something of a torque of these `parts` out that counts beside rounding.
pub(super) fn loses(shares: &[Share; 6], parts: [Real; 3]) -> bool {
    let mut lost = 0.0;
    for share in shares {
        for part in &parts[share.kept..] {
            lost += share.part * fabs(*part);
        }
    }
    lost > 1024.0 * Real::EPSILON * (fabs(parts[0]) + fabs(parts[1]) + fabs(parts[2]))
}

/// 0 up to the first of two figures, 1 from the second on.
fn smooth_step(x: Real, [from, to]: [Real; 2]) -> Real {
    let x = Real::max(0.0, Real::min(1.0, (x - from) / (to - from)));
    x * x * (3.0 - 2.0 * x)
}
