//! What the driven joints can make at all: their rows in coordinates in which every limit is 1 and every direction
//! that they reach is as easy as another.

use super::facets::{self, Facet};
use super::problem::Problem;
use super::{JointLimits, LOST, dual};
use crate::device::MAX_JOINTS;
use crate::linear::{Sym3, principal};
use crate::real::{Real, Vec3, fabs, sqrt};

/// Times what a wheel gives in both directions of its contact: a direction of that strength is as strong as motors are meant to be.
/// The strongest direction of the prototype gives six to eight times it, so there both measures are about the same.
const WHEELS: Real = 5.0;

/// Level, beside the largest singular value, at which a direction is lost before rounding of the rows, some units of that
/// value, is more than some parts in a hundred of its own.
const NOISE: Real = 64.0 * Real::EPSILON / LOST;

/// Least over largest singular value below which the moment of the rows knows the axes too badly.
const WEAK: Real = 0.1;

/// The driven rows, scaled and turned into their principal axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    problem: Problem,
    joint: [usize; MAX_JOINTS],
    axes: [Vec3; 3],
    /// Singular values of the peak-scaled rows over `unit`, largest first.
    sigma: [Real; 3],
    /// What a direction's singular value is held against, over `unit`.
    level: Real,
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
        let (values, mut axes) = moment.eigen();
        let mut sigma = values.map(|x| sqrt(x.max(0.0)));
        // The moment knows a singular value to the root of rounding, the rows themselves to rounding.
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

    /// Singular values of the peak-scaled rows over `unit`, largest first.
    pub(super) fn sigma(&self) -> [Real; 3] {
        self.sigma
    }

    /// What a direction's singular value is held against.
    pub(super) fn level(&self) -> Real {
        self.level
    }

    /// How much longer, at most, torques of least cost are than the shortest that make the same, as parts of their peaks.
    ///
    /// Up to the limits their cost is not above that of the shortest, so the root of the ratio of two costs; beyond them no x is longer than
    /// the root of their number.
    pub(super) fn spread(&self) -> Real {
        let least =
            self.problem.give[..self.problem.n].iter().fold(1.0, |least: Real, give| least.min(*give));
        sqrt(Real::max(1.0 / least, self.problem.n as Real))
    }

    /// The part of a torque along each principal axis, in its unit.
    pub(super) fn parts(&self, torque: Vec3) -> [Real; 3] {
        self.axes.map(|axis| axis.dot(torque))
    }

    /// The least-cost joint torques for the largest torque up to `size` times that of these `parts`, made in the first `rank` principal
    /// axes alone; each as a part of its peak, in the order of the driven joints, and what part of `size` was reached.
    pub(super) fn solve(&self, rank: usize, parts: [Real; 3], size: Real) -> ([Real; MAX_JOINTS], Real) {
        let (problem, direction) = self.within(rank, parts);
        let (mut x, scale) = self.search(&problem, direction, size);
        // Rows and costs that are not far apart leave nothing to do.
        if self.sigma[rank - 1] < WEAK * self.sigma[0] || self.spread() * WEAK > 1.0 {
            dual::polish(&problem, direction * Real::min(scale * (size / self.unit), Real::MAX), &mut x);
        }
        (x, scale)
    }

    /// [`Self::solve`], to what the search leaves.
    fn search(&self, problem: &Problem, direction: Vec3, size: Real) -> ([Real; MAX_JOINTS], Real) {
        // Finite, so that zero times it is zero.
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
        // Costs or rows apart by almost all digits. As the sum of b bᵀ is the unit matrix, b.v makes v to rounding, at equal
        // costs: not the cheapest and perhaps not the largest, but right in direction.
        let mut x = problem.rows.map(|b| b.dot(direction));
        let largest = x.iter().fold(0.0, |most: Real, x| most.max(fabs(*x)));
        let reached = Real::min(wanted, 1.0 / largest);
        x = x.map(|x| x * reached);
        (x, reached * self.unit / size)
    }

    /// Whether the torque that x makes is off that of these `parts` by more than counts beside rounding.
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

    /// The largest torque along `u` in the first `rank` principal axes.
    pub(super) fn capability(&self, rank: usize, u: Vec3) -> Real {
        let (problem, direction) = self.within(rank, self.parts(u));
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

    fn within(&self, rank: usize, parts: [Real; 3]) -> (Problem, Vec3) {
        let keep =
            |v: Vec3| Vec3::new(v.x, if rank > 1 { v.y } else { 0.0 }, if rank > 2 { v.z } else { 0.0 });
        let mut problem = self.problem;
        problem.rank = rank;
        // The weakest axis in use is stretched most.
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

/// The most that a wheel with both motors gives in each of the two directions of its contact; infinite where there is none.
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
