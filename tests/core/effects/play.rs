//! Dead bands: no torque within, and beyond them that of the excess alone.

use super::{Felt, askew, axis, guide};
use crate::prelude::*;

/// Half width of the dead bands, rad, and the stiffness beyond them, N m/rad.
const PLAY: f64 = 0.2;
const STIFFNESS: f64 = 3.0;

fn spring(law: SpringLaw) -> Kind {
    let stiffness = Mat3::IDENTITY * STIFFNESS;
    let spring = Spring::new(law, stiffness, Mat3::ZERO, askew().reference().0, Anchor::Absolute);
    Kind::Spring(spring.unwrap().with_deadband(PLAY))
}

fn track() -> Kind {
    let path =
        TrackPath::Swing { axis: Vec3::X, amplitude: 0.0, from: 1.0, to: 1.0, sweep: 0.0, repeat: false };
    Kind::Track(Track { target: askew(), path, stiffness: STIFFNESS, damping: 0.0, deadband: PLAY })
}

#[test]
fn a_dead_band_is_free_and_the_torque_beyond_it_begins_at_nothing() {
    let base = askew().reference().0;
    let across = axis().any_orthonormal_vector();
    // Each effect with a direction in which it holds the sphere. A turn about `across` x `axis`
    // lifts the pointer `across` straight out of the plane.
    for (kind, held) in [
        (spring(SpringLaw::Geodesic), across),
        (spring(SpringLaw::Quaternion), across),
        (guide(Freedom::Axis, 0.0, PLAY), across),
        (guide(Freedom::Swing, 0.0, PLAY), axis()),
        (guide(Freedom::Plane(across), 0.0, PLAY), across.cross(axis())),
        (track(), across),
    ] {
        let mut felt = Felt::new(kind);
        // The torque about the direction `held`, against a turn about it.
        let mut back = |angle: f64| {
            let torque = felt.at(base * rotation::exp(held * angle));
            let along = base * held;
            let back = -torque.dot(along);
            assert!((torque + along * back).length() < 1e-14, "{kind:?} pushes aside: {torque}");
            back * angle.signum()
        };
        for side in [1.0, -1.0] {
            // `enable` and the soft start ask for the excess too.
            for (angle, excess) in [(0.5 * PLAY, 0.0), (PLAY + 0.3, 0.3)] {
                let told = kind.excess(base, base * rotation::exp(held * (side * angle)), &[]);
                assert!((told.expect("it rests somewhere") - excess).abs() < 1e-12, "{kind:?}: {told:?}");
            }
            assert_eq!(back(0.0), 0.0, "{kind:?}");
            for k in 0..20 {
                let angle = side * PLAY * f64::from(k) / 20.0;
                assert_eq!(back(angle), 0.0, "{kind:?} at {angle}");
            }
            // Just outside the dead band, the torque is at most that of the excess. It is at least
            // that times the squared cosine of the dead band (the plane), or of half of it (the
            // laws of quaternions).
            let least = PLAY.cos().powi(2) - 0.01;
            for excess in [1e-6, 1e-4, 1e-3] {
                let part = back(side * (PLAY + excess)) / (STIFFNESS * excess);
                assert!(part > least && part < 1.0 + 1e-8, "{kind:?}, {excess} beyond: {part}");
            }
            // Well beyond it the torque is still less than without the dead band.
            let part = back(side * 0.8) / (STIFFNESS * (0.8 - PLAY));
            assert!(part > 0.5 && part < 1.0 + 1e-12, "{kind:?}: {part}");
        }
    }
}

#[test]
fn a_damper_with_a_dead_band_damps_the_excess_of_the_rate() {
    const DAMPING: f64 = 0.02;
    let damper = Damper::new(Mat3::IDENTITY * DAMPING).unwrap();
    for band in [0.0, 0.7] {
        let mut felt = Felt::new(Kind::Damper(damper.with_deadband(band)));
        for rate in [0.0_f64, 0.1, 0.69, 0.71, 1.0, 5.0, 40.0] {
            let torque = felt.moving(Quat::IDENTITY, axis() * rate);
            let want = -DAMPING * (rate - band).max(0.0);
            assert!((torque - axis() * want).length() < 1e-14, "{rate} rad/s: {torque}");
        }
    }
}
