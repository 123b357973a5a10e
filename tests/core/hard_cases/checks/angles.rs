//! Angles from zero to a half turn, both signs of a quaternion, and quaternions that are not
//! rotations.

use super::super::core::inputs::{Command, Stamp};
use super::super::core::outputs::{Refusal, Reply};
use super::super::core::render::effects::{Anchor, Spring, SpringLaw, Target};
use super::super::core::render::impedance::{first_order_law, geodesic_law, quaternion_law};
use super::super::core::{Mat3, Quat, Real, Vec3, rotation};
use super::machine::ReadRig;

const PI: f64 = core::f64::consts::PI;

/// Angles from zero to exactly a half turn, rad. In 32 bits the first ones round to zero, and the
/// last three to one number.
#[rustfmt::skip]
const ANGLES: [f64; 18] = [
    0.0, 1e-300, 1e-160, 1e-100, 1e-38, 1e-20, 1e-9, 1e-8, 1e-4, 0.0312, 0.0313, 0.0566, 0.5, 1.0, 3.0, PI - 1e-8,
    PI - 1e-15, PI,
];

fn axis() -> Vec3 {
    Vec3::new(0.6, -0.48, 0.64)
}

fn all() -> impl Iterator<Item = (Real, Quat)> {
    ANGLES.into_iter().flat_map(|t| {
        let t = t as Real;
        let q = rotation::exp(axis() * t);
        [(t, q), (t, -q)]
    })
}

/// Returns whether a rotation by `t` equals, to the rounding of `t`, a rotation in the other
/// direction.
fn a_half_turn(t: Real) -> bool {
    t > (PI as Real) * (1.0 - 4.0 * Real::EPSILON)
}

/// Rounding of numbers below the smallest normal one.
const DENORMAL: Real = 4.0 * Real::MIN_POSITIVE;

#[test]
fn logarithm_undoes_exponential() {
    for (t, turn) in all() {
        for axis in [axis(), Vec3::X, -Vec3::Z, turn * Vec3::Y] {
            let v = axis * t;
            let q = rotation::exp(v);
            let back = rotation::log(q);
            assert!(rotation::log(-q) == back || a_half_turn(t), "the sign of q matters at {t:e}");
            let off = (back - v).length();
            let other = if a_half_turn(t) { (back + v).length() } else { Real::MAX };
            // The tolerance is a few roundings of the angle. For tiny angles the sum of squares
            // underflows, so the largest component is compared.
            assert!(
                (back - v).abs().max_element() <= 4.0 * Real::EPSILON * t + DENORMAL
                    || off <= 4.0 * Real::EPSILON * t
                    || other <= 8.0 * Real::EPSILON * t,
                "{t:e}: {back}"
            );
            assert!((q.length_squared() - 1.0).abs() <= 4.0 * Real::EPSILON, "{t:e}: {q}");
            assert!((rotation::exp(back) - rotation::shortest(q)).length() <= 16.0 * Real::EPSILON);
        }
    }
    assert_eq!((rotation::exp(Vec3::ZERO), rotation::log(Quat::IDENTITY)), (Quat::IDENTITY, Vec3::ZERO));
    assert_eq!(rotation::log(Quat::from_xyzw(1.0, 0.0, 0.0, 0.0)), Vec3::X * (PI as Real));
}

#[test]
fn springs_pull_by_their_laws() {
    const K: Real = 2.0;
    let stiffness = Mat3::from_diagonal(Vec3::splat(K));
    for (t, q) in all() {
        let size = |torque: Vec3, want: Real, rounding: Real, law: &str| {
            let along = -torque.dot(axis());
            let along = if a_half_turn(t) { along.abs() } else { along };
            assert!((along - want).abs() <= rounding, "{law} at {t:e}: {along:e} for {want:e}");
            assert!(
                (torque + axis() * torque.dot(-axis())).abs().max_element() <= rounding,
                "{law} at {t:e}: {torque}"
            );
        };
        let rounding = 16.0 * Real::EPSILON * K * t.min(4.0) + DENORMAL;
        let (elastic, p) = geodesic_law(Quat::IDENTITY, q, &stiffness, Vec3::ZERO);
        size(elastic.torque, K * t, rounding, "geodesic");
        assert!(p.is_finite() && elastic.energy >= 0.0 && elastic.energy.is_finite());
        let half = 0.5 * f64::from(t);
        let elastic = quaternion_law(Quat::IDENTITY, q, &stiffness);
        size(elastic.torque, K * (2.0 * half.sin() * half.cos()) as Real, rounding, "quaternion");
        let elastic = first_order_law(Quat::IDENTITY, q, &stiffness);
        size(elastic.torque, K * (2.0 * half.sin()) as Real, rounding, "first order");
    }
}

#[test]
fn what_comes_in_as_an_orientation_is_a_rotation_or_refused() {
    let reference = |q| {
        let (omega, stamp) = (Vec3::ZERO, Stamp::default());
        Command::Reference { slot: 0, epoch: 1, q, omega, valid_ticks: 9, stamp }
    };
    for (t, q) in all() {
        let mut machine = ReadRig::idle();
        let Reply::Aligned { angle } = machine.command(Command::Align { q, weight: 1.0, tick: 1 }) else {
            panic!("{t:e} was refused");
        };
        assert!((angle - t).abs() <= 8.0 * Real::EPSILON * t + DENORMAL || t < 1e-19, "{t:e}: {angle:e}");
        let turned = rotation::angle_between(machine.run(2).state.q, q);
        assert!(turned <= 16.0 * Real::EPSILON, "{t:e}: {turned:e}");
        assert_eq!(machine.command(reference(q)), Reply::Done);
        machine.run(1000);
    }
    for scale in [0.0, 1e-300, 1e-160, 0.9, 2.0, 1e30, 1e160, f64::NAN, f64::INFINITY] {
        let q = Quat::from_xyzw(0.5, -0.5, 0.5, 0.5) * (scale as Real);
        let mut machine = ReadRig::active();
        let before = machine.step(|_| {}).state;
        for command in [Command::Align { q, weight: 1.0, tick: 3 }, reference(q)] {
            assert_eq!(machine.command(command), Reply::Refused(Refusal::NotFinite), "{q}");
        }
        let after = machine.run(100).state;
        assert_eq!((after.q, after.torque), (before.q, before.torque), "{q}");
        assert_eq!(Target::new(q, Anchor::Absolute), None, "{q}");
        let spring = Spring::new(SpringLaw::Geodesic, Mat3::IDENTITY, Mat3::ZERO, q, Anchor::Absolute);
        assert_eq!(spring, None, "{q}");
    }
    // The reader of files accepts every quaternion that has a direction, and no other.
    for scale in [Real::MIN_POSITIVE, 1e-30, 1.0, 1e30, Real::MAX] {
        let q = rotation::from_wxyz([scale, -scale, scale, -scale]).unwrap();
        assert!(
            (q - Quat::from_xyzw(-0.5, 0.5, -0.5, 0.5)).length() <= 4.0 * Real::EPSILON,
            "{scale:e}: {q}"
        );
    }
    for bad in [[0.0; 4], [Real::NAN, 1.0, 0.0, 0.0], [1.0, 0.0, Real::INFINITY, 0.0]] {
        assert_eq!(rotation::from_wxyz(bad), None);
    }
}
