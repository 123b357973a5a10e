//! The plant approaches the reference as its order predicts, and comes closer with a smaller step.

use hbot_sim::phenomena::CageFriction;

use super::reference::{End, Sharpness};
use super::scenes::{self, Scene, turned_apart};

/// Lengths of the step with which each scene is simulated: 1 ms, and a quarter, a twentieth and a
/// hundredth of it, in s.
const STEPS: [f64; 4] = [1.0e-3, 2.5e-4, 5.0e-5, 1.0e-5];

/// Returns the end of the scene as computed by the independent reference, and an estimate of its
/// error, rad.
///
/// The estimate is the sum of three changes of the end: by a regularisation ten times as sharp, a
/// gear ten times as hard, and a tolerance ten times as tight.
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

/// Checks that the plant's errors at [`STEPS`] are at most `rate` times the step plus the error of
/// the reference.
///
/// `order` is the range in which the order of the orientation error must lie, measured from the
/// first step to the third.
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
fn the_plant_moves_as_the_reference_in_each_scene() {
    agrees(&scenes::slide(), 5.0, 0.95..1.05);
    agrees(&scenes::stick_slip(), 8.0, 0.8..1.1);
    // Inputs are taken at the middle of each step, so only the contact of the gear's flanks has an
    // error of order 1. That error is small.
    agrees(&scenes::backlash(), 0.1, 1.0..2.2);
    agrees(&scenes::lossy(), 3.0, 0.9..1.3);
    agrees(&scenes::cage(), 2.0, 0.95..1.05);
    agrees(&scenes::pivoting(), 30.0, 0.9..1.1);
    // The largest error is that of a drive that slips and meets its gear's flanks again and again;
    // it turns 5 rad in all. The order is uneven because the step affects when the flanks meet.
    agrees(&scenes::everything(), 100.0, 0.7..1.2);
}

/// A part that is held by friction does not move at all in the plant. In the independent reference
/// it creeps, in proportion to its regularisation speed, because the reference replaces dry
/// friction by a smooth law.
#[test]
fn what_is_held_stays() {
    let scene = scenes::held();
    let creep = |rate: f64| {
        let end = scene.by_reference(Sharpness { rate, ..scene.sharpness });
        scene.apart(&end, &scene.stepped(1.0e-3))
    };
    let (blunt, sharp) = (creep(1.0e-4), creep(1.0e-5));
    println!("held: the reference creeps {blunt:.1e} and {sharp:.1e} rad");
    // A sharpness ten times as great gives a tenth of the creep, so there is no other difference.
    assert!((blunt / sharp - 10.0).abs() < 0.2, "{blunt:e} {sharp:e}");
    let end = scene.stepped(1.0e-3);
    assert!(scene.apart(&end, &scene.by_reference(Sharpness { rate: 1e-8, ..scene.sharpness })) < 1e-8);
}

/// With off-centre masses and nothing that sticks, the method Rk4 has order four down to the error
/// of the reference, and the time-stepping scheme has order one.
#[test]
fn masses_out_of_place() {
    let scene = scenes::smooth();
    let best = scene.by_reference(scene.sharpness);
    let looser =
        scene.by_reference(Sharpness { tolerance: 10.0 * scene.sharpness.tolerance, ..scene.sharpness });
    let own = scene.apart(&looser, &best);
    let errors = [2.0e-3, 1.0e-3, 1.0e-4].map(|h| scene.apart(&scene.stepped(h), &best));
    println!("masses out of place: Rk4 off by [{}], reference's own {own:.1e}", listed(&errors));
    assert!(((errors[0] / errors[1]).log2() - 4.0).abs() < 0.3, "{}", listed(&errors));
    assert!(errors[2] < 1.0e-9, "{:e}", errors[2]);

    // A cage without friction selects the time-stepping scheme.
    let mut stepping = scenes::smooth();
    stepping.phenomena.cage_friction = Some(CageFriction { torque: 0.0 });
    let errors = STEPS.map(|h| stepping.apart(&stepping.stepped(h), &best));
    println!("masses out of place: time stepping off by [{}]", listed(&errors));
    assert!(((errors[0] / errors[2]).ln() / 20.0f64.ln() - 1.0).abs() < 0.05, "{}", listed(&errors));
}
