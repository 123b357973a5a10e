//! What signs and zeros do not explain: encoders that are dead, joints that are exchanged.

use hbot_core::Rig;

use super::{Calibration, Counts, calibrate};

/// Slip that bearings, rubber and encoders leave of a rig that is as its file says, as a share of rolling.
const ORDINARY: f64 = 0.05;
/// A cone angle that is off by more is no mistake of a workshop, rad.
const MISBUILT: f64 = 0.15;

/// The joints whose counts have not moved, but for one that an encoder may tremble by.
#[must_use]
pub fn still(rig: &Rig, counts: &[Counts]) -> Vec<usize> {
    let moved = |j: usize| counts.iter().any(|now| now[j].wrapping_sub(counts[0][j]).unsigned_abs() > 1);
    (0..rig.device.joints()).filter(|j| !moved(*j)).collect()
}

/// Whether this is a rig that somebody can have built: one of wheels without radius or cone slips little as well, whatever turns.
#[must_use]
pub fn explains(rig: &Rig, found: &Calibration) -> bool {
    let like = found.wheels.iter().zip(rig.device.wheels()).all(|(wheel, filed)| {
        let filed = filed.spec();
        (0.5..=2.0).contains(&(wheel.radius / filed.radius)) && (wheel.cone - filed.cone).abs() < MISBUILT
    });
    like && found.after <= ORDINARY
}

/// Two joints that explain what was seen if each has the other's counts.
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
