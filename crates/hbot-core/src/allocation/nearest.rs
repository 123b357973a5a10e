//! Finds the joint torques that come nearest to a torque on the sphere that the motors and contacts
//! cannot make in full.

use super::{ContactArms, JointLimits, traction};
use crate::design::device::MAX_JOINTS;
use crate::linear::Sym3;
use crate::real::{Real, Vec3, fabs};

/// Largest number of rounds of the search for the nearest torque. If the torque in one direction is
/// weak by a factor of 100, the search needs about ten.
const ROUNDS: u32 = 32;

/// Damping of the step in which all joints move together, relative to the strength of these joints.
/// The value is about the square root of the rounding error of a [`Real`]. The step ignores
/// directions that are weaker than the square root of the damping.
const DAMPING: Real = if Real::EPSILON < 1.0e-10 { 1.5e-8 } else { 3.5e-4 };

/// Largest load of a contact that is still accepted, as a fraction of its grip. It is slightly
/// above 1 because joint torques that were scaled down to the grip have rounding errors.
const FULL: Real = 1.0 + 8.0 * Real::EPSILON;

/// The limits of motors and contacts for [`nearest`], and the rows of G that turn joint torques
/// into a torque on the sphere.
pub(crate) struct Bounds<'a> {
    /// Rows of G, one per joint, in the order steer, drive of each wheel. G maps the sphere's
    /// angular velocity to joint rates.
    pub(crate) rows: &'a [Vec3],
    pub(crate) limits: &'a JointLimits,
    /// Lever arms of the joints at each contact, one entry per wheel.
    pub(crate) arms: &'a [ContactArms],
    /// Largest tangential force at each contact, N. `None` if contact forces are not limited.
    pub(crate) grip: Option<Real>,
}

/// Returns joint torques within `bounds` whose torque on the sphere comes nearest to `torque`. All
/// are in N m; joint torques are in the order steer, drive of each wheel.
///
/// The search begins at `start`, which must be within the bounds. Each round has two steps. First,
/// one joint after another moves to the value that brings the torque nearest. This step finds the
/// joints that stay at their limits. Then all joints between their limits move together, to make
/// the rest of the torque with the least change. This step makes the search fast if rows are nearly
/// parallel. No step increases the distance.
pub(crate) fn nearest(bounds: &Bounds<'_>, start: [Real; MAX_JOINTS], torque: Vec3) -> [Real; MAX_JOINTS] {
    let mut joints = start;
    let mut left = torque;
    for (row, joint) in bounds.rows.iter().zip(&joints) {
        left -= *row * *joint;
    }
    let negligible = 4.0 * Real::EPSILON * torque.length_squared();
    for _ in 0..ROUNDS {
        if left.length_squared() <= negligible {
            break;
        }
        singly(bounds, &mut joints, &mut left);
        together(bounds, &mut joints, &mut left);
    }
    joints
}

fn singly(bounds: &Bounds<'_>, joints: &mut [Real; MAX_JOINTS], left: &mut Vec3) {
    for (j, row) in bounds.rows.iter().enumerate() {
        let square = row.length_squared();
        if !(bounds.limits.driven(j) && square > 0.0) {
            continue;
        }
        let peak = bounds.limits.peak[j];
        let next = (joints[j] + left.dot(*row) / square).clamp(-peak, peak);
        let pair = if j.is_multiple_of(2) { [next, joints[j + 1]] } else { [joints[j - 1], next] };
        if bounds.hold(j / 2, &pair) {
            *left -= *row * (next - joints[j]);
            joints[j] = next;
        }
    }
}

