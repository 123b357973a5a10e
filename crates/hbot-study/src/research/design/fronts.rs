//! The fronts of all wheel counts: their best designs, and how they stand to the prototype.

use super::front::{Found, better_by, compromise, dominates, front};
use super::space::WHEELS;
use super::torus::Measures;

/// The four figures that are traded against each other, in the order of costs, as names of files have them.
pub(super) const FIGURES: [&str; 4] = ["conditioning", "torque", "inertia", "steering"];

/// A design of note.
pub(super) struct Best {
    pub(super) which: &'static str,
    pub(super) found: Found,
}

/// The fronts of all wheel counts, each measured as thoroughly as what is told.
pub(super) struct Fronts {
    /// One a wheel count, in the order of [`WHEELS`].
    pub(super) each: Vec<Vec<Found>>,
    pub(super) prototype: Measures,
}

impl Fronts {
    /// The front of one wheel count.
    pub(super) fn of(&self, wheels: usize) -> &[Found] {
        WHEELS.iter().position(|w| *w == wheels).map_or(&[], |k| &self.each[k])
    }

    /// Of each wheel count those that no design of any count beats.
    pub(super) fn joint(&self) -> Vec<Found> {
        let all: Vec<Found> = self.each.iter().flatten().copied().collect();
        let costs: Vec<_> = all.iter().map(|found| found.measures.costs()).collect();
        front(&costs).into_iter().map(|k| all[k]).collect()
    }

    /// The designs of note of one wheel count; the compromise first.
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

    /// The design of a wheel count that is better than the prototype in every figure by the largest factor, and that factor.
    pub(super) fn nearest_above(&self, wheels: usize) -> Option<(Found, f64)> {
        let by = |found: &Found| better_by(&found.measures, &self.prototype);
        let best = self.of(wheels).iter().max_by(|a, b| by(a).total_cmp(&by(b)))?;
        Some((*best, by(best)))
    }

    /// How many designs of a wheel count beat the prototype in all figures.
    pub(super) fn dominating(&self, wheels: usize) -> usize {
        let beats = |found: &&Found| dominates(&found.measures.costs(), &self.prototype.costs());
        self.of(wheels).iter().filter(beats).count()
    }
}
