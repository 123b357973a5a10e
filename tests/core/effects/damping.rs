//! How much guides and dials damp: their damping times the square of a rate that is measured by
//! moving the sphere a little.

use super::{Felt, anywhere, askew, axis, detents, guide, pointer};
use crate::prelude::*;

/// Returns the rate of the angle `of` while the sphere turns at `omega` (rad/s in N), by central
/// differences over 20 us. `of` is at most a half turn.
fn rate(of: impl Fn(Quat) -> f64, q: Quat, omega: Vec3) -> f64 {
    const H: f64 = 1e-5;
    let [ahead, behind] = [H, -H].map(|h| of(rotation::exp(omega * h) * q));
    rotation::wrap_angle(ahead - behind) / (2.0 * H)
}

/// Returns the power that an effect takes more while the sphere moves than while it is still, W.
fn taken(kind: Kind, q: Quat, omega: Vec3) -> f64 {
    let mut felt = Felt::new(kind);
    let still = felt.at(q);
    (still - felt.moving(q, omega)).dot(omega)
}

#[test]
fn a_guide_damps_the_turns_that_it_holds_and_no_others() {
    const DAMPING: f64 = 0.05;
    let base = askew().reference().0;
    let mut rng = Rng(70);
    for deadband in [0.0, 0.2] {
        for _ in 0..300 {
            let (q, omega) = (anywhere(&mut rng), rng.vector(3.0));
            let along = axis().dot(base.conjugate() * omega);
            // The sine of the angle between the pointer and the plane.
            let rise = rate(|q| (q * pointer()).dot(base * axis()), q, omega);
            for (free, square) in [
                (Freedom::Axis, omega.length_squared() - along * along),
                (Freedom::Swing, along * along),
                (Freedom::Plane(pointer()), rise * rise),
            ] {
                let power = taken(guide(free, DAMPING, deadband), q, omega);
                // The tolerance is the error of the differences: the third derivative times 2e-11.
                assert!((power - DAMPING * square).abs() < 1e-6, "{free:?} at {q}, {omega}: {power} W");
            }
        }
    }
}

/// Beyond a swing of 120 degrees the damping of a dial falls with t² (3 - 2 t), where t is 4
/// cos²(swing/2), to nothing at a half turn.
#[test]
fn the_damping_of_a_dial_fades_with_its_notches() {
    const DAMPING: f64 = 0.02;
    let base = askew().reference().0;
    let across = axis().any_orthonormal_vector();
    let dial = Kind::Detents(Detents { strength: 0.0, ..detents(12, DAMPING) });
    let twist = |q: Quat| {
        let x = base.conjugate() * q;
        2.0 * rotation::vector_part(x).dot(axis()).atan2(x.w)
    };
    let mut rng = Rng(71);
    for swing in [0.0_f64, 1.0, 2.0, 2.2, 2.5, 2.8, 3.0] {
        let t = (2.0 * (1.0 + swing.cos())).min(1.0);
        let fade = t * t * (3.0 - 2.0 * t);
        for _ in 0..50 {
            let spun = rotation::exp(axis() * rng.between(-3.0, 3.0));
            let q =
                base * spun * rotation::exp(across * swing) * rotation::exp(axis() * rng.between(-3.0, 3.0));
            let omega = rng.vector(3.0);
            let turning = rate(twist, q, omega);
            let (power, want) = (taken(dial, q, omega), DAMPING * fade * turning * turning);
            // The tolerance is the error of the differences at a swing of 3 rad, where a small turn
            // twists the dial by up to 14 times as much.
            assert!((power - want).abs() < 1e-6, "swing {swing}: {power} W, not {want} W");
        }
    }
}

/// The damping of a magnet and of a texture is the only number of the effect. Without it the torque
/// does not depend on the rate.
#[test]
fn a_magnet_damps_near_its_target_and_a_texture_across_its_point() {
    const DAMPING: f64 = 0.05;
    let magnet = Magnet { target: askew(), strength: 0.2, width: 0.3 };
    let texture = Texture { at: axis(), wave_number: 30.0, depth: 0.05 };
    let base = askew().reference().0;
    let mut rng = Rng(71);
    for _ in 0..300 {
        let (q, omega) = (anywhere(&mut rng), rng.vector(3.0));
        let chord = 2.0 * (0.5 * rotation::angle_between(q, base)).sin();
        let near = (-0.5 * (chord / magnet.width).powi(2)).exp();
        let across = omega - axis() * axis().dot(omega);
        for (kind, expected) in
            [(Kind::Magnet(magnet), omega * (-DAMPING * near)), (Kind::Texture(texture), across * -DAMPING)]
        {
            let mut damped = Felt::with_numbers(kind, &[DAMPING]);
            let drag = damped.moving(q, omega) - damped.at(q);
            // Rounding of torques of 0.2 N m.
            assert!((drag - expected).length() < 1e-14, "{kind:?}: {drag} instead of {expected}");
            let mut free = Felt::new(kind);
            let still = free.at(q);
            assert_eq!(free.moving(q, omega), still, "{kind:?}");
        }
    }
}