fn together(bounds: &Bounds<'_>, joints: &mut [Real; MAX_JOINTS], left: &mut Vec3) {
    let between = |k: usize| bounds.limits.driven(k) && fabs(joints[k]) < bounds.limits.peak[k];
    let mut moment = Sym3::ZERO;
    for (k, row) in bounds.rows.iter().enumerate().filter(|(k, _)| between(*k)) {
        let peak = bounds.limits.peak[k];
        moment.add(*row, peak * peak);
    }
    if moment.trace() == 0.0 {
        return;
    }
    // Damped, because in a direction that the joints between their limits cannot turn at all,
    // rounding would dominate the answer.
    let damping = DAMPING * moment.trace();
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        moment.add(axis, damping);
    }
    let y = moment.solve(*left, 0.0);
    let (mut way, mut made, mut part) = ([0.0; MAX_JOINTS], Vec3::ZERO, 1.0);
    for (k, row) in bounds.rows.iter().enumerate().filter(|(k, _)| between(*k)) {
        let peak = bounds.limits.peak[k];
        way[k] = peak * peak * row.dot(y);
        made += *row * way[k];
        let room = if way[k] > 0.0 { peak - joints[k] } else { peak + joints[k] };
        part = Real::min(part, if way[k] == 0.0 { 1.0 } else { room / fabs(way[k]) });
    }
    let next = *left - made * part;
    if !(next.length_squared() < left.length_squared()) {
        return;
    }
    let mut moved = *joints;
    for k in 0..bounds.rows.len() {
        let peak = bounds.limits.peak[k];
        moved[k] = if way[k] == 0.0 { joints[k] } else { (joints[k] + way[k] * part).clamp(-peak, peak) };
    }
    if bounds.arms.iter().enumerate().all(|(i, _)| bounds.hold(i, &[moved[2 * i], moved[2 * i + 1]])) {
        (*joints, *left) = (moved, next);
    }
}

impl Bounds<'_> {
    /// Returns true if the contact of wheel number `wheel` can carry the torques of the wheel's
    /// steer and drive joint (`pair`, N m) without slip.
    fn hold(&self, wheel: usize, pair: &[Real; 2]) -> bool {
        self.grip.is_none_or(|grip| traction(&self.arms[wheel..=wheel], pair, grip) <= FULL)
    }
}

#[cfg(test)]
#[allow(clippy::excessive_precision, reason = "an f32 rounds the figures that were found with f64")]
mod tests {
    use super::*;
    use crate::design::device::MAX_WHEELS;

    const GIVES: [Real; 4] = [2.0, 0.5, 2.0, 0.5];

    fn distance(rows: &[Vec3; 4], peaks: [Real; 4], start: [Real; 4], torque: Vec3) -> Real {
        let mut limits = JointLimits::NONE;
        limits.peak[..4].copy_from_slice(&peaks);
        let arm = ContactArms { steer: 0.01, cross: 0.0, roll: 0.02 };
        let arms = [arm; MAX_WHEELS];
        let bounds = Bounds { rows, limits: &limits, arms: &arms[..2], grip: None };
        let mut from = [0.0; MAX_JOINTS];
        from[..4].copy_from_slice(&start);
        let found = nearest(&bounds, from, torque);
        assert!((0..4).all(|k| fabs(found[k]) <= peaks[k]), "{found:?}");
        let left = rows.iter().zip(&found).fold(torque, |left, (row, joint)| left - *row * *joint);
        crate::real::sqrt(left.length_squared())
    }

    /// Checks that, with one dead motor, the search finds the torque that is nearest to the wanted
    /// one. In one direction the joints are weak by a factor of 36. The expected distance,
    /// 0.164902 N m, comes from an independent solver of bounded least squares (SciPy's
    /// `lsq_linear`, method `bvls`).
    #[test]
    fn three_joints_come_as_near_as_they_can() {
        let rows = [
            Vec3::new(-0.189703, -5.528769, -1.603917),
            Vec3::new(-4.535416, 1.47136, -4.535416),
            Vec3::new(2.672497, -3.054896, -4.08671),
            Vec3::new(-2.506023, -5.544781, 2.506023),
        ];
        let last = Vec3::new(-0.814013, -1.49031, -0.533628);
        let off = distance(&rows, [2.0, 0.0, 2.0, 0.5], [1.036994, 0.0, -0.579749, -0.442444], last);
        assert!(fabs(off - 0.164902) < 2e-5, "{off}");
    }

    /// Checks that the search finds the nearest torque if both drive joints are at their limits and
    /// the steer joints turn the sphere in nearly opposite directions. The expected distance,
    /// 0.191214 N m, comes from SciPy's `lsq_linear`, method `bvls`.
    #[test]
    fn joints_that_pull_nearly_against_each_other_come_as_near_as_they_can() {
        let rows = [
            Vec3::new(1.421607, -5.581649, 0.007394),
            Vec3::new(-4.578794, -1.172253, -4.578794),
            Vec3::new(-0.948457, 5.662096, -0.465757),
            Vec3::new(4.644787, 0.395973, -4.644787),
        ];
        let last = Vec3::new(0.11732, -2.16859, -4.531585);
        let off = distance(&rows, GIVES, [2.0, 0.5, 1.661535, 0.307373], last);
        assert!(fabs(off - 0.191214) < 2e-5, "{off}");
    }

