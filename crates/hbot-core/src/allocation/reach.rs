//! What the driven joints can make at all: their rows in coordinates in which every limit is 1 and every direction
//! that they reach is as easy as another.

use super::facets::{self, Facet};
use super::sym::Sym3;
use super::{JointLimits, dual};
use crate::device::MAX_JOINTS;
use crate::real::{Real, Vec3, fabs, sqrt};

/// Rows of G in which joint k gives x_k within +-1 at the cost x_k² / (2 give_k).
///
/// In these coordinates the sum of b_k b_kᵀ is the unit matrix, so no step below depends on units, on the sizes of the
/// limits or on how unevenly the joints turn the sphere. A problem of rank 2 or 1 has zeros in the last coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Problem {
    pub(super) n: usize,
    /// How many coordinates are in use, 1 to 3.
    pub(super) rank: usize,
    pub(super) rows: [Vec3; MAX_JOINTS],
    pub(super) give: [Real; MAX_JOINTS],
    /// Rounding of a row, beside its length.
    pub(super) rounding: Real,
}

/// The driven rows, scaled and turned into their principal axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    problem: Problem,
    joint: [usize; MAX_JOINTS],
    axes: [Vec3; 3],
    /// Singular values of the peak-scaled rows over `unit`, largest first.
    sigma: [Real; 3],
    /// The largest peak times row, N m: the unit of torque inside.
    unit: Real,
}

impl Reach {
    /// The driven rows of `rows`; `None` where no joint gives anything.
    pub(super) fn of(rows: &[Vec3], limits: &JointLimits) -> Option<Self> {
        let mut joint = [0; MAX_JOINTS];
        let mut n = 0;
        let (mut unit, mut peak, mut weight): (Real, Real, Real) = (0.0, 0.0, 0.0);
        for (k, g) in rows.iter().enumerate() {
            let strongest = limits.peak[k] * g.abs().max_element();
            let driven = limits.driven(k) && g.is_finite() && strongest > 0.0 && strongest.is_finite();
            if driven {
                joint[n] = k;
                n += 1;
                unit = unit.max(strongest);
                peak = peak.max(limits.peak[k]);
                weight = weight.max(limits.weight[k]);
            }
        }
        if n == 0 {
            return None;
        }
        let mut scaled = [Vec3::ZERO; MAX_JOINTS];
        let mut cost = [1.0; MAX_JOINTS];
        let mut cheapest: Real = 1.0;
        let mut moment = Sym3::ZERO;
        for (i, &k) in joint[..n].iter().enumerate() {
            scaled[i] = rows[k] * limits.peak[k] / unit;
            moment.add(scaled[i], 1.0);
            let t = limits.peak[k] / peak;
            // Costs further apart than rounding squared are as good as that far apart.
            cost[i] = Real::max(limits.weight[k] / weight * t * t, Real::EPSILON * Real::EPSILON);
            cheapest = cheapest.min(cost[i]);
        }
        let (values, axes) = moment.eigen();
        let sigma = values.map(|x| sqrt(x.max(0.0)));
        let mut reach = Self {
            problem: Problem {
                n,
                rank: 3,
                rows: [Vec3::ZERO; MAX_JOINTS],
                give: cost.map(|c| cheapest / c),
                rounding: 0.0,
            },
            joint,
            axes,
            sigma,
            unit,
        };
        for i in 0..n {
            reach.problem.rows[i] = reach.inward(scaled[i]);
        }
        Some(reach)
    }

    /// sigma_2 / sigma_1 and sigma_3 / sigma_1 of the peak-scaled rows.
    pub(super) fn ratios(&self) -> [Real; 2] {
        [self.sigma[1] / self.sigma[0], self.sigma[2] / self.sigma[0]]
    }

    /// The part of a torque along each principal axis, in its unit.
    pub(super) fn parts(&self, torque: Vec3) -> [Real; 3] {
        self.axes.map(|axis| axis.dot(torque))
    }

