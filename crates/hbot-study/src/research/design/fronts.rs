//! The fronts for all numbers of wheels: their best designs, compared with the prototype.

use super::front::{Found, better_by, compromise, dominates, front};
use super::space::WHEELS;
use super::torus::Measures;

/// Names of the four figures by which designs are compared, in the order of
/// [`Costs`](super::front::Costs). They are used in file names.
pub(super) const FIGURES: [&str; 4] = ["conditioning", "torque", "inertia", "steering"];

/// A design of a Pareto front that is worth reporting. `which` names the reason, such as `torque`
/// for the largest torque.
pub(super) struct Best {
    pub(super) which: &'static str,
    pub(super) found: Found,
}

/// The Pareto fronts for all numbers of wheels, and the prototype's figures for comparison. All are
/// measured as thoroughly as reported figures are.
pub(super) struct Fronts {
    /// One Pareto front for each number of wheels, in the order of [`WHEELS`].
    pub(super) each: Vec<Vec<Found>>,
    pub(super) prototype: Measures,
}

impl Fronts {
    /// Returns the Pareto front of the designs with `wheels` wheels.
    pub(super) fn of(&self, wheels: usize) -> &[Found] {
        WHEELS.iter().position(|w| *w == wheels).map_or(&[], |k| &self.each[k])
    }

    /// Returns the designs of all fronts that no design with any number of wheels dominates.
    pub(super) fn joint(&self) -> Vec<Found> {
        let all: Vec<Found> = self.each.iter().flatten().copied().collect();
        let costs: Vec<_> = all.iter().map(|found| found.measures.costs()).collect();
        front(&costs).into_iter().map(|k| all[k]).collect()
    }

    /// Returns the designs with `wheels` wheels that are worth reporting. The first is the
    /// compromise between all figures.
    pub(super) fn best(&self, wheels: usize) -> Vec<Best> {
        let all = self.of(wheels);
        let costs: Vec<_> = all.iter().map(|found| found.measures.costs()).collect();
        let mut best: Vec<Best> = Vec::new();
        best.extend(compromise(&costs).map(|k| Best { which: "compromise", found: all[k] }));
        for (m, which) in FIGURES.into_iter().enumerate() {
            let least = (0..all.len()).min_by(|a, b| costs[*a][m].total_cmp(&costs[*b][m]));
            best.extend(least.map(|k| Best { which, found: all[k] }));
        }
        if let Some((found, by)) = self.nearest_above(wheels)
            && by > 1.0
        {
            best.push(Best { which: "better", found });
        }
        best
    }

    /// Returns the design with `wheels` wheels that exceeds the prototype in all four figures by
    /// the largest factor, and this factor.
    pub(super) fn nearest_above(&self, wheels: usize) -> Option<(Found, f64)> {
        let by = |found: &Found| better_by(&found.measures, &self.prototype);
        let best = self.of(wheels).iter().max_by(|a, b| by(a).total_cmp(&by(b)))?;
        Some((*best, by(best)))
    }

    /// Returns the number of designs with `wheels` wheels that dominate the prototype.
    pub(super) fn dominating(&self, wheels: usize) -> usize {
        let beats = |found: &&Found| dominates(&found.measures.costs(), &self.prototype.costs());
        self.of(wheels).iter().filter(beats).count()
    }
}
