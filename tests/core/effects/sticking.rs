//! Friction sticks below its torque and slides at it.

use super::Felt;
use crate::prelude::*;
use hbot_core::render::effects::Friction;

const FRICTION: Friction = Friction { torque: 0.05, stiffness: 5.0, damping: 0.02 };
/// Inertia of the prototype's sphere, kg m².
const INERTIA: f64 = 3.24e-3;

/// A sphere under friction and a load, simulated by the semi-implicit Euler method.
struct Body {
    felt: Felt,
    q: Quat,
    omega: Vec3,
}

impl Body {
    fn new() -> Self {
        Self { felt: Felt::new(Kind::Friction(FRICTION)), q: Quat::IDENTITY, omega: Vec3::ZERO }
    }

    fn step(&mut self, load: Vec3) {
        let torque = self.felt.moving(self.q, self.omega) + load;
        self.omega += torque * (DT / INERTIA);
        self.q = rotation::renormalized(rotation::exp(self.omega * DT) * self.q);
    }
}

#[test]
fn a_million_ticks_of_a_load_below_the_limit_do_not_move_it() {
    let mut body = Body::new();
    let mut first = Quat::IDENTITY;
    let mut swing = 0.0_f64;
    for k in 0..1_000_000_u32 {
        // The load moves around a cone once per second, at 90 % of the limit. The swings of the
        // bristle are six times as fast.
        let (s, c) = (core::f64::consts::TAU * f64::from(k % 1000) / 1000.0).sin_cos();
        body.step(
            Vec3::new(0.6 * s, -0.8 * s, if k < 1000 { s } else { c - 1.0 } * 0.3) * (0.9 * FRICTION.torque),
        );
        // The initial swings have decayed: 30 times their time constant of 2 I/D = 0.3 s.
        if k == 9999 {
            first = body.q;
        }
        swing = swing.max(rotation::log(body.q).length());
    }
    let drift = rotation::angle_between(body.q, first);
    println!("friction: drift {drift:.1e} rad in a million ticks");
    // The bound is what friction must achieve. The actual drift is the rounding of a million turns.
    assert!(drift < 1e-6, "{drift:e} rad");
    assert!(swing > 0.5 * FRICTION.torque / FRICTION.stiffness, "the load did bend the bristle: {swing}");
}

#[test]
fn it_slides_at_its_torque_and_holds_wherever_it_is_left() {
    let mut body = Body::new();
    for k in 0..4000 {
        body.step(Vec3::X * (0.99 * FRICTION.torque * f64::from(k) / 4000.0));
    }
    let stuck = body.q;
    assert!(rotation::log(stuck).length() < FRICTION.torque / FRICTION.stiffness);
    for _ in 0..1000 {
        body.step(Vec3::X * (1.1 * FRICTION.torque));
    }
    assert!(rotation::angle_between(stuck, body.q) > 0.05, "it slides");
    // 30 time constants 2 I/D of the swings of the bristle.
    for _ in 0..10_000 {
        body.step(Vec3::ZERO);
    }
    let left = body.q;
    for _ in 0..20_000 {
        body.step(Vec3::ZERO);
    }
    assert!(rotation::angle_between(left, body.q) < 1e-9, "it stays where it was left");
}

#[test]
fn without_a_torque_to_stick_only_the_damping_is_left() {
    let mut felt = Felt::new(Kind::Friction(Friction { torque: 0.0, ..FRICTION }));
    // It begins at rest, where the bristle has no length.
    for k in 0..100 {
        let (q, omega) = (rotation::exp(Vec3::X * (0.001 * f64::from(k / 2))), Vec3::Y * f64::from(k % 3));
        let torque = felt.moving(q, omega);
        assert!((torque + omega * FRICTION.damping).length() < 1e-15, "tick {k}: {torque}");
    }
}