    /// The least-cost joint torques for the largest torque up to `size` along `u`, made in the first `rank` principal
    /// axes alone; each as a part of its peak, in the order of the driven joints, and what part of `size` was reached.
    pub(super) fn solve(&self, rank: usize, u: Vec3, size: Real) -> ([Real; MAX_JOINTS], Real) {
        let (problem, direction) = self.within(rank, u);
        // Finite, so that zero times it is zero.
        let wanted = Real::min(size / self.unit, Real::MAX);
        let y = dual::unlimited(&problem, direction);
        if let Some(x) = dual::unsaturated(&problem, y, direction, wanted) {
            return (x, 1.0);
        }
        let facet = facets::nearest(&problem, direction);
        let (reached, scale) =
            if facet.reach < wanted { (facet.reach, facet.reach * self.unit / size) } else { (wanted, 1.0) };
        if scale < 1.0
            && let Some(x) = facets::on_facet(&problem, &facet, direction * reached)
        {
            return (x, scale);
        }
        if let Some(x) = dual::clipped(&problem, direction * reached, y * reached) {
            return (x, scale);
        }
        // Costs or rows apart by almost all digits. As the sum of b bᵀ is the unit matrix, b.v makes v to rounding, at equal
        // costs: not the cheapest and perhaps not the largest, but right in direction.
        let mut x = problem.rows.map(|b| b.dot(direction));
        let largest = x.iter().fold(0.0, |most: Real, x| most.max(fabs(*x)));
        let reached = Real::min(wanted, 1.0 / largest);
        x = x.map(|x| x * reached);
        (x, reached * self.unit / size)
    }

    /// The largest torque along `u` in the first `rank` principal axes.
    pub(super) fn capability(&self, rank: usize, u: Vec3) -> Real {
        let (problem, direction) = self.within(rank, u);
        let Facet { reach, .. } = facets::nearest(&problem, direction);
        reach * self.unit
    }

    /// Joint torques, N m, of parts of the peaks.
    pub(super) fn scatter(&self, x: &[Real; MAX_JOINTS], limits: &JointLimits) -> [Real; MAX_JOINTS] {
        let mut tau = [0.0; MAX_JOINTS];
        for (i, &k) in self.joint[..self.problem.n].iter().enumerate() {
            tau[k] = limits.peak[k] * Real::max(-1.0, Real::min(1.0, x[i]));
        }
        tau
    }

    fn within(&self, rank: usize, u: Vec3) -> (Problem, Vec3) {
        let keep =
            |v: Vec3| Vec3::new(v.x, if rank > 1 { v.y } else { 0.0 }, if rank > 2 { v.z } else { 0.0 });
        let mut problem = self.problem;
        problem.rank = rank;
        // The weakest axis in use is stretched most.
        problem.rounding = 16.0 * Real::EPSILON * self.sigma[0] / self.sigma[rank - 1];
        problem.rows = problem.rows.map(keep);
        (problem, keep(self.inward(u)))
    }

    fn inward(&self, v: Vec3) -> Vec3 {
        let parts = self.parts(v);
        let along = |k: usize| if self.sigma[k] > 0.0 { parts[k] / self.sigma[k] } else { 0.0 };
        Vec3::new(along(0), along(1), along(2))
    }
}

/// How much of the answer comes from all three principal axes, from the first two, and from the first alone.
///
/// Each singular value counts as there by a smooth step of its ratio to the largest, 0 at [`super::LOST`] and 1 at
/// [`super::WHOLE`]. The shares add up to 1, and the share of rank 2 vanishes where the last two singular values
/// are equal: their axes are then any two, and nothing may depend on which.
pub(super) fn shares(ratios: [Real; 2]) -> [Real; 3] {
    let [second, third] = ratios.map(|ratio| {
        let x = Real::max(0.0, Real::min(1.0, (ratio - super::LOST) / (super::WHOLE - super::LOST)));
        x * x * (3.0 - 2.0 * x)
    });
    [third, second - third, 1.0 - second]
}

/// Whether a torque of these parts loses something that counts beside rounding, given the shares of ranks 3, 2, 1.
pub(super) fn loses(parts: [Real; 3], shares: [Real; 3]) -> bool {
    let lost = (1.0 - shares[0]) * fabs(parts[2]) + shares[2] * fabs(parts[1]);
    lost > 1024.0 * Real::EPSILON * (fabs(parts[0]) + fabs(parts[1]) + fabs(parts[2]))
}
