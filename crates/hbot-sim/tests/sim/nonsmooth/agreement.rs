//! The plant against the reference: as near as a step of its order lets it be, and nearer with the step.

use hbot_sim::phenomena::CageFriction;

use super::reference::{End, Sharpness};
use super::scenes::{self, Scene, turned_apart};

/// Steps of a millisecond, a quarter, a twentieth and a hundredth.
const STEPS: [f64; 4] = [1.0e-3, 2.5e-4, 5.0e-5, 1.0e-5];

/// The reference with its own error: what a regularisation ten times as sharp, a gear ten times as hard and a tolerance
/// ten times as tight change of it.
fn reference(scene: &Scene) -> (End, f64) {
    let sharp = scene.sharpness;
    let best = scene.by_reference(sharp);
    let others = [
        Sharpness { rate: 0.1 * sharp.rate, ..sharp },
        Sharpness { flank: 10.0 * sharp.flank, ..sharp },
        Sharpness { tolerance: 0.1 * sharp.tolerance, ..sharp },
    ];
    let own = others.map(|other| scene.apart(&scene.by_reference(other), &best));
    (best, own.iter().sum())
}

fn listed(errors: &[f64]) -> String {
    errors.iter().map(|error| format!("{error:.1e}")).collect::<Vec<_>>().join(", ")
}

/// Errors at [`STEPS`]: each at most `rate` times the step and the reference's own; `order` is that of orientation from the
/// first step to the third, where events do not come and go with the step. All within these.
fn agrees(scene: &Scene, rate: f64, order: core::ops::Range<f64>) {
    let (best, own) = reference(scene);
    let ends = STEPS.map(|h| scene.stepped(h));
    let errors = ends.map(|end| scene.apart(&end, &best));
    let turns = ends.map(|end| turned_apart(&end, &best));
    let measured = (turns[0] / turns[2]).ln() / (STEPS[0] / STEPS[2]).ln();
    println!(
        "{}: off by [{}], orientation by [{}], order {measured:.2}; reference's own {own:.1e}",
        scene.name,
        listed(&errors),
        listed(&turns)
    );
    for (h, error) in STEPS.iter().zip(errors) {
        assert!(error <= rate * h + own, "{}: off by {error:e} rad at {h:e} s", scene.name);
    }
    assert!(order.contains(&measured), "{}: order {measured:.2}", scene.name);
}

#[test]
fn all() {
    for (s, rate) in [(scenes::slide(), 5.0), (scenes::stick_slip(), 10.0), (scenes::backlash(), 1.0), (scenes::lossy(), 10.0), (scenes::cage(), 3.0), (scenes::pivoting(), 25.0), (scenes::everything(), 100.0)] {
        agrees(&s, rate, 0.0..9.0);
    }
    let s = scenes::smooth();
    let best = s.by_reference(s.sharpness);
    for t in [1e-11, 1e-12, 1e-13, 1e-14] {
    println!("tol {t} {:e}", s.apart(&s.by_reference(Sharpness{tolerance: t, ..s.sharpness}), &best));
    }
    for h in [1e-3, 5e-4, 2.5e-4, 1e-4] { println!("rk4 {h} {:e}", s.apart(&s.stepped(h), &best)); }
    let mut n = scenes::smooth();
    n.phenomena.cage_friction = Some(CageFriction { torque: 0.0 });
    for h in STEPS { println!("ts {h} {:e}", n.apart(&n.stepped(h), &best)); }
}
