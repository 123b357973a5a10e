//! Finds wiring errors that signs and zeros cannot explain: dead encoders and exchanged joints.

use hbot_core::Rig;

use super::{Calibration, Search, calibrate};
use crate::motion::Counts;

/// Largest ratio of slip to rolling distance that bearings, rubber and encoders cause in a rig that
/// is built as its file states.
const ORDINARY: f64 = 0.05;
/// A cone angle that differs from the rig file by this much cannot be a manufacturing error, rad.
const MISBUILT: f64 = 0.15;
/// Largest fraction of the motion that a geometry that counts as right does not explain.
const MOST_LEFT_OUT: f64 = 0.5;

/// Returns the numbers of the joints whose encoder counts have not changed. A change by one count
/// is ignored, because an encoder at rest can jitter by one count.
#[must_use]
pub fn still(rig: &Rig, counts: &[Counts]) -> Vec<usize> {
    let moved = |j: usize| counts.iter().any(|now| now[j].wrapping_sub(counts[0][j]).unsigned_abs() > 1);
    (0..rig.device.joints()).filter(|j| !moved(*j)).collect()
}

/// Returns whether the calibration `found` leaves little slip and describes a rig that can exist.
/// It must have radii and cone angles close to the rig file, because wheels with a very small
/// radius or cone angle would show little slip in any motion.
#[must_use]
pub fn explains(rig: &Rig, found: &Calibration) -> bool {
    let like = found.wheels.iter().zip(rig.device.wheels()).all(|(wheel, filed)| {
        let filed = filed.spec();
        (0.5..=2.0).contains(&(wheel.radius / filed.radius)) && (wheel.cone - filed.cone).abs() < MISBUILT
    });
    like && found.after <= ORDINARY && found.left_out <= MOST_LEFT_OUT
}

/// Returns the numbers of two joints whose encoder counts explain the readings if they are
/// exchanged, or `None` if there are no such joints.
#[must_use]
pub fn exchanged(rig: &Rig, counts: &[Counts]) -> Option<(usize, usize)> {
    let n = rig.device.joints();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let swapped = |(a, b): (usize, usize)| {
        let mut other = counts.to_vec();
        other.iter_mut().for_each(|now| now.swap(a, b));
        other
    };
    let cost = |pair| {
        let other = swapped(pair);
        Search::new(rig, &other).map(|search| (search.whole_cost(&search.coarse()), pair))
    };
    let (_, pair) = pairs.filter_map(cost).min_by(|x, y| x.0.total_cmp(&y.0))?;
    let found = calibrate(rig, &swapped(pair))?;
    (found.known && explains(rig, &found)).then_some(pair)
}
