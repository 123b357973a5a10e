//! The search for designs that no other design dominates. It takes even samples of all dimensions
//! first, and then steps between the best designs found so far.

use std::collections::BTreeSet;

use super::front::{Archive, Found, Volume, better_by};
use super::local::RatedDevice;
use super::margins::{has_room, keeps};
use super::space::{Design, Parts, Point};
use super::torus::{Effort, Measures, SEARCH, kronecker};
use crate::rng::Rng;
use crate::threads;

/// Number of designs that are measured in parallel.
const BATCH: usize = 128;
/// Number of sample points with which the dominated volume is estimated during a search.
const VOLUME_POINTS: usize = 8192;
/// Largest part of the difference of two designs that a search step adds to a third design
/// (differential evolution: Storn and Price 1997).
const STRIDE: f64 = 0.8;
/// The share of search steps that change only one dimension, and the largest such change relative
/// to the dimension's range.
const NUDGES: (f64, f64) = (0.4, 0.05);
/// Number of attempts to find a new design that leaves room for the wheel modules. If all fail, a
/// known design is used again.
const TRIES: usize = 100;

/// The course and the results of a search among designs with one number of wheels.
#[derive(Debug, Clone)]
pub(super) struct Search {
    pub(super) archive: Archive,
    /// Course of the search: the number of designs measured so far, and the share of
    /// [`BOX`](super::front::BOX) that they dominate.
    pub(super) history: Vec<(usize, f64)>,
    /// Of the designs that were spread evenly: the number that left no room for the wheel modules,
    /// and the number of all.
    pub(super) without_room: [usize; 2],
    /// Number of measured designs with a margin below its bound.
    pub(super) failed: usize,
}

/// Measures `evaluations` designs with `wheels` wheels: first the prototype's dimensions, then one
/// half spread evenly over all dimensions, and one half near the best designs so far. Another seed
/// gives other designs.
pub(super) fn search(parts: &Parts, wheels: usize, evaluations: usize, seed: u64) -> Search {
    let mut rng = Rng(seed);
    let mut run =
        Search { archive: Archive::default(), history: Vec::new(), without_room: [0; 2], failed: 0 };
    let mut volume = Volume::new(VOLUME_POINTS);
    let mut seen = BTreeSet::new();
    let mut even = kronecker(4, rng.unit());
    let mut measured = 0;
    while measured < evaluations {
        let mut batch = Vec::new();
        let first = Point::of(&Design { wheels, ..parts.prototype });
        if seen.is_empty() && has_room(parts, &first.design()) {
            seen.insert(first);
            batch.push(first);
        }
        while batch.len() < BATCH.min(evaluations - measured) {
            let point = if 2 * measured < evaluations || run.archive.members.len() < 4 {
                let unit = even.next().unwrap_or_else(|| unreachable!("the sequence has no end"));
                let Some(point) = run.even(parts, wheels, unit) else { continue };
                point
            } else {
                run.near(parts, wheels, &seen, &mut rng)
            };
            // A repeated design counts as measured, so that every search ends.
            if seen.insert(point) {
                batch.push(point);
            } else {
                measured += 1;
                if measured >= evaluations {
                    break;
                }
            }
        }
        measured += batch.len();
        run.take(&mut volume, measure_all(parts, &batch, SEARCH));
        run.history.push((measured, volume.share()));
    }
    run
}

impl Search {
    /// Returns the design that is nearest to the position `unit` in the space of dimensions, each
    /// scaled to the range 0 to 1. Returns `None` if its dimensions leave no room for the wheels.
    fn even(&mut self, parts: &Parts, wheels: usize, unit: Vec<f64>) -> Option<Point> {
        let point = Point::nearest(wheels, [unit[0], unit[1], unit[2], unit[3]]);
        self.without_room[1] += 1;
        let room = has_room(parts, &point.design());
        self.without_room[0] += usize::from(!room);
        room.then_some(point)
    }

    /// Returns a new design that is similar to the best ones found so far, is not in `seen`, and
    /// leaves room for the wheels. If several tries find none, returns the first of the best
    /// designs.
    fn near(&self, parts: &Parts, wheels: usize, seen: &BTreeSet<Point>, rng: &mut Rng) -> Point {
        (0..TRIES)
            .map(|_| step(&self.archive, wheels, rng))
            .find(|point| !seen.contains(point) && has_room(parts, &point.design()))
            .unwrap_or_else(|| self.archive.members[0].point)
    }

    /// Adds measured designs to the archive of the best ones. Designs that did not keep their
    /// margins are `None`. They are only counted.
    fn take(&mut self, volume: &mut Volume, measured: Vec<Option<Found>>) {
        for found in measured {
            match found {
                Some(found) => {
                    volume.add(&found.measures.costs());
                    self.archive.offer(found);
                }
                None => self.failed += 1,
            }
        }
    }
}

