//! Finds signs and rough zeros by trying all of them. Among those that explain the counts well, it
//! chooses the one with the fewest errors in the rig file.

use hbot_core::{MAX_JOINTS, MAX_WHEELS};

use super::{Guess, Search, within};

/// Number of steering zeros, evenly spread over a turn, that the search tries for each wheel.
const GRID: usize = 36;
/// Largest number of steps that the search for signs and zeros uses. The fit that follows uses
/// more of the motion.
const COARSE: usize = 60;
/// Number of guesses that are refined for each combination of signs, best first.
const LOOKED_AT: usize = 6;
/// Smallest difference between two guesses that are both refined, in the steering zero of at least
/// one wheel, rad.
const APART: f64 = 0.4;
/// Error below which a steering zero in the rig file counts as correct, rad.
const RIGHT: f64 = 0.02;
/// A guess is rejected if another one leaves less than this fraction of its slip. Of the remaining
/// guesses, the one that implies the fewest errors in the rig file is chosen.
const BELIEVED: f64 = 0.3;

impl Guess {
    /// Returns a measure of how wrong the rig file is if this guess is true: the number of wrong
    /// signs and zeros, plus a small penalty for the size of each zero's error.
    ///
    /// The penalty decides between guesses that explain the encoder counts equally well, because
    /// nobody overlooks an error of half a turn. For wheels opposite each other, a wrong steering
    /// sign has the same effect as another wheel's zero that is off by half a turn.
    fn wrong(&self, count: usize) -> f64 {
        let flips = self.flipped.iter().filter(|flipped| **flipped).count() as f64;
        let zeros = self.zeros[..count].iter().map(|zero| {
            let off = within(*zero).abs();
            if off < RIGHT { 0.0 } else { 1.0 + 0.1 * off }
        });
        flips + zeros.sum::<f64>()
    }
}

impl Search<'_> {
    /// Finds the signs and rough steering zeros of all wheels: first those of two wheels together,
    /// then those of each further wheel relative to the wheels before it.
    pub(super) fn coarse(&self) -> Guess {
        let mut found = Guess { flipped: [false; MAX_JOINTS], zeros: [0.0; MAX_WHEELS] };
        let first: Vec<Guess> =
            self.variants(&found, 0).flat_map(|guess| self.variants(&guess, 1).collect::<Vec<_>>()).collect();
        found = self.best(&found, first, 2);
        for wheel in 2..self.rig.device.wheels().len() {
            found = self.best(&found, self.variants(&found, wheel).collect(), wheel + 1);
        }
        found
    }

    /// Returns copies of `guess` with all combinations of signs and steering zeros of one wheel.
    fn variants<'b>(&'b self, guess: &Guess, wheel: usize) -> impl Iterator<Item = Guess> + 'b {
        let guess = *guess;
        (0..4 * GRID).map(move |k| {
            let mut other = guess;
            (other.flipped[2 * wheel], other.flipped[2 * wheel + 1]) = (k & 1 != 0, k & 2 != 0);
            other.zeros[wheel] = std::f64::consts::TAU * (k / 4) as f64 / GRID as f64;
            other
        })
    }

    /// Returns the most plausible of `guesses`, judged by the first `count` wheels. For each
    /// combination of signs, it refines the best guesses whose zeros differ clearly. Among the
    /// guesses that then explain the readings well, it chooses the one that implies the fewest
    /// errors in the rig file.
    fn best(&self, filed: &Guess, guesses: Vec<Guess>, count: usize) -> Guess {
        let Some(device) = self.device(count) else { return *filed };
        let every = self.steps.len().div_ceil(COARSE);
        let cost = |guess: &Guess| self.cost(guess, &device, every);
        let mut costed: Vec<(f64, Guess)> = guesses.into_iter().map(|guess| (cost(&guess), guess)).collect();
        costed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut closer: Vec<(f64, Guess)> = Vec::new();
        for (c, guess) in costed {
            let alike = |other: &&(f64, Guess)| other.1.flipped == guess.flipped;
            let near = |other: &(f64, Guess)| {
                (0..count).all(|i| within(other.1.zeros[i] - guess.zeros[i]).abs() < APART)
            };
            if closer.iter().filter(alike).count() < LOOKED_AT && !closer.iter().filter(alike).any(near) {
                closer.push((c, guess));
            }
        }
        for (c, guess) in &mut closer {
            let mut step = std::f64::consts::TAU / GRID as f64;
            while step > 1.0e-4 {
                step *= 0.5;
                for wheel in 0..count {
                    for way in [-step, step] {
                        let mut other = *guess;
                        other.zeros[wheel] += way;
                        let d = cost(&other);
                        if d < *c {
                            (*c, *guess) = (d, other);
                        }
                    }
                }
            }
        }
        let least = closer.iter().map(|(c, _)| *c).fold(f64::INFINITY, f64::min);
        closer
            .into_iter()
            .filter(|(c, _)| *c <= least / (BELIEVED * BELIEVED))
            .min_by(|a, b| a.1.wrong(count).total_cmp(&b.1.wrong(count)))
            .map_or(*filed, |(_, guess)| guess)
    }
}
