//! The Pareto front: the designs that no other design dominates, and the share of the space of
//! figures that they dominate.

use super::space::Point;
use super::torus::{Measures, kronecker};

/// The four properties of a design that the search minimises: minus the mean conditioning, minus
/// the peak torque (N m), the apparent inertia (kg m²) and the steering speed.
pub(super) type Costs = [f64; 4];

/// The ranges of the four costs within which the volume dominated by designs is measured.
///
/// Each goes from the worst value to one that no design reaches: conditioning 0.25 to 1, peak
/// torque 0 to 4 N m, apparent inertia 8e-3 to 3.2e-3 kg m² (that of the sphere alone), steering
/// speed 10 to 2.
pub(super) const BOX: [[f64; 2]; 4] = [[-0.25, -1.0], [0.0, -4.0], [8.0e-3, 3.2e-3], [10.0, 2.0]];

/// A design on the search grid, with its measured figures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub(super) point: Point,
    pub(super) measures: Measures,
}

impl Measures {
    pub(super) fn costs(&self) -> Costs {
        [-self.gci, -self.torque, self.inertia, self.speed[0]]
    }
}

/// Returns whether costs `a` dominate costs `b`: they are at least as good in every cost, and
/// better in one.
pub(super) fn dominates(a: &Costs, b: &Costs) -> bool {
    a.iter().zip(b).all(|(a, b)| a <= b) && a != b
}

/// Returns the indices of the elements of `costs` that no other element dominates, in ascending
/// order. Equal elements are all kept.
pub(super) fn front(costs: &[Costs]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..costs.len()).collect();
    // In lexicographic order, dominating costs come before those that they dominate. So each needs
    // to be compared only with the current front.
    order.sort_by(|a, b| {
        let pairs = costs[*a].iter().zip(&costs[*b]);
        pairs.map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(a.cmp(b))
    });
    let mut front: Vec<usize> = Vec::new();
    for k in order {
        if !front.iter().any(|f| dominates(&costs[*f], &costs[k])) {
            front.push(k);
        }
    }
    front.sort_unstable();
    front
}

/// The designs found by a search that no other found design dominates.
#[derive(Debug, Clone, Default)]
pub(super) struct Archive {
    pub(super) members: Vec<Found>,
}

impl Archive {
    /// Adds a design, unless a member dominates or equals it. Removes the members that the new
    /// design dominates.
    pub(super) fn offer(&mut self, found: Found) {
        let costs = found.measures.costs();
        let beaten = |member: &Found| {
            let other = member.measures.costs();
            dominates(&other, &costs) || other == costs
        };
        if self.members.iter().any(beaten) {
            return;
        }
        self.members.retain(|member| !dominates(&costs, &member.measures.costs()));
        self.members.push(found);
    }
}

/// The share of the volume of [`BOX`] that designs dominate. It is estimated as the share of
/// points, spread evenly in the box, that are dominated. More designs never decrease it.
#[derive(Debug, Clone)]
pub(super) struct Volume {
    /// Sample points of the volume that no design dominates yet.
    left: Vec<Costs>,
    points: usize,
}

impl Volume {
    pub(super) fn new(points: usize) -> Self {
        let place = |unit: Vec<f64>| core::array::from_fn(|k| BOX[k][0] + (BOX[k][1] - BOX[k][0]) * unit[k]);
        Self { left: kronecker(4, 0.5).take(points).map(place).collect(), points }
    }

    pub(super) fn add(&mut self, costs: &Costs) {
        self.left.retain(|point| !point.iter().zip(costs).all(|(point, cost)| cost <= point));
    }

    pub(super) fn share(&self) -> f64 {
        1.0 - self.left.len() as f64 / self.points as f64
    }
}

/// Returns the share of the volume of [`BOX`] that designs with the costs `all` dominate, estimated
/// with `points` sample points.
pub(super) fn volume(all: impl Iterator<Item = Costs>, points: usize) -> f64 {
    let mut volume = Volume::new(points);
    all.for_each(|costs| volume.add(&costs));
    volume.share()
}