/// Returns a new design near the best ones so far. It either adds part of the difference of two
/// designs to a third, or changes one dimension slightly.
fn step(archive: &Archive, wheels: usize, rng: &mut Rng) -> Point {
    let members = &archive.members;
    let mut pick = || {
        let k = (rng.unit() * members.len() as f64) as usize;
        members[k.min(members.len() - 1)].point.unit()
    };
    let [from, a, b] = [pick(), pick(), pick()];
    let mut unit = from;
    if rng.unit() < NUDGES.0 {
        let k = (rng.unit() * 4.0) as usize % 4;
        unit[k] += NUDGES.1 * rng.between(-1.0, 1.0);
    } else {
        let part = rng.between(0.0, STRIDE);
        unit = core::array::from_fn(|k| from[k] + part * (a[k] - b[k]));
    }
    Point::nearest(wheels, unit)
}

/// Step sizes of [`climb`], largest first, in steps of the search grid.
const CLIMB: [i32; 4] = [12, 5, 2, 1];

/// Improves the design `from` step by step. Each step goes to the neighbour that keeps its margins
/// and exceeds `than` in all figures by the largest factor. Returns the design that no neighbour
/// exceeds.
///
/// Neighbours differ in one or two dimensions, by steps that shrink.
pub(super) fn climb(parts: &Parts, from: Point, than: &Measures) -> Point {
    let (mut here, mut by) = (from, 0.0);
    for stride in CLIMB {
        loop {
            let near = neighbours(here, stride);
            let near: Vec<Point> =
                near.into_iter().filter(|point| has_room(parts, &point.design())).collect();
            let all = measure_all(parts, &near, SEARCH);
            let factor = |found: &Found| better_by(&found.measures, than);
            let best = all.iter().flatten().max_by(|a, b| factor(a).total_cmp(&factor(b)));
            match best {
                Some(found) if factor(found) > by => (here, by) = (found.point, factor(found)),
                _ => break,
            }
        }
    }
    here
}

/// Returns the design `point` and its neighbours, which differ by `stride` grid steps in one or two
/// dimensions.
fn neighbours(point: Point, stride: i32) -> Vec<Point> {
    let mut all = vec![point];
    for i in 0..4 {
        for j in 0..=i {
            for (a, b) in [(stride, stride), (stride, -stride), (-stride, stride), (-stride, -stride)] {
                let mut steps = [0; 4];
                steps[j] = b;
                steps[i] = a;
                all.extend(point.moved(steps).filter(|_| i != j || b == stride));
            }
        }
    }
    all
}

/// Measures designs on all processor cores and returns the results in the order of `points`. A
/// design that does not keep its margins becomes `None`.
pub(super) fn measure_all(parts: &Parts, points: &[Point], effort: Effort) -> Vec<Option<Found>> {
    threads::map(points, |point| {
        let design = point.design();
        let measures = measure(parts, &design, effort);
        let kept = measures.filter(|measures| keeps(parts, &design, measures));
        kept.map(|measures| Found { point: *point, measures })
    })
}

/// Prepares a design for measurement, with the prototype's motors at their peak torques. Returns
/// `None` if the design can become singular.
pub(super) fn machine(parts: &Parts, design: &Design) -> Option<RatedDevice> {
    let [steer, drive] = [parts.rig.joints[0].peak, parts.rig.joints[1].peak];
    Some(RatedDevice::new(parts.device(design)?, [steer, drive]))
}

/// Measures all figures of a design. Returns `None` if the design can become singular.
pub(super) fn measure(parts: &Parts, design: &Design, effort: Effort) -> Option<Measures> {
    Some(Measures::of(&machine(parts, design)?, design, effort))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::research::design::front::dominates;
    use crate::research::design::margins::{MARGINS, margins};

    fn run(seed: u64) -> Search {
        search(&Parts::prototype(), 3, 256, seed)
    }

    #[test]
    fn a_search_finds_designs_that_keep_their_margins_and_none_beats_another() {
        let parts = Parts::prototype();
        let found = run(1);
        let members = &found.archive.members;
        assert!(members.len() > 10 && found.failed > 0, "{} found, {} failed", members.len(), found.failed);
        for member in members {
            let design = member.point.design();
            for (value, margin) in margins(&parts, &design, &member.measures).iter().zip(&MARGINS) {
                assert!(*value >= margin.least, "{design:?}: {} {value}", margin.name);
            }
            assert!(!members.iter().any(|o| dominates(&o.measures.costs(), &member.measures.costs())));
        }
        assert!(found.history.windows(2).all(|pair| pair[0].1 <= pair[1].1), "{:?}", found.history);
        assert_eq!(found.history.last().map(|(measured, _)| *measured), Some(256));
    }

    #[test]
    fn a_seed_finds_the_same_again_and_another_seed_something_else() {
        let [one, again, other] = [run(1), run(1), run(2)];
        assert_eq!(one.archive.members, again.archive.members);
        assert_eq!(one.history, again.history);
        assert_ne!(one.archive.members, other.archive.members);
    }
}
