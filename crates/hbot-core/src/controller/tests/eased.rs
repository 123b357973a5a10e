//! The way to joint torques that motors or contacts limit. It is made in steps if the torque on the
//! sphere would otherwise change by more than the slew limit.

use super::*;
use crate::allocation::traction;
use crate::design::kinematics::Posture;
use crate::real::{TURN, fabs};

/// Slew limit of these tests: the largest change of the torque in one tick, N m.
const REACH: Real = 0.05;
/// Rounding of a torque that goes through the joints and back, N m.
const ROUNDING: Real = 4096.0 * Real::EPSILON;

/// Returns a rig with `wheels` wheels all around the sphere. `peaks` are the largest torques of
/// each steer and each drive joint, N m.
fn rig(wheels: usize, peaks: [Real; 2], grip: Option<Traction>) -> Rig {
    let specs = [0, 1, 2].map(|k| {
        let (sin, cos) = sincos(TURN * k as Real / wheels as Real);
        WheelSpec { axis: Vec3::new(cos, sin, -1.0), cone: 0.1745, radius: 0.0155, ..WheelSpec::default() }
    });
    let device = Device::new(0.102, 0.467, &specs[..wheels]).unwrap();
    let [steer, drive] = peaks.map(|peak| Joint::new(16384, peak));
    let mut parts = RigParts::new(device).with_joints(steer, drive);
    parts.limits.traction = grip;
    Rig::new(parts).unwrap()
}

/// Returns a controller at the steer angles `steer`, rad. In the last tick its motors have made
/// `torque` on the sphere with the joint torques `joints`, N m.
fn controller(rig: Rig, steer: &[Real], torque: Vec3, joints: &[Real]) -> Controller {
    let mut controller = Controller::new(rig);
    controller.joints.posture = Posture::new(&rig.device, steer);
    controller.made.torque = torque;
    controller.made.joints[..joints.len()].copy_from_slice(joints);
    controller
}

/// Runs one tick in which `torque` is wanted, with the slew limit `reach`, N m. Returns what the
/// motors make of it. Checks that it is within the limits of motors and contacts, and that torque
/// and load are those of the joint torques.
fn tick(controller: &mut Controller, torque: Vec3, reach: Real) -> Made {
    let (rig, posture) = (controller.rig, controller.joints.posture);
    controller.make(rig.device.count(), &Wanted { torque, share: 1.0, reach });
    let made = controller.made;
    let joints = &made.joints[..rig.device.joints()];
    for (j, torque) in joints.iter().enumerate() {
        assert!(fabs(*torque) <= rig.joints[j].peak * (1.0 + ROUNDING), "joint {j}: {torque} N m");
    }
    let off = (posture.torque_on_sphere(joints) - made.torque).length();
    assert!(off < ROUNDING, "the joints make {off} N m more or less");
    let load = rig.limits.traction.map_or(0.0, |grip| {
        traction(&controller.arms[..rig.device.wheels().len()], joints, grip.mu * grip.normal_force)
    });
    assert!(load < 1.0 + ROUNDING, "a contact carries {load} times what it holds");
    assert!(fabs(load.min(1.0) - made.traction) < ROUNDING, "{load}, not {}", made.traction);
    made
}

/// Returns what the motors would make of `torque` if there were no slew limit.
fn unlimited(controller: &Controller, torque: Vec3) -> Made {
    tick(&mut controller.clone(), torque, Real::INFINITY)
}

fn towards(from: Vec3, to: Vec3) -> Vec3 {
    from + (to - from).normalize() * REACH
}

/// Pseudo-random numbers from -1 to 1 (a linear congruential generator).
struct Noise(u32);

impl Noise {
    fn number(&mut self) -> Real {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as Real / 8_388_608.0 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }

    fn posture(&mut self) -> [Real; 3] {
        [(); 3].map(|()| 0.5 * TURN * self.number())
    }
}

