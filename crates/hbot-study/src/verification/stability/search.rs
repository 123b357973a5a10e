//! The search for the border of stability: bisection, and whether a swing grows.

/// Width of the range to which the searches for a stability limit narrow it, relative to the limit:
/// 0.01 %. It is a tenth or less of the differences from theory that the study reports.
pub(super) const RESOLUTION: f64 = 1.0e-4;

/// Returns the border between the stiffnesses that are stable and those that are not, N m/rad, by
/// bisection. `unstable` says on which side a stiffness is. The first stiffness of `range` must be
/// stable and the second must not. The result is the geometric mean of the last range, whose width
/// relative to the result is at most `resolution`.
pub(super) fn bisected(range: [f64; 2], resolution: f64, mut unstable: impl FnMut(f64) -> bool) -> f64 {
    let [mut low, mut high] = range;
    while high / low > 1.0 + resolution {
        let middle = (low * high).sqrt();
        if unstable(middle) { high = middle } else { low = middle }
    }
    (low * high).sqrt()
}

/// Finds out whether a swing grows: whether its peaks are higher late in the simulation than early
/// in it.
///
/// The largest sample of a half swing is up to (w h)²/8 below the true peak, with the angular
/// frequency w and the period h: far more than a swing near the border changes. So each peak is
/// that of the parabola through three samples, and all peaks of a fifth of the time are averaged.
pub(super) struct Swing {
    ticks: u32,
    seen: u32,
    /// The last two samples.
    last: [f64; 2],
    /// Sum and number of the peaks in the first fifth of the time, and in the last fifth.
    peaks: [(f64, u32); 2],
    /// Whether a sample was not finite.
    burst: bool,
}

impl Swing {
    /// Creates an observer of a swing that is seen for `ticks` ticks.
    pub(super) fn new(ticks: u32) -> Self {
        Self { ticks, seen: 0, last: [f64::NAN; 2], peaks: [(0.0, 0); 2], burst: false }
    }

    /// Takes the angle at the end of the next tick, rad.
    pub(super) fn see(&mut self, x: f64) {
        let [first, middle] = self.last;
        // A comparison with a sample before the start is false.
        let is_peak = (middle - first) * (x - middle) <= 0.0 && middle != first;
        let part = if self.seen < self.ticks / 5 {
            self.peaks.first_mut()
        } else if self.seen >= self.ticks - self.ticks / 5 {
            self.peaks.last_mut()
        } else {
            None
        };
        if let (true, Some((sum, count))) = (is_peak, part) {
            let bend = first - 2.0 * middle + x;
            *sum += (middle - (first - x) * (first - x) / (8.0 * bend)).abs();
            *count += 1;
        }
        self.burst |= !x.is_finite();
        self.last = [middle, x];
        self.seen += 1;
    }

    /// Returns whether the swing has grown. A swing that no longer has a peak has died, and one
    /// that left the range of numbers has grown.
    pub(super) fn grows(&self) -> bool {
        let [early, late] = self.peaks.map(|(sum, count)| sum / f64::from(count.max(1)));
        self.burst || late > early
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_is_found_to_the_resolution_and_no_better() {
        for border in [1.0, 3.0, 3.999] {
            let mut tries = 0;
            let found = bisected([0.9, 4.0], RESOLUTION, |stiffness| {
                tries += 1;
                stiffness > border
            });
            assert!((found / border - 1.0).abs() <= 0.5 * RESOLUTION, "{found} for {border}");
            // ln(4/0.9) is halved until it is at most ln(1 + 1e-4).
            assert_eq!(tries, 14);
        }
    }

    /// A swing whose height changes by 1e-4 from the first fifth to the last one is on the right
    /// side, although its highest samples say something else.
    #[test]
    fn a_swing_that_hardly_changes_is_judged_by_its_peaks() {
        let ticks = 3000;
        // The samples of the last pace fall on the peaks at first and beside them in the end.
        for pace in [0.03, 0.1, 0.2, core::f64::consts::PI / 30.004] {
            let grows = |growth: f64| {
                let mut swing = Swing::new(ticks);
                for k in 0..ticks {
                    let t = f64::from(k) / f64::from(ticks);
                    swing.see(libm::exp(growth * t) * libm::sin(pace * f64::from(k) + 0.4));
                }
                swing.grows()
            };
            // The distance of the two fifths is 0.8 of the time.
            assert!(grows(1.25e-4) && !grows(-1.25e-4), "{pace}");
        }
    }

    #[test]
    fn a_swing_that_died_or_burst_is_no_riddle() {
        let of = |angle: fn(u32) -> f64| {
            let mut swing = Swing::new(1000);
            (0..1000).for_each(|k| swing.see(angle(k)));
            swing.grows()
        };
        assert!(!of(|k| if k < 300 { f64::from(k % 20) } else { 0.0 }), "it is at rest");
        assert!(of(|k| if k < 300 { f64::from(k % 20) } else { f64::INFINITY }));
        assert!(of(|k| if k < 300 { f64::from(k % 20) } else { f64::NAN }));
    }
}
