//! Finds wiring errors that signs and zeros cannot explain: dead encoders and exchanged joints.

use hbot_core::Rig;

use super::{Calibration, Counts, calibrate};

/// Largest ratio of slip to rolling that bearings, rubber and encoders cause in a rig that is as
/// its file states.
const ORDINARY: f64 = 0.05;
/// Error of a cone angle that is too large for a mistake of a workshop, rad.
const MISBUILT: f64 = 0.15;

/// Returns the joints whose counts have not moved. A change by one count is ignored, because an
/// encoder at rest can jitter by one.
#[must_use]
pub fn still(rig: &Rig, counts: &[Counts]) -> Vec<usize> {
    let moved = |j: usize| counts.iter().any(|now| now[j].wrapping_sub(counts[0][j]).unsigned_abs() > 1);
    (0..rig.device.joints()).filter(|j| !moved(*j)).collect()
}

/// Returns whether the calibration describes a rig that can exist, with little slip. The radii and
/// cones are checked too: wheels with a very small radius or cone would show little slip in any
/// motion.
#[must_use]
pub fn explains(rig: &Rig, found: &Calibration) -> bool {
    let like = found.wheels.iter().zip(rig.device.wheels()).all(|(wheel, filed)| {
        let filed = filed.spec();
        (0.5..=2.0).contains(&(wheel.radius / filed.radius)) && (wheel.cone - filed.cone).abs() < MISBUILT
    });
    like && found.after <= ORDINARY
}

/// Returns two joints that explain the readings if their counts are exchanged, or `None` if there
/// are no such joints.
#[must_use]
pub fn exchanged(rig: &Rig, counts: &[Counts]) -> Option<(usize, usize)> {
    let n = rig.device.joints();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let explained = |(a, b): (usize, usize)| {
        let mut other = counts.to_vec();
        other.iter_mut().for_each(|now| now.swap(a, b));
        calibrate(rig, &other)
            .filter(|found| found.known && explains(rig, found))
            .map(|found| (found.after, (a, b)))
    };
    pairs.filter_map(explained).min_by(|x, y| x.0.total_cmp(&y.0)).map(|(_, pair)| pair)
}