#[test]
fn a_change_beyond_the_slew_limit_goes_straight_to_its_end_and_reaches_it() {
    let mut noise = Noise(1);
    let grip = Traction { mu: 0.5, normal_force: 8.0 };
    for (wheels, peaks, grip) in [
        (2, [2.0, 0.5], None),
        (2, [0.1, 0.03], None),
        (3, [2.0, 0.5], Some(grip)),
        (2, [2.0, 0.5], Some(grip)),
    ] {
        for _ in 0..20 {
            let steer = noise.posture();
            let mut at = controller(rig(wheels, peaks, grip), &steer[..wheels], Vec3::ZERO, &[]);
            let from = tick(&mut at, noise.vector(), Real::INFINITY).torque;
            let wanted = noise.vector();
            let end = unlimited(&at, wanted);
            let way = end.torque - from;
            let steps = way.length() / REACH;
            let mut last = from;
            for k in 1..=80 {
                let made = tick(&mut at, wanted, REACH);
                let part = (k as Real / steps).min(1.0);
                let off = (made.torque - (from + way * part)).length();
                // Each step adds its rounding to those before.
                assert!(off < ROUNDING * k as Real, "tick {k} of {steps}: {off} N m off the way");
                assert!((made.torque - last).length() <= REACH + ROUNDING, "tick {k}");
                assert_eq!((made.scale, made.deficient), (end.scale, end.deficient));
                last = made.torque;
            }
            assert!(steps < 79.0, "{steps}");
            assert_eq!((at.made.joints, at.made.torque), (end.joints, end.torque), "it arrives");
        }
    }
}

#[test]
fn the_way_starts_at_the_last_torque_although_the_wheels_have_steered() {
    let mut noise = Noise(2);
    for wheels in [2, 3] {
        let mut apart: Real = 0.0;
        for _ in 0..50 {
            let rig = rig(wheels, [2.0, 0.5], None);
            let (steer, last) = (noise.posture(), noise.vector());
            let before = unlimited(&controller(rig, &steer[..wheels], Vec3::ZERO, &[]), last);
            let now = steer.map(|angle| angle + 0.3 * noise.number());
            let mut at = controller(rig, &now[..wheels], before.torque, &before.joints);
            let held = at.joints.posture.torque_on_sphere(&before.joints);
            apart = apart.max((held - last).length());
            let wanted = noise.vector();
            let end = unlimited(&at, wanted).torque;
            if (end - last).length() > REACH {
                let off = (tick(&mut at, wanted, REACH).torque - towards(last, end)).length();
                assert!(off < ROUNDING, "{off} N m off the way from {last} to {end}");
            }
        }
        assert!(apart > 2.0 * REACH, "the last joint torques make {apart} N m more or less now");
    }
}

/// Returns joint torques that make the same torque on the sphere as `joints`, with the smallest
/// load of the most loaded contact. Two wheels have one combination of joint torques that makes no
/// torque on the sphere: the determinants of three rows each.
fn least_loaded(at: &Controller, joints: &[Real; MAX_JOINTS]) -> [Real; 4] {
    let rows = at.joints.posture.rows();
    let without = |j: usize, sign: Real| {
        let [a, b, c] = [1, 2, 3].map(|k| rows[(j + k) % 4]);
        sign * a.dot(b.cross(c))
    };
    // The three rows are in cyclic order, which does not change the sign of a determinant.
    let idle = [without(0, 1.0), without(1, -1.0), without(2, 1.0), without(3, -1.0)];
    let largest = idle.iter().fold(0.0, |most: Real, part| most.max(fabs(*part)));
    let with = |share: Real| [0, 1, 2, 3].map(|j| joints[j] + share * idle[j] / largest);
    let load = |tau: &[Real; 4]| traction(&at.arms[..2], tau, 1.0);
    (-400..=400)
        .map(|k| with(0.001 * k as Real))
        .min_by(|a, b| load(a).total_cmp(&load(b)))
        .expect("some combinations")
}

#[test]
fn the_way_starts_at_the_last_joint_torques_if_the_contacts_hold_them_and_no_others() {
    // The joint torques of least cost load one contact more than necessary. If the grip is just
    // enough for others that make the same torque, the allocation gives less than that torque.
    let mut noise = Noise(3);
    let mut tried = 0;
    for _ in 0..200 {
        let (steer, last) = (noise.posture(), noise.vector());
        let free = controller(rig(2, [2.0, 0.5], None), &steer[..2], Vec3::ZERO, &[]);
        let joints = least_loaded(&free, &unlimited(&free, last).joints);
        let made = free.joints.posture.torque_on_sphere(&joints);
        assert!((made - last).length() < ROUNDING, "{joints:?} make {made}, not {last}");
        let normal_force = 2.0 * traction(&free.arms[..2], &joints, 1.0) * (1.0 + ROUNDING);
        let grip = Some(Traction { mu: 0.5, normal_force });
        let mut at = controller(rig(2, [2.0, 0.5], grip), &steer[..2], last, &joints);
        let again = unlimited(&at, last).torque;
        let wanted = noise.vector();
        let end = unlimited(&at, wanted).torque;
        if (again - last).length() > 0.1 * REACH && (end - last).length() > REACH {
            tried += 1;
            let off = (tick(&mut at, wanted, REACH).torque - towards(last, end)).length();
            assert!(off < ROUNDING, "{off} N m off the way from {last} to {end}");
        }
    }
    assert!(tried > 50, "{tried}");
}

