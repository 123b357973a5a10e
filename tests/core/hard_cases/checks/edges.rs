//! Crossing half turns with both spring laws, and walls and notches exactly at their edges.

use super::super::core::render::Renderer;
use super::super::core::render::effects::{
    Anchor, Detents, Effect, EndStop, Kind, Motion, Span, Spring, SpringLaw, Target,
};
use super::super::core::{CompiledScene, Mat3, Quat, Real, Vec3, rotation};
use super::machine::rig;

/// Returns the torques (N m in N) of one effect with the sphere at rest at each orientation in
/// turn.
fn felt(kind: Kind, figures: &[Real], way: &[Quat]) -> Vec<Vec3> {
    let span = Span { start: 0, len: figures.len() as u16 };
    let effect = Effect { numbers: span, ..Effect::new(0, 1, kind) };
    let scene = CompiledScene::with_numbers(1, &[effect], figures).unwrap();
    let mut renderer = Renderer::new(&rig());
    way.iter()
        .enumerate()
        .map(|(k, q)| {
            renderer.adopt(&scene, *q);
            let torque =
                renderer.render(&scene, &Motion { q: *q, omega: Vec3::ZERO }, k as u64 + 1, 1e-3, 1.0);
            assert!(torque.is_finite(), "{kind:?} at {q}");
            torque
        })
        .collect()
}

/// Returns a path across a half turn about n1 and back, through exactly a half turn.
fn across() -> Vec<Quat> {
    let turn = |k: i32| match k {
        0 => rotation::from_parts(0.0, Vec3::X),
        k => rotation::exp(Vec3::X * (core::f64::consts::PI as Real + 0.01 * k as Real)),
    };
    (-20..=20).chain((-20..=20).rev()).map(turn).collect()
}

#[test]
fn a_half_turn_is_crossed_by_both_laws() {
    const PI: Real = core::f64::consts::PI as Real;
    let diagonal = Vec3::new(1.0, 4.0, 9.0);
    for (law, largest) in [(SpringLaw::Geodesic, PI), (SpringLaw::Quaternion, 0.2)] {
        let spring =
            Spring::new(law, Mat3::from_diagonal(diagonal), Mat3::ZERO, Quat::IDENTITY, Anchor::Absolute);
        let torques = felt(Kind::Spring(spring.unwrap()), &[], &across());
        let mut flips = 0;
        for pair in torques.windows(2) {
            let step = (pair[1] - pair[0]).length();
            assert!(pair[0].length() <= largest + 64.0 * Real::EPSILON, "{law:?}: {}", pair[0]);
            if pair[0].x * pair[1].x < 0.0 && step > 1.0 {
                // Only the side to which the spring pulls changes.
                assert!((pair[0] + pair[1]).length() <= 0.02, "{law:?}: {} to {}", pair[0], pair[1]);
                flips += 1;
            } else {
                assert!(step <= 0.02, "{law:?}: {} to {}", pair[0], pair[1]);
            }
        }
        // At exactly a half turn the spring stays on the side it came from.
        for k in [20, 61] {
            assert!(
                (torques[k] - torques[k - 1]).length() <= 0.02,
                "{law:?}: {} to {}",
                torques[k - 1],
                torques[k]
            );
        }
        // The side changes once on the way there and once on the way back.
        assert_eq!(flips, if law == SpringLaw::Geodesic { 2 } else { 0 }, "{law:?}");
    }
}

#[test]
fn walls_and_notches_at_exactly_their_edges() {
    let at = |t: Real| rotation::exp(Vec3::Z * t);
    let stop = |cone, twist| {
        Kind::EndStop(EndStop {
            target: Target::N,
            axis: if cone { Vec3::X } else { Vec3::Z },
            cone: cone.then_some(0.5),
            twist: (!cone).then_some(twist),
            stiffness: 1000.0,
            damping: 1.0,
        })
    };
    let small = 16.0 * 1000.0 * Real::EPSILON;
    for (kind, edge) in
        [(stop(true, [0.0; 2]), 0.5), (stop(false, [-0.5, 0.5]), 0.5), (stop(false, [0.0, 0.5]), 0.0)]
    {
        for torque in felt(kind, &[], &[at(edge), -at(edge), at(edge * (1.0 + Real::EPSILON)), at(edge)]) {
            assert!(torque.length() <= small, "{kind:?}: {torque}");
        }
    }
    // 1 mrad inside the wall gives 1 N m inwards. 1 mrad before it gives no torque.
    let torques = felt(stop(false, [-0.5, 0.5]), &[], &[at(0.499), at(0.501), at(-0.501)]);
    assert_eq!(torques[0], Vec3::ZERO);
    assert!((torques[1].z + 1.0).abs() <= small && (torques[2].z - 1.0).abs() <= small, "{torques:?}");
    let dial = |count| {
        Kind::Detents(Detents {
            target: Target::N,
            axis: Vec3::Z,
            strength: 0.2,
            width: 0.1,
            count,
            end_stiffness: 0.0,
            damping: 0.0,
        })
    };
    // The rim and the centre of a notch, the border between two notches, the first and last given
    // position, and a half turn.
    let places = [-0.3, 0.25, 0.45];
    let slope = 0.2 * core::f64::consts::PI as Real / 0.1;
    for t in [-0.3, -0.2, 0.15, 0.25, 0.35, 0.45, 0.55] {
        for torque in felt(dial(0), &places, &[at(t), -at(t)]) {
            assert!(torque.length() <= 16.0 * slope * Real::EPSILON, "{t}: {torque}");
        }
    }
    for count in [1, 2, 24, 1000] {
        let step = (core::f64::consts::TAU / f64::from(count)) as Real;
        for k in [0.0, 0.5, 1.0] {
            let torque = felt(dial(count), &[], &[at(step * k), -at(step * k)]);
            // A notch of 1/1000 turn is steeper as it is narrower.
            let steep = slope.max(0.2 * core::f64::consts::TAU as Real / step) * step.max(1.0);
            assert!(
                torque.iter().all(|t| t.length() <= 64.0 * steep * Real::EPSILON),
                "{count}, {k}: {torque:?}"
            );
        }
    }
}
