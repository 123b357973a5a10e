//! The torques that the driven joints can make: their rows in coordinates in which every limit is 1
//! and every direction that they reach is equally strong.

use super::facets::{self, Facet};
use super::problem::Problem;
use super::{JointLimits, LOST, dual};
use crate::design::device::MAX_JOINTS;
use crate::linear::{Sym3, principal};
use crate::real::{Real, Vec3, fabs, sqrt};

/// Strength at which a direction of torque counts as fully strong, as a multiple of the strength of
/// the strongest single wheel. The strength of a wheel is the torque that it can make in every
/// direction of its contact. For the prototype, the strongest direction of all joints together has
/// 6 to 8 times this strength, so the factor changes little there.
const WHEELS: Real = 5.0;

/// Smallest permitted reference level for the strength of a direction, relative to the largest
/// singular value. Rounding errors of the rows are a few units in the last place of that value.
/// With this level, a direction counts as lost before its rounding error exceeds a few percent of
/// its own strength.
const NOISE: Real = 64.0 * Real::EPSILON / LOST;

/// Smallest ratio of the smallest to the largest singular value at which the moment matrix gives
/// accurate principal axes. The moment matrix is the sum of the rows' outer products. Below this
/// ratio, the axes are computed from the rows themselves.
const WEAK: Real = 0.1;

/// The driven rows of G, each times the largest torque of its joint, in the coordinates of their
/// principal axes. It describes which torques the driven joints can reach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    problem: Problem,
    joint: [usize; MAX_JOINTS],
    axes: [Vec3; 3],
    /// Singular values of the peak-scaled rows, divided by `unit`, in descending order.
    sigma: [Real; 3],
    /// Reference level for the singular values, divided by `unit`. A direction whose singular value
    /// is much smaller than this level counts as lost.
    level: Real,
    /// Internal unit of torque, N m: the largest component of a row of G times its joint's largest
    /// torque.
    unit: Real,
}

impl Reach {
    /// Builds the scaled allocation problem from those rows of G that belong to driven joints.
    /// Returns `None` if no joint is driven.
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

    /// Returns the strengths of the three principal axes: the singular values of the peak-scaled
    /// rows, divided by the internal unit of torque, in descending order.
    pub(super) fn sigma(&self) -> [Real; 3] {
        self.sigma
    }

    /// Returns the reference level for the strength of a direction, divided by the internal unit of
    /// torque. A direction that is much weaker than this level counts as lost.
    pub(super) fn level(&self) -> Real {
        self.level
    }

    /// Returns an upper bound on the length of the least-cost joint torques, relative to that of
    /// the shortest joint torques that make the same torque on the sphere. For lengths, each joint
    /// torque is taken as a fraction of its peak.
    ///
    /// Within the limits, the least-cost torques cost no more than the shortest ones. So the ratio
    /// is at most the square root of the largest cost factor divided by the smallest. At the
    /// limits, no vector of joint torques is longer than the square root of the number of joints.
    pub(super) fn spread(&self) -> Real {
        let least =
            self.problem.give[..self.problem.n].iter().fold(1.0, |least: Real, give| least.min(*give));
        sqrt(Real::max(1.0 / least, self.problem.n as Real))
    }

    /// Returns the components of `torque` along the three principal axes, in the unit of `torque`.
    pub(super) fn parts(&self, torque: Vec3) -> [Real; 3] {
        self.axes.map(|axis| axis.dot(torque))
    }

    /// Returns the least-cost joint torques for the largest reachable torque up to `size * parts`,
    /// and the fraction of `size` that they reach.
    ///
    /// `parts` are the components of the torque along the principal axes. Only the torque along the
    /// first `rank` axes is controlled. Each joint torque is given as a fraction of its peak, in
    /// the order of the driven joints.
    pub(super) fn solve(&self, rank: usize, parts: [Real; 3], size: Real) -> ([Real; MAX_JOINTS], Real) {
        let (problem, direction) = self.within(rank, parts);
        let (mut x, scale) = self.search(&problem, direction, size);
        // If rows and costs are of similar size, the solution is accurate already.
        if self.sigma[rank - 1] < WEAK * self.sigma[0] || self.spread() * WEAK > 1.0 {
            dual::polish(&problem, direction * Real::min(scale * (size / self.unit), Real::MAX), &mut x);
        }
        (x, scale)
    }

    /// Solves the problem of [`Self::solve`], without its final correction of rounding errors.
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

    /// Returns true if the joint torques `x` do not make the torque with the components `parts`
    /// along the principal axes. Rounding errors are ignored.
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

    /// Returns the largest torque along `u` that the joints can make, N m, if only the torque along
    /// the first `rank` principal axes is controlled.
    pub(super) fn capability(&self, rank: usize, u: Vec3) -> Real {
        let (problem, direction) = self.within(rank, self.parts(u));
        let Facet { reach, .. } = facets::nearest(&problem, direction);
        reach * self.unit
    }

    /// Converts joint torques from fractions of their peaks to N m. The result has the order steer,
    /// drive of each wheel.
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

/// Returns the strength of the strongest wheel that has two motors, or infinity if no wheel has
/// two. The strength of a wheel is the smaller singular value of its two peak-scaled rows. The
/// wheel can make at least this torque in both directions of its contact.
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
