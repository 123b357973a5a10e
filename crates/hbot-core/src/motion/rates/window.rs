//! The adaptive window of Janabi-Sharifi, Hayward and Chen (2000), in its end-fit form. The rate of
//! each joint is the slope of the longest chord back from the last reading that passes within a
//! tolerance of every reading in between.
//!
//! All steps use integers, so the result is the same in any width of reals. A chord passes a
//! reading if its slope is between two bounds. So one walk back through the readings, which narrows
//! the bounds, finds the longest chord. It takes at most [`LONGEST_WINDOW`] steps of a few
//! multiplications per joint, and stops when no longer chord can pass.

use crate::design::device::MAX_JOINTS;
use crate::design::rig::LONGEST_WINDOW;
use crate::real::Real;

const DEPTH: usize = LONGEST_WINDOW as usize;
/// Largest index of a ring buffer, for the check of a state that is read from a recording.
#[cfg(feature = "exact")]
const NEWEST: usize = DEPTH - 1;

/// The last readings of all joints, from which the adaptive-window method computes joint rates. A
/// rate is the slope of a chord: a straight line from an earlier reading to the last one.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Window {
    /// Largest permitted distance between a chord and the readings in between, in encoder counts. A
    /// chord is a straight line between two readings, whose slope is the estimated rate.
    tolerance: i64,
    /// Longest permitted duration of a chord, ticks. A chord is a straight line between two
    /// readings, whose slope is the estimated rate.
    longest: i64,
    /// Changes of the encoder counts between consecutive readings: a ring buffer for each joint.
    #[cfg_attr(feature = "exact", serde(with = "exact"))]
    counts: [[i32; DEPTH]; MAX_JOINTS],
    /// Ticks between consecutive readings: a ring buffer.
    #[cfg_attr(feature = "exact", serde(with = "serde_big_array::BigArray"))]
    ticks: [u32; DEPTH],
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, NEWEST>"))]
    newest: usize,
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 0, DEPTH>"))]
    known: usize,
}

/// Writes and reads the ring buffers of all joints. serde alone has no arrays of more than 32
/// values.
#[cfg(feature = "exact")]
mod exact {
    use super::{DEPTH, MAX_JOINTS};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use serde_big_array::Array;

    pub(super) fn serialize<S: Serializer>(
        counts: &[[i32; DEPTH]; MAX_JOINTS],
        into: S,
    ) -> Result<S::Ok, S::Error> {
        counts.map(Array).serialize(into)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<[[i32; DEPTH]; MAX_JOINTS], D::Error> {
        Ok(<[Array<i32, DEPTH>; MAX_JOINTS]>::deserialize(from)?.map(|array| array.0))
    }
}

impl Window {
    pub(super) fn new(tolerance: u32, longest: u32) -> Self {
        Self {
            tolerance: i64::from(tolerance),
            longest: i64::from(longest.min(LONGEST_WINDOW)),
            counts: [[0; DEPTH]; MAX_JOINTS],
            ticks: [1; DEPTH],
            newest: 0,
            known: 0,
        }
    }

    pub(super) fn restart(&mut self) {
        self.known = 0;
    }

    #[inline]
    pub(super) fn push(&mut self, counts: &[i32; MAX_JOINTS], ticks: u32) {
        self.newest = (self.newest + 1) % DEPTH;
        for (ring, counts) in self.counts.iter_mut().zip(counts) {
            ring[self.newest] = *counts;
        }
        self.ticks[self.newest] = ticks;
        self.known = (self.known + 1).min(DEPTH);
    }

