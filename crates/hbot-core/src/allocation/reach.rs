//! The torques that the driven joints can make: their rows in coordinates in which every limit is 1
//! and every direction that they reach is equally strong.

use super::facets::{self, Facet};
use super::problem::Problem;
use super::{JointLimits, LOST, dual};
use crate::device::MAX_JOINTS;
use crate::linear::{Sym3, principal};
use crate::real::{Real, Vec3, fabs, sqrt};

/// Factor on the strength of the strongest single wheel. A direction of torque with this strength
/// counts as fully strong. The strength of a wheel is the torque that it can make in every
/// direction of its contact. For the prototype the strongest direction of all joints together has 6
/// to 8 times this strength, so the factor changes little there.
const WHEELS: Real = 5.0;

/// Smallest permitted level, relative to the largest singular value. The rows have a rounding error
/// of a few units in the last place of that value. With this level, a direction counts as lost
/// before the rounding error exceeds a few percent of the direction's own strength.
const NOISE: Real = 64.0 * Real::EPSILON / LOST;

/// Ratio of the least to the largest singular value below which the moment of the rows is too
/// inaccurate to give the principal axes.
const WEAK: Real = 0.1;

/// The driven rows of G, scaled by their peaks and turned into their principal axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    problem: Problem,
    joint: [usize; MAX_JOINTS],
    axes: [Vec3; 3],
    /// Singular values of the peak-scaled rows, divided by `unit`, largest first.
    sigma: [Real; 3],
    /// Level with which a singular value is compared to decide whether its direction is lost,
    /// divided by `unit`.
    level: Real,
    /// The largest product of a peak and its row, N m. It is the internal unit of torque.
    unit: Real,
}