    /// Checks what the search finds if one contact after another holds too little. The wanted
    /// torque is 1 N m about the first axis, which joints 0 and 3 turn, one of each wheel. Joint 0
    /// alone needs a force of 1/0.01 = 100 N. Joint 3 at its limit of 0.5 N m needs 0.5/0.04 = 12.5
    /// N and leaves 0.5 N m for joint 0, which then needs 50 N. A step that a contact does not hold
    /// is left out.
    #[test]
    fn a_contact_that_holds_too_little_leaves_the_torque_to_the_other() {
        let rows = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::X];
        let arms = [
            ContactArms { steer: 0.01, cross: 0.0, roll: 0.02 },
            ContactArms { steer: 0.03, cross: 0.0, roll: 0.04 },
        ];
        let mut limits = JointLimits::NONE;
        limits.peak[..4].copy_from_slice(&GIVES);
        for (grip, wanted) in [
            (None, [1.0, 0.0, 0.0, 0.0]),
            (Some(100.0), [1.0, 0.0, 0.0, 0.0]),
            (Some(60.0), [0.5, 0.0, 0.0, 0.5]),
            (Some(20.0), [0.0, 0.0, 0.0, 0.5]),
            (Some(10.0), [0.0; 4]),
        ] {
            let bounds = Bounds { rows: &rows, limits: &limits, arms: &arms, grip };
            let found = nearest(&bounds, [0.0; MAX_JOINTS], Vec3::X);
            // The damping of the step of all joints takes less than 1e-3 of the torque in f32 too.
            let off = found.iter().zip(&wanted).map(|(a, b)| fabs(*a - *b)).fold(0.0, Real::max);
            assert!(off < 1.0e-3, "{grip:?}: {found:?}");
        }
    }

    /// Checks that no contact carries more than its grip, and that the search never ends further
    /// from the wanted torque than it began. The wheels have different lever arms, so a mix-up of
    /// joints would show. The torques grow from 0.01 to 4 N m. The contacts hold the least of them
    /// in full, as if the grip were not limited. They cannot hold the largest: 10 N at levers of
    /// 0.12 m and 0.19 m make at most 3.1 N m.
    #[test]
    fn contacts_that_hold_little_carry_no_more() {
        let rows = [
            Vec3::new(1.4, -5.6, 0.1),
            Vec3::new(-4.6, -1.2, -4.6),
            Vec3::new(-0.9, 5.7, -0.5),
            Vec3::new(4.6, 0.4, -4.6),
        ];
        let arms = [
            ContactArms { steer: 0.02, cross: 0.004, roll: 0.015 },
            ContactArms { steer: 0.03, cross: -0.01, roll: 0.01 },
        ];
        let mut limits = JointLimits::NONE;
        limits.peak[..4].copy_from_slice(&GIVES);
        let grip = 10.0;
        let bounds = |grip| Bounds { rows: &rows, limits: &limits, arms: &arms, grip };
        let (mut unlimited, mut limited) = (0, 0);
        for k in 1..=400 {
            let wave = |rate: Real| crate::real::sincos(rate * k as Real).0;
            let way = Vec3::new(wave(1.3), wave(2.1), wave(0.7));
            let torque = way * (0.01 * k as Real / crate::real::sqrt(way.length_squared()));
            let find = |grip| nearest(&bounds(grip), [0.0; MAX_JOINTS], torque);
            let (found, free) = (find(Some(grip)), find(None));
            assert_eq!(find(Some(1.0e9)), free, "a grip that is never reached changes nothing");
            let loads = |joints: &[Real; MAX_JOINTS]| {
                [0_usize, 1].map(|i| traction(&arms[i..=i], &joints[2 * i..2 * i + 2], grip))
            };
            assert!(loads(&found).iter().all(|load| *load <= FULL), "{found:?} loads {:?}", loads(&found));
            assert!((0..4).all(|j| fabs(found[j]) <= GIVES[j]), "{found:?}");
            let left = rows.iter().zip(&found).fold(torque, |left, (row, joint)| left - *row * *joint);
            // The margin is for the rounding of f32.
            assert!(left.length_squared() <= 1.0001 * torque.length_squared(), "{torque:?}: {found:?}");
            if loads(&free).iter().any(|load| *load > FULL) {
                assert_ne!(found, free);
                limited += 1;
            } else {
                unlimited += usize::from(found == free);
            }
        }
        assert!(limited > 0 && unlimited > 0, "{limited} limited, {unlimited} as without a limit");
    }

    /// Checks that a step of a steer joint is judged together with the torque that the drive joint
    /// of the same wheel has already. The drive joint of wheel 0 makes 0.15/0.02 = 7.5 N. With a
    /// steer torque of 0.09 N m, which makes 0.09/0.01 = 9 N at right angles, it would be 11.7 N.
    /// The grip is 10 N. Joint 3 of the other wheel makes the torque with 0.09/0.04 = 2.25 N.
    #[test]
    fn a_contact_that_is_loaded_already_takes_no_more() {
        let rows = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::X];
        let arms = [
            ContactArms { steer: 0.01, cross: 0.0, roll: 0.02 },
            ContactArms { steer: 0.03, cross: 0.0, roll: 0.04 },
        ];
        let mut limits = JointLimits::NONE;
        limits.peak[..4].copy_from_slice(&GIVES);
        let bounds = Bounds { rows: &rows, limits: &limits, arms: &arms, grip: Some(10.0) };
        let mut start = [0.0; MAX_JOINTS];
        start[1] = 0.15;
        let found = nearest(&bounds, start, Vec3::new(0.09, 0.15, 0.0));
        for (joint, wanted) in found.into_iter().zip([0.0, 0.15, 0.0, 0.09]) {
            assert!(fabs(joint - wanted) < 1.0e-3, "{found:?}");
        }
    }

    /// Checks that the unit of torque does not matter. A power of two causes no rounding, so the
    /// result must be the same to the last bit.
    #[test]
    fn small_torques_are_found_as_well_as_large_ones() {
        let rows = [
            Vec3::new(1.421607, -5.581649, 0.007394),
            Vec3::new(-4.578794, -1.172253, -4.578794),
            Vec3::new(-0.948457, 5.662096, -0.465757),
            Vec3::new(4.644787, 0.395973, -4.644787),
        ];
        let found = |unit: Real| {
            let mut limits = JointLimits::NONE;
            limits.peak[..4].copy_from_slice(&GIVES.map(|peak| peak * unit));
            let arms = [ContactArms { steer: 0.01, cross: 0.0, roll: 0.02 }; 2];
            let bounds = Bounds { rows: &rows, limits: &limits, arms: &arms, grip: None };
            let torque = Vec3::new(0.11732, -2.16859, -4.531585) * unit;
            nearest(&bounds, [0.0; MAX_JOINTS], torque).map(|joint| joint / unit)
        };
        let large = found(1.0);
        assert!(large[..4].iter().any(|joint| *joint != 0.0), "{large:?}");
        assert_eq!(found(1.0 / 1_048_576.0), large);
    }

    /// Checks joints that the search must leave alone: one whose limit is no number, one whose
    /// weight is zero, so that it counts as not driven, and one that cannot turn the sphere.
    #[test]
    fn joints_that_cannot_help_stay_as_they_are() {
        let rows = [Vec3::X, Vec3::X, Vec3::Y, Vec3::ZERO];
        let arms = [ContactArms { steer: 0.01, cross: 0.0, roll: 0.02 }; 2];
        let mut limits = JointLimits::NONE;
        limits.peak[..4].copy_from_slice(&[Real::NAN, 1.0, 1.0, 1.0]);
        limits.weight[1] = 0.0;
        let bounds = Bounds { rows: &rows, limits: &limits, arms: &arms, grip: None };
        let mut start = [0.0; MAX_JOINTS];
        start[3] = 0.25;
        let found = nearest(&bounds, start, Vec3::new(0.5, 0.5, 0.0));
        assert_eq!((found[0], found[1], found[3]), (0.0, 0.0, 0.25));
        assert!(fabs(found[2] - 0.5) < 1.0e-3, "{found:?}");
    }

    #[test]
    fn what_is_held_already_stays() {
        let rows = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::X];
        assert_eq!(distance(&rows, GIVES, [0.1, 0.2, 0.3, 0.1], Vec3::new(0.2, 0.2, 0.3)), 0.0);
    }
}
