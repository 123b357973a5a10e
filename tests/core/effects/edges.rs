//! Effects at exact edges: half turns, swings of a half turn, rims of walls and notches, poles.
//! Every torque is finite there. It is also continuous, except that of a spring at its half turn.

use super::{Felt, all, anywhere, askew, axis, conservative, pointer};
use crate::prelude::*;

fn corners() -> Vec<Quat> {
    let half = |v: Vec3| rotation::from_parts(0.0, v);
    let across = axis().any_orthonormal_vector();
    let mut all = vec![
        Quat::IDENTITY,
        -Quat::IDENTITY,
        half(axis()),
        half(-axis()),
        half(across),
        half(axis().cross(across)),
        half(Vec3::X),
        half(pointer()),
        rotation::exp(axis() * core::f64::consts::PI),
        rotation::exp(axis() * -0.3),
        rotation::exp(axis() * 0.8),
        rotation::exp(across * 0.5),
        rotation::exp(axis() * (core::f64::consts::TAU / 24.0)),
        rotation::exp(axis() * 0.2),
        rotation::exp(Vec3::X * core::f64::consts::FRAC_PI_4),
        rotation::exp(Vec3::ONE.normalize() * core::f64::consts::FRAC_PI_3),
        // The pointer along the normal of the plane.
        Quat::from_rotation_arc(pointer(), axis()),
        Quat::from_rotation_arc(pointer(), -axis()),
    ];
    // A swing of exactly a half turn, with any twist.
    all.extend([0.3, 1.0, 2.0].map(|twist| half(across) * rotation::exp(axis() * twist)));
    // Orientations very close to each of these.
    let near: Vec<Quat> =
        all.iter().flat_map(|x| [1e-300, 1e-16, 1e-9].map(|t| rotation::exp(pointer() * t) * *x)).collect();
    all.extend(near);
    all
}

#[test]
fn every_kind_is_finite_wherever_it_is_asked() {
    let mut rng = Rng(40);
    let base = askew().reference().0;
    for (kind, figures) in all() {
        for x in corners() {
            for omega in [Vec3::ZERO, Vec3::X * 1e-300, rng.vector(30.0), Vec3::Y * 1e6] {
                // The effect is evaluated first at this place, and again after it was elsewhere.
                let mut felt = Felt::with_numbers(kind, &figures);
                felt.moving(base * x, omega);
                felt.moving(anywhere(&mut rng), rng.vector(5.0));
                felt.moving(base * x, omega);
            }
        }
    }
}

#[test]
fn no_conservative_torque_jumps_anywhere_but_a_spring_s_at_a_half_turn() {
    const STEP: f64 = 1e-7;
    let mut rng = Rng(41);
    let base = askew().reference().0;
    for case in conservative() {
        // An anisotropic spring of either law pulls in another direction beyond a half turn.
        if matches!(case.kind, Kind::Spring(_)) {
            continue;
        }
        let anywhere = (0..2000).map(|_| anywhere(&mut rng)).collect::<Vec<_>>();
        for x in corners().into_iter().map(|x| base * x).chain(anywhere) {
            let mut felt = Felt::with_numbers(case.kind, &case.figures);
            let here = felt.at(x);
            for direction in [Vec3::X, Vec3::Y, Vec3::Z, axis(), pointer()] {
                let mut felt = felt.clone();
                let there = felt.at(rotation::exp(direction * STEP) * x);
                // The steepest slopes, about 30 N m/rad, are those of a twist wall as its dial
                // fades, and of a ridge.
                let most = 300.0 * STEP;
                assert!((there - here).length() < most, "{}: {here} to {there} at {x}", case.name);
            }
        }
    }
}

#[test]
fn walls_begin_at_nothing_are_damped_on_the_way_in_alone_and_only_push() {
    let stop =
        EndStop { target: askew(), axis: axis(), cone: Some(0.5), twist: None, stiffness: 3.0, damping: 0.1 };
    let base = askew().reference().0;
    let across = axis().any_orthonormal_vector();
    let out = base * across;
    let torque = |depth: f64, rate: f64| {
        let mut felt = Felt::new(Kind::EndStop(stop));
        felt.moving(base * rotation::exp(across * (0.5 + depth)), out * rate).dot(out)
    };
    assert_eq!(torque(-1e-9, 5.0), 0.0);
    // At the edge the torque is zero to the rounding of the place. In the middle of the first 10
    // mrad it is still soft.
    assert!(torque(0.0, 5.0).abs() < 1e-12);
    assert!((torque(0.005, 5.0) + 0.015 + 0.25).abs() < 1e-12, "{}", torque(0.005, 5.0));
    assert!((torque(0.1, 2.0) + 0.3 + 0.2).abs() < 1e-12);
    assert!((torque(0.1, -2.0) + 0.3).abs() < 1e-12, "not damped on the way out");
    for rate in [-50.0, -1.0, 0.0, 1.0, 50.0] {
        for depth in [0.0, 1e-6, 0.01, 0.3, 2.0, 2.6] {
            assert!(torque(depth, rate) <= 1e-15, "it pulls at {depth}, {rate}");
        }
    }
    // In the opposite direction there is no way out, and no torque.
    let mut felt = Felt::new(Kind::EndStop(stop));
    assert!(felt.at(base * rotation::from_parts(0.0, across)).length() < 1e-12);
}

#[test]
fn walls_of_a_twist_only_push_too_at_either_end() {
    let range = [-0.3, 0.8];
    let stop = EndStop {
        target: askew(),
        axis: axis(),
        cone: None,
        twist: Some(range),
        stiffness: 3.0,
        damping: 0.1,
    };
    let base = askew().reference().0;
    let along = base * axis();
    for (end, out) in [(range[0], -1.0), (range[1], 1.0)] {
        // The torque outwards at a depth in the wall, while the sphere turns outwards at a rate.
        let torque = |depth: f64, rate: f64| {
            let q = base * rotation::exp(axis() * (end + out * depth));
            Felt::new(Kind::EndStop(stop)).moving(q, along * (out * rate)).dot(along) * out
        };
        assert_eq!(torque(-1e-9, 5.0), 0.0);
        for (depth, rate, damping) in [
            (0.1, 2.0, 0.2),
            (0.1, 0.01, 0.001),
            // In the middle of the first 10 mrad half of the damping acts.
            (0.005, 5.0, 0.25),
            (0.1, 0.0, 0.0),
            (0.1, -0.01, 0.0),
            (0.1, -2.0, 0.0),
        ] {
            let (is, want) = (torque(depth, rate), -3.0 * depth - damping);
            assert!((is - want).abs() < 1e-12, "end {end}, depth {depth}, rate {rate}: {is}, not {want}");
        }
    }
}