impl Reach {
    /// Builds the scaled allocation problem from the driven rows among `rows`. Returns `None` if no
    /// joint is driven.
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
            // Costs that differ by more than rounding squared are treated as if they differed by
            // that much.
            cost[i] = Real::max(limits.weight[k] / weight * t * t, Real::EPSILON * Real::EPSILON);
            cheapest = cheapest.min(cost[i]);
        }
        let (values, mut axes) = moment.eigen();
        let mut sigma = values.map(|x| sqrt(x.max(0.0)));
        // The moment gives a singular value only to the square root of rounding. The rows
        // themselves give it to rounding.
        if !(sigma[2] > WEAK * sigma[0]) {
            (sigma, axes) = principal(&scaled[..n], axes);
        }
        let level = Real::max(Real::min(sigma[0], WHEELS * weaker(&scaled[..n], &joint)), NOISE * sigma[0]);
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
            level,
            unit,
        };
        for i in 0..n {
            reach.problem.rows[i] = reach.inward(reach.parts(scaled[i]));
        }
        Some(reach)
    }

    /// Returns the singular values of the peak-scaled rows, divided by the internal unit of torque,
    /// largest first.
    pub(super) fn sigma(&self) -> [Real; 3] {
        self.sigma
    }

    /// Returns the level with which a direction's singular value is compared, divided by the
    /// internal unit of torque.
    pub(super) fn level(&self) -> Real {
        self.level
    }

    /// Returns the largest possible ratio of the length of least-cost joint torques to that of the
    /// shortest ones that make the same torque. Lengths are measured in parts of the peaks.
    ///
    /// Within the limits, the least-cost torques cost no more than the shortest ones. So the ratio
    /// is at most the square root of the ratio of the largest to the least cost factor. At the
    /// limits, no vector of torques is longer than the square root of the number of joints.
    pub(super) fn spread(&self) -> Real {
        let least =
            self.problem.give[..self.problem.n].iter().fold(1.0, |least: Real, give| least.min(*give));
        sqrt(Real::max(1.0 / least, self.problem.n as Real))
    }

    /// Returns the component of a torque along each principal axis, in the unit of the torque.
    pub(super) fn parts(&self, torque: Vec3) -> [Real; 3] {
        self.axes.map(|axis| axis.dot(torque))
    }

    /// Returns the least-cost joint torques for the largest reachable torque up to `size` times
    /// `parts`, and the fraction of `size` that was reached.
    ///
    /// `parts` are components along the principal axes. Only the first `rank` axes are controlled.
    /// Each joint torque is a part of its peak, in the order of the driven joints.
    pub(super) fn solve(&self, rank: usize, parts: [Real; 3], size: Real) -> ([Real; MAX_JOINTS], Real) {
        let (problem, direction) = self.within(rank, parts);
        let (mut x, scale) = self.search(&problem, direction, size);
        // If rows and costs are of similar size, the solution is accurate already.
        if self.sigma[rank - 1] < WEAK * self.sigma[0] || self.spread() * WEAK > 1.0 {
            dual::polish(&problem, direction * Real::min(scale * (size / self.unit), Real::MAX), &mut x);
        }
        (x, scale)
    }

    /// Solves the problem of [`Self::solve`], without the final correction of rounding errors.
    fn search(&self, problem: &Problem, direction: Vec3, size: Real) -> ([Real; MAX_JOINTS], Real) {
        // Limited to a finite value, so that its product with zero is zero.
        let wanted = Real::min(size / self.unit, Real::MAX);
        let y = dual::unlimited(problem, direction);
        if let Some(x) = dual::unsaturated(problem, y, direction, wanted) {
            return (x, 1.0);
        }
        let facet = facets::nearest(problem, direction);
        let (reached, scale) =
            if facet.reach < wanted { (facet.reach, facet.reach * self.unit / size) } else { (wanted, 1.0) };
        if scale < 1.0
            && let Some(x) = facets::on_facet(problem, &facet, direction * reached)
        {
            return (x, scale);
        }
        if let Some(x) = dual::clipped(problem, direction * reached, y * reached) {
            return (x, scale);
        }
        // The costs or rows differ by almost all digits. As the sum of b bᵀ is the unit matrix, the
        // torques b.v make v to within rounding, at equal costs. They are not the cheapest and
        // possibly not the largest, but their direction is right.
        let mut x = problem.rows.map(|b| b.dot(direction));
        let largest = x.iter().fold(0.0, |most: Real, x| most.max(fabs(*x)));
        let reached = Real::min(wanted, 1.0 / largest);
        x = x.map(|x| x * reached);
        (x, reached * self.unit / size)
    }

    /// Returns true if the torque that the joint torques `x` make differs from that of these
    /// `parts` by more than rounding.
    pub(super) fn strays(&self, x: &[Real; MAX_JOINTS], parts: [Real; 3]) -> bool {
        let mut left = parts.map(|part| part / self.unit);
        let mut terms = 0.0;
        for k in 0..self.problem.n {
            let row = self.problem.rows[k] * Vec3::from_array(self.sigma) * x[k];
            for (left, part) in left.iter_mut().zip(row.to_array()) {
                *left -= part;
                terms += fabs(part);
            }
        }
        left.iter().any(|left| fabs(*left) > 1024.0 * Real::EPSILON * terms)
    }

    /// Returns the largest torque along `u`, N m, in the first `rank` principal axes.
    pub(super) fn capability(&self, rank: usize, u: Vec3) -> Real {
        let (problem, direction) = self.within(rank, self.parts(u));
        let Facet { reach, .. } = facets::nearest(&problem, direction);
        reach * self.unit
    }

    /// Converts joint torques from parts of their peaks to N m, in the order steer, drive per
    /// wheel.
    pub(super) fn scatter(&self, x: &[Real; MAX_JOINTS], limits: &JointLimits) -> [Real; MAX_JOINTS] {
        let mut tau = [0.0; MAX_JOINTS];
        for (i, &k) in self.joint[..self.problem.n].iter().enumerate() {
            tau[k] = limits.peak[k] * Real::max(-1.0, Real::min(1.0, x[i]));
        }
        tau
    }

    fn within(&self, rank: usize, parts: [Real; 3]) -> (Problem, Vec3) {
        let keep =
            |v: Vec3| Vec3::new(v.x, if rank > 1 { v.y } else { 0.0 }, if rank > 2 { v.z } else { 0.0 });
        let mut problem = self.problem;
        problem.rank = rank;
        // The weakest axis in use is stretched most, and its rounding with it.
        problem.rounding =
            16.0 * Real::EPSILON * Real::min(self.sigma[0] / self.sigma[rank - 1], 20.0 / WEAK);
        problem.rows = problem.rows.map(keep);
        (problem, keep(self.inward(parts)))
    }

    fn inward(&self, parts: [Real; 3]) -> Vec3 {
        let along = |k: usize| if self.sigma[k] > 0.0 { parts[k] / self.sigma[k] } else { 0.0 };
        Vec3::new(along(0), along(1), along(2))
    }
}

/// Returns the strength of the strongest wheel with two motors, or infinity if there is none. The
/// strength of a wheel is the smaller singular value of its two peak-scaled rows: it makes at least
/// this torque in both directions of its contact.
fn weaker(scaled: &[Vec3], joint: &[usize]) -> Real {
    let mut most: Real = 0.0;
    for i in 1..scaled.len() {
        let (steer, drive) = (scaled[i - 1], scaled[i]);
        if joint[i] % 2 == 1 && joint[i - 1] + 1 == joint[i] {
            // The product of the pair's two singular values, and the sum of their squares.
            let area = steer.cross(drive).length();
            let square = steer.length_squared() + drive.length_squared();
            let root = sqrt(Real::max(0.0, (square - 2.0 * area) * (square + 2.0 * area)));
            most = most.max(area / sqrt(0.5 * (square + root)));
        }
    }
    if most > 0.0 { most } else { Real::INFINITY }
}
