//! Measurement of computing time. Everything that is compared is warmed up and measured in turn,
//! with many samples. Results are medians with quartiles.

use std::hint::black_box;
use std::time::{Duration, Instant};

use hbot_plot::short;

/// A piece of code whose time is measured. It is run a given number of times.
pub(crate) struct Timed<'a> {
    run: Box<dyn FnMut(u64) + 'a>,
    /// Number of units of work in one run, such as ticks. The reported time is that of one unit.
    unit: f64,
}

impl<'a> Timed<'a> {
    /// Prepares the function `what` for timing. Its result is kept, so that the compiler cannot
    /// remove the code.
    pub(crate) fn new<R>(mut what: impl FnMut() -> R + 'a) -> Self {
        let run = move |times| {
            for _ in 0..times {
                black_box(what());
            }
        };
        Self { run: Box::new(run), unit: 1.0 }
    }

    /// States that one run does `unit` units of work. The reported time is then that of one unit.
    pub(crate) fn in_units_of(self, unit: f64) -> Self {
        Self { unit, ..self }
    }
}

/// A measured computing time with its spread over the samples, ns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Time {
    /// Median of the samples, ns.
    pub(crate) median: f64,
    /// Lower quartile of the samples, ns.
    pub(crate) q1: f64,
    /// Upper quartile of the samples, ns.
    pub(crate) q3: f64,
    /// Shortest sample, ns.
    pub(crate) least: f64,
    /// Number of samples.
    pub(crate) samples: usize,
}

/// Returns the least of `samples`, their quartiles and their median, in ascending order.
fn quartiles(mut samples: Vec<f64>) -> [f64; 4] {
    samples.sort_by(f64::total_cmp);
    [0.0, 0.25, 0.5, 0.75].map(|part| {
        let x = part * (samples.len() - 1) as f64;
        let (low, high) = (x.floor() as usize, x.ceil() as usize);
        samples[low] + (samples[high] - samples[low]) * (x - x.floor())
    })
}

impl Time {
    fn of(samples: &[f64]) -> Self {
        let [least, q1, median, q3] = quartiles(samples.to_vec());
        Self { median, q1, q3, least, samples: samples.len() }
    }
}

/// How much longer one piece of code takes than another, ns. Each round measures both, and the
/// difference of a round is free of what slows both. The quartiles are those of these differences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Difference {
    /// Median of the differences, ns.
    pub(crate) median: f64,
    /// Lower quartile of the differences, ns.
    pub(crate) q1: f64,
    /// Upper quartile of the differences, ns.
    pub(crate) q3: f64,
}

impl Difference {
    fn of(samples: &[f64], others: &[f64]) -> Self {
        let [_, q1, median, q3] = quartiles(samples.iter().zip(others).map(|(a, b)| a - b).collect());
        Self { median, q1, q3 }
    }

    /// Returns the spread of the difference, ns: the distance between its quartiles.
    pub(crate) fn spread(&self) -> f64 {
        self.q3 - self.q1
    }

    /// Returns whether the difference is more than noise: it is positive and larger than its
    /// spread.
    pub(crate) fn is_found(&self) -> bool {
        self.median > self.spread()
    }

    /// Returns the size below which the difference lies if it is not found, ns. It is the spread,
    /// or the size of the quartile that is farther from zero if that is larger.
    pub(crate) fn bound(&self) -> f64 {
        self.spread().max(self.q3.abs()).max(self.q1.abs())
    }

    /// Returns the difference as text, with its unit: `51 ns`, or `below 30 ns` if noise hides it.
    pub(crate) fn told(&self) -> String {
        if self.is_found() {
            format!("{} ns", short(self.median))
        } else {
            // Rounded up, to stay a bound.
            format!("below {:.0} ns", self.bound().ceil().max(1.0))
        }
    }
}

/// Measures the computing time of each element of `what`. Every round measures each element once,
/// so that a period in which the machine is slow affects all of them equally.
///
/// There are 41 rounds (11 if quick). One sample lasts at least 1 ms (300 us if quick).
pub(crate) fn in_turn(quick: bool, what: &mut [Timed<'_>]) -> Vec<Time> {
    let (least, rounds) = effort(quick);
    sampled(what, least, rounds)
}

/// Measures computing times like [`in_turn`]. Also returns how much longer each element takes than
/// the first one.
pub(crate) fn compared(quick: bool, what: &mut [Timed<'_>]) -> Vec<(Time, Difference)> {
    let (least, rounds) = effort(quick);
    let samples = samples(what, least, rounds);
    let each = |of: &Vec<f64>| (Time::of(of), Difference::of(of, &samples[0]));
    samples.iter().map(each).collect()
}

/// Returns how long a sample lasts at least, and how many rounds there are.
fn effort(quick: bool) -> (Duration, usize) {
    if quick { (Duration::from_micros(300), 11) } else { (Duration::from_millis(1), 41) }
}

/// Measures computing times like [`in_turn`], with `rounds` rounds and samples that last at least
/// `least`.
pub(crate) fn sampled(what: &mut [Timed<'_>], least: Duration, rounds: usize) -> Vec<Time> {
    samples(what, least, rounds).iter().map(|samples| Time::of(samples)).collect()
}

/// Returns the time of one unit of work of each element of `what` in each of `rounds` rounds, ns.
fn samples(what: &mut [Timed<'_>], least: Duration, rounds: usize) -> Vec<Vec<f64>> {
    // The search for the number of runs in a sample also serves as the warm-up.
    let mut times = Vec::new();
    for timed in &mut *what {
        let mut count = 1_u64;
        loop {
            let start = Instant::now();
            (timed.run)(count);
            let took = start.elapsed();
            if took >= least {
                break;
            }
            count = if took * 8 < least { count * 4 } else { count * 2 };
        }
        times.push(count);
    }
    let mut samples = vec![Vec::with_capacity(rounds); what.len()];
    for _ in 0..rounds {
        for ((timed, count), samples) in what.iter_mut().zip(&times).zip(&mut samples) {
            let start = Instant::now();
            (timed.run)(*count);
            samples.push(start.elapsed().as_secs_f64() * 1.0e9 / (*count as f64 * timed.unit));
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_of_samples() {
        let time = Time::of(&[5.0, 1.0, 3.0, 2.0, 4.0]);
        assert_eq!((time.median, time.q1, time.q3, time.samples), (3.0, 2.0, 4.0, 5));
        assert_eq!(Time::of(&[1.0, 2.0]).median, 1.5);
    }

    #[test]
    fn a_difference_smaller_than_its_spread_is_no_finding() {
        let none = [100.0; 5];
        let told = |samples: [f64; 5]| Difference::of(&samples, &none).told();
        assert_eq!(told([150.0, 152.0, 151.0, 149.0, 158.0]), "51 ns");
        // Quartiles 5 and 45, the median 20.
        assert_eq!(told([100.0, 105.0, 120.0, 145.0, 190.0]), "below 45 ns");
        // Noise that makes the work seem faster is no gain.
        assert_eq!(told([-121.0, -122.0, -120.5, -119.0, -121.0]), "below 221 ns");
        assert_eq!(told(none), "below 1 ns");
    }

    /// A machine that slows down from round to round changes all times, and no difference.
    #[test]
    fn what_slows_a_whole_round_is_no_difference() {
        let slow = [100.0, 200.0, 400.0, 300.0, 800.0];
        let more = slow.map(|time| time + 7.0);
        assert_eq!(Difference::of(&more, &slow), Difference { median: 7.0, q1: 7.0, q3: 7.0 });
    }
}
