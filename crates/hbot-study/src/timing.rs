//! Measurement of computing time. Everything that is compared is warmed up and measured in turn,
//! with many samples. Results are medians with quartiles.

use std::hint::black_box;
use std::time::{Duration, Instant};

use crate::context::{Context, Interrupted};

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

impl Time {
    fn of(mut samples: Vec<f64>) -> Self {
        samples.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let x = part * (samples.len() - 1) as f64;
            let (low, high) = (x.floor() as usize, x.ceil() as usize);
            samples[low] + (samples[high] - samples[low]) * (x - x.floor())
        };
        Self { median: at(0.5), q1: at(0.25), q3: at(0.75), least: at(0.0), samples: samples.len() }
    }
}

/// Measures the computing time of each element of `what`. Every round measures each element once,
/// so that a period in which the machine is slow affects all of them equally.
///
/// There are 41 rounds (11 if quick). One sample lasts at least 1 ms (300 us if quick).
///
/// # Errors
///
/// Fails if the study was asked to stop.
pub(crate) fn in_turn(context: &Context, what: &mut [Timed<'_>]) -> Result<Vec<Time>, Interrupted> {
    let (least, rounds) =
        if context.quick { (Duration::from_micros(300), 11) } else { (Duration::from_millis(1), 41) };
    sampled(context, what, least, rounds)
}

/// Measures computing times like [`in_turn`], with `rounds` rounds and samples that last at least
/// `least`.
pub(crate) fn sampled(
    context: &Context,
    what: &mut [Timed<'_>],
    least: Duration,
    rounds: usize,
) -> Result<Vec<Time>, Interrupted> {
    // The search for the number of runs in a sample also serves as the warm-up.
    let mut times = Vec::new();
    for timed in &mut *what {
        context.go_on()?;
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
        context.go_on()?;
        for ((timed, count), samples) in what.iter_mut().zip(&times).zip(&mut samples) {
            let start = Instant::now();
            (timed.run)(*count);
            samples.push(start.elapsed().as_secs_f64() * 1.0e9 / (*count as f64 * timed.unit));
        }
    }
    Ok(samples.into_iter().map(Time::of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Interrupt;

    #[test]
    fn quartiles_of_samples() {
        let time = Time::of(vec![5.0, 1.0, 3.0, 2.0, 4.0]);
        assert_eq!((time.median, time.q1, time.q3, time.samples), (3.0, 2.0, 4.0, 5));
        assert_eq!(Time::of(vec![1.0, 2.0]).median, 1.5);
    }

    #[test]
    fn a_study_that_is_stopped_times_nothing() {
        let interrupt = Interrupt::default();
        interrupt.raise();
        let context = Context::new("test", true, &interrupt);
        assert_eq!(in_turn(&context, &mut [Timed::new(|| 1)]), Err(Interrupted));
    }
}