/// Returns the largest factor by which design `a` is better than design `b` in all four figures at
/// once. It is above 1 only if `a` dominates `b`.
pub(super) fn better_by(a: &Measures, b: &Measures) -> f64 {
    [a.gci / b.gci, a.torque / b.torque, b.inertia / a.inertia, b.speed[0] / a.speed[0]]
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// Returns the index of the best compromise in `all`: the costs that are nearest to the best value
/// of each cost, with each cost scaled to its range in `all`. Returns `None` if `all` is empty.
pub(super) fn compromise(all: &[Costs]) -> Option<usize> {
    let range: [[f64; 2]; 4] = core::array::from_fn(|k| {
        let values = || all.iter().map(|costs| costs[k]);
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    });
    let far = |costs: &Costs| -> f64 {
        let parts = costs.iter().zip(range);
        parts
            .map(|(cost, [low, high])| (cost - low) / (high - low).max(f64::MIN_POSITIVE))
            .map(|x| x * x)
            .sum()
    };
    (0..all.len()).min_by(|a, b| far(&all[*a]).total_cmp(&far(&all[*b])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    fn random(count: usize, levels: f64) -> Vec<Costs> {
        let mut rng = Rng(3);
        // Few levels give many ties, in which errors of dominance are most likely.
        (0..count).map(|_| core::array::from_fn(|_| (rng.unit() * levels).floor())).collect()
    }

    fn brute(costs: &[Costs]) -> Vec<usize> {
        let beaten = |k: usize| {
            costs.iter().any(|other| {
                let better = (0..4).any(|m| other[m] < costs[k][m]);
                let worse = (0..4).any(|m| other[m] > costs[k][m]);
                better && !worse
            })
        };
        (0..costs.len()).filter(|k| !beaten(*k)).collect()
    }

    fn found(costs: Costs, k: usize) -> Found {
        let measures = Measures {
            gci: -costs[0],
            conditioning: 0.0,
            torque: -costs[1],
            torque_low: 0.0,
            inertia: costs[2],
            inertia_mean: 0.0,
            load: 0.0,
            interior: 0.0,
            speed: [costs[3], 0.0],
        };
        Found { point: Point { wheels: 2, at: [k as u32, 0, 0, 0] }, measures }
    }

    #[test]
    fn the_front_is_what_comparing_all_with_all_finds() {
        for levels in [2.0, 4.0, 9.0, 1e6] {
            let costs = random(400, levels);
            assert_eq!(front(&costs), brute(&costs), "{levels} levels");
        }
        assert_eq!(front(&[[0.0; 4], [0.0; 4], [1.0, 0.0, 0.0, 0.0]]), [0, 1]);
    }

    #[test]
    fn an_archive_ends_with_the_front_whatever_the_order() {
        let costs = random(600, 1e6);
        let mut expected = front(&costs);
        for turn in [0, 217] {
            let mut archive = Archive::default();
            for k in (0..costs.len()).map(|k| (k + turn) % costs.len()) {
                archive.offer(found(costs[k], k));
            }
            let mut have: Vec<usize> = archive.members.iter().map(|m| m.point.at[0] as usize).collect();
            have.sort_unstable();
            expected.sort_unstable();
            assert_eq!(have, expected);
        }
        // Of two equal designs the first stays.
        let mut archive = Archive::default();
        archive.offer(found([0.0; 4], 0));
        archive.offer(found([0.0; 4], 1));
        assert_eq!(archive.members.len(), 1);
    }

    /// The dominated share is right for known designs: 1/16 for a design at half of every range,
    /// nothing for a design at the worst corner of the box, and everything for one at the ideal
    /// corner.
    #[test]
    fn the_volume_of_known_fronts() {
        let at = |part: f64| core::array::from_fn(|k| BOX[k][0] + part * (BOX[k][1] - BOX[k][0]));
        // The tolerance allows a few of 16384 points on either side of the boundary.
        assert!((volume([at(0.5)].into_iter(), 16384) - 1.0 / 16.0).abs() < 2e-3);
        assert_eq!(volume([at(0.0)].into_iter(), 16384), 0.0);
        assert_eq!(volume([at(1.0)].into_iter(), 16384), 1.0);
        assert_eq!(volume([at(0.5), at(0.25)].into_iter(), 16384), volume([at(0.5)].into_iter(), 16384));
    }

    #[test]
    fn the_compromise_is_no_extreme() {
        let line: Vec<Costs> = (0..=10).map(|k| [f64::from(k), f64::from(10 - k), 0.0, 0.0]).collect();
        assert_eq!(compromise(&line), Some(5));
        assert_eq!(compromise(&[]), None);
    }
}