    /// Returns the estimated rate of `joint`, in encoder counts per tick: the slope of the longest
    /// valid chord. The chord over the last step alone is always valid, however long the step took.
    #[inline]
    pub(super) fn slope(&self, joint: usize) -> Real {
        // The chord back to the present reading, and the longest one that passes: counts over
        // ticks. Products are less than 2^38 counts times the ticks of the longest chord, so
        // nothing overflows.
        let (mut counts, mut ticks) = (0_i64, 0_i64);
        let mut longest = (0, 1);
        // A chord passes all readings so far if its slope is between these two fractions.
        let (mut least, mut most) = ((0_i64, 1_i64), (0_i64, 1_i64));
        let ring = &self.counts[joint];
        for k in 0..self.known {
            let at = (self.newest + DEPTH - k) % DEPTH;
            counts += i64::from(ring[at]);
            ticks += i64::from(self.ticks[at]);
            if k == 0 {
                longest = (counts, ticks);
            }
            if ticks > self.longest {
                break;
            }
            // The distances of the chord from the lower and from the upper bound, times both
            // durations.
            let above = counts * least.1 - least.0 * ticks;
            let below = most.0 * ticks - counts * most.1;
            if above >= 0 && below >= 0 {
                longest = (counts, ticks);
            }
            // The tolerance on either side of this reading, if it narrows the bounds.
            let narrower = (above > self.tolerance * least.1, below > self.tolerance * most.1);
            if k == 0 || narrower.0 {
                least = (counts - self.tolerance, ticks);
            }
            if k == 0 || narrower.1 {
                most = (counts + self.tolerance, ticks);
            }
            if least.0 * most.1 > most.0 * least.1 {
                break;
            }
        }
        longest.0 as Real / longest.1 as Real
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::wide;
    use super::*;

    /// Returns the longest chord by a direct search, to compare it with the faster search of
    /// [`Window::slope`]. It is the longest chord within the tolerance of every reading in between.
    /// The result holds the chord's counts and ticks.
    fn by_definition(readings: &[(i64, i64)], tolerance: i64, longest: i64) -> (i64, i64) {
        let last = *readings.last().unwrap();
        let mut best = None;
        for (n, first) in readings.iter().rev().enumerate().skip(1) {
            let (dx, dt) = (last.0 - first.0, last.1 - first.1);
            let between = &readings[readings.len() - n..readings.len() - 1];
            let passes =
                between.iter().all(|r| ((last.0 - r.0) * dt - dx * (last.1 - r.1)).abs() <= tolerance * dt);
            if n == 1 || (dt <= longest && passes) {
                best = Some((dx, dt));
            }
        }
        best.unwrap()
    }

    #[test]
    fn one_walk_finds_what_the_definition_says() {
        let mut seed = 1_u64;
        let mut random = |below: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) % below
        };
        for round in 0..200 {
            let (tolerance, longest) = (1 + random(3) as u32, 2 + random(63) as u32);
            let mut window = Window::new(tolerance, longest);
            let mut readings = std::vec![(0_i64, 0_i64)];
            let (mut speed, mut place) = (random(5) as i64 - 2, 0_i64);
            for _ in 0..150 {
                if random(20) == 0 {
                    speed += random(5) as i64 - 2;
                }
                let ticks = if random(15) == 0 { 1 + random(4) as u32 } else { 1 };
                // The speed is in units of two thirds of a count per tick. Counts are rounded down.
                let before = place.div_euclid(3);
                place += 2 * speed * i64::from(ticks);
                let mut counts = [0; MAX_JOINTS];
                counts[5] = (place.div_euclid(3) - before) as i32;
                let last = *readings.last().unwrap();
                readings.push((last.0 + i64::from(counts[5]), last.1 + i64::from(ticks)));
                window.push(&counts, ticks);
                let (dx, dt) = by_definition(&readings, i64::from(tolerance), i64::from(longest));
                assert_eq!(window.slope(5), dx as Real / dt as Real, "round {round}");
            }
        }
    }

    #[test]
    fn a_steady_motion_fills_the_window_whatever_its_rate() {
        // A steady motion with counts rounded down: no chord is off by a count.
        for speed in [0.0, 0.013, 0.4, 0.99, 3.7, -0.31, -22.2_f64] {
            let mut window = Window::new(1, 40);
            for k in 1..100 {
                let step = libm::floor(speed * f64::from(k)) - libm::floor(speed * f64::from(k - 1));
                window.push(&[step as i32; MAX_JOINTS], 1);
            }
            // The chord over 40 ticks. The errors of its two ends together are less than a count.
            assert!((wide(window.slope(0)) - speed).abs() < 1.0 / 40.0 + 1e-6, "{speed}");
        }
    }

    #[test]
    fn a_sudden_motion_is_seen_at_once_and_huge_steps_do_not_overflow() {
        let mut window = Window::new(1, 64);
        for _ in 0..100 {
            window.push(&[0; MAX_JOINTS], 1);
        }
        window.push(&[50; MAX_JOINTS], 1);
        assert_eq!(window.slope(3), 50.0);
        window.restart();
        assert_eq!(window.slope(3), 0.0);
        for counts in [i32::MAX, i32::MIN, i32::MAX] {
            window.push(&[counts; MAX_JOINTS], u32::MAX);
            assert_eq!(window.slope(3), counts as Real / u32::MAX as Real);
        }
        for _ in 0..64 {
            window.push(&[i32::MIN; MAX_JOINTS], 1);
        }
        assert_eq!(window.slope(3), i32::MIN as Real);
    }
}