#[test]
fn the_slew_limit_holds_if_any_joint_torques_within_the_limits_keep_it() {
    let mut noise = Noise(4);
    let loose = Traction { mu: 0.02, normal_force: 5000.0 };
    for (wheels, grip) in [(2, None), (3, None), (2, Some(loose)), (3, Some(loose))] {
        let mut far = 0;
        for _ in 0..1000 {
            let rig = rig(wheels, [0.1, 0.03], grip);
            let steer = noise.posture();
            // All motors are at their limits, so the sphere has a torque at a corner of what they
            // can make. The last torque was a little outside of it.
            let corner = [(); 6].map(|()| noise.number());
            let corner = [0, 1, 2, 3, 4, 5].map(|j| rig.joints[j].peak * corner[j].signum());
            let posture = Posture::new(&rig.device, &steer[..wheels]);
            let corner = posture.torque_on_sphere(&corner[..2 * wheels]);
            let last = corner + noise.vector().normalize() * (0.5 * REACH);
            let mut at = controller(rig, &steer[..wheels], last, &[]);
            // The allocation keeps the direction of the torque, which can take it far from the
            // corner.
            let again = (unlimited(&at, last).torque - last).length();
            far += u32::from((1.2 * REACH..0.3).contains(&again));
            let change = (tick(&mut at, noise.vector(), REACH).torque - last).length();
            assert!(change <= REACH + ROUNDING, "{change} N m, {again} N m by the allocation");
        }
        // With three wheels, what the motors can make is nearly as large in all directions.
        assert!(far > if wheels == 2 { 40 } else { 0 }, "{far} cases with {wheels} wheels");
    }
}

#[test]
fn contacts_hold_while_the_slew_limit_is_kept() {
    // `tick` checks the load of the contacts.
    let mut noise = Noise(5);
    let grip = Some(Traction { mu: 0.5, normal_force: 4.0 });
    let (mut far, mut loaded) = (0, 0);
    for _ in 0..1000 {
        let steer = noise.posture();
        let last = noise.vector() * 0.5;
        let mut at = controller(rig(2, [2.0, 0.5], grip), &steer[..2], last, &[]);
        far += u32::from((unlimited(&at, last).torque - last).length() > REACH);
        loaded += u32::from(tick(&mut at, last + noise.vector() * REACH, REACH).traction > 0.99);
    }
    assert!(far > 100 && loaded > 100, "{far}, {loaded}");
}

#[test]
fn torque_along_a_lost_direction_is_not_held_by_the_other_joints() {
    // The first drive joint has no motor. At some steer angle of its wheel, the other three joints
    // cannot turn the sphere about one axis.
    let mut lame = [Joint::new(16384, 0.1); MAX_JOINTS];
    lame[1].peak = 0.0;
    let rig = rig(2, [0.1, 0.1], None).with(|parts| parts.joints = lame).unwrap();
    let volume = |first: Real, second: Real| {
        let posture = Posture::new(&rig.device, &[first, second]);
        let rows = posture.rows();
        rows[0].dot(rows[2].cross(rows[3]))
    };
    let mut tried = 0;
    for second in [0.4, 1.3, 2.2, 3.1, 4.0, 4.9] {
        let grid = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11].map(|k| 0.5 * k as Real);
        let Some(low) = grid.into_iter().find(|at| volume(*at, second) * volume(*at + 0.5, second) < 0.0)
        else {
            continue;
        };
        let (mut low, mut high) = (low, low + 0.5);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let below = volume(low, second) * volume(middle, second) > 0.0;
            (low, high) = if below { (middle, high) } else { (low, middle) };
        }
        for beside in [1.0e-3, 3.0e-3, 8.0e-3] {
            let steer = [low + beside, second];
            let posture = Posture::new(&rig.device, &steer);
            let lost = posture.rows()[2].cross(posture.rows()[3]).normalize();
            let last = lost * 0.4 + posture.rows()[2].normalize() * 0.1;
            let mut at = controller(rig, &steer, last, &[]);
            let next = unlimited(&at, last);
            if next.deficient && (next.torque - last).length() > REACH {
                tried += 1;
                // The torque about this axis vanishes at once. To keep a hundredth of it, the
                // joints would have to work at their limits.
                assert_eq!(tick(&mut at, last, REACH).joints, next.joints, "{beside} rad beside");
            }
        }
    }
    assert!(tried > 4, "{tried}");
}
