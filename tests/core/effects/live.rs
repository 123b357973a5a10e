//! Changes while the rig runs: scenes, parameters, references, fades. The torque never steps.

use super::{active, anywhere, axis, conservative, detents, dissipative, end_stop, pointer};
use crate::prelude::*;
use hbot_core::render::effects::Guide;

fn scene(revision: u64, kind: Kind, figures: &[f64]) -> CompiledScene {
    let span = Span { start: 0, len: figures.len() as u16 };
    CompiledScene::with_numbers(
        revision,
        &[Effect { numbers: span, ..effect(0, revision as u32, kind) }],
        figures,
    )
    .unwrap()
}

/// Changes from any kind of effect to any other while the sphere is held. No tick changes the
/// torque by more than the steepest slope of the blend allows for the whole change.
#[test]
fn from_any_still_kind_to_any_other_torque_goes_without_a_step() {
    let rig = altered(&rig(), |rig| {
        (rig.limits.torque_rate, rig.limits.enable_max_angle) = (1e6, std::f64::consts::PI)
    });
    let mut kinds: Vec<_> = conservative().into_iter().map(|case| (case.kind, case.figures)).collect();
    kinds.extend(dissipative());
    // The effects are so soft that no limit of the motors affects the blend.
    let soft = |revision, kind, figures: &[f64]| {
        let span = Span { start: 0, len: figures.len() as u16 };
        let effect = Effect { numbers: span, gain: 0.05, ..effect(0, revision as u32, kind) };
        CompiledScene::with_numbers(revision, &[effect], figures).unwrap()
    };
    let mut rng = Rng(50);
    let mut bench = Bench::active(rig, soft(1, kinds[0].0, &kinds[0].1));
    // Moves away from all references.
    for _ in 0..400 {
        bench.turn(Vec3::new(1.0, -0.6, 0.4));
    }
    bench.sphere.omega = Vec3::ZERO;
    let mut before = bench.run(3).state.torque;
    for revision in 2..150 {
        let (kind, figures) = &kinds[rng.below(kinds.len() as u64) as usize];
        bench.scene = soft(revision, *kind, figures);
        let mut last = before;
        let mut steepest = 0.0_f64;
        for _ in 0..60 {
            let torque = bench.step().state.torque;
            steepest = steepest.max((torque - last).length());
            last = torque;
        }
        // The blend is linear in 50 ms.
        let change = (last - before).length();
        assert!(steepest <= change / 50.0 + 1e-12, "{kind:?}: {steepest} of {change}");
        before = last;
    }
}

/// For any kinds, changes and references the rig's slew limit holds, and every number is finite.
#[test]
fn nothing_that_a_client_does_is_faster_than_the_slew_limit() {
    let rig = altered(&rig(), |rig| {
        rig.limits.torque_rate = 20.0;
        rig.limits.enable_max_angle = std::f64::consts::PI;
        rig.limits.slip = 10.0;
    });
    let mut kinds = active();
    kinds.extend(conservative().into_iter().map(|case| (case.kind, case.figures)));
    let mut rng = Rng(51);
    let mut bench = Bench::active(rig, scene(1, kinds[0].0, &kinds[0].1));
    let (mut last, mut revision, mut fastest) = (bench.step().state.torque, 1, 0.0_f64);
    for _ in 0..6000 {
        if rng.once_in(60) {
            revision += 1;
            let (kind, figures) = &kinds[rng.below(kinds.len() as u64) as usize];
            bench.scene = scene(revision, *kind, figures);
        }
        let torque = if rng.once_in(40) {
            let (q, omega) = (anywhere(&mut rng), rng.vector(2.0));
            let stamp = Stamp::default();
            let epoch = revision as u32;
            bench
                .command(Command::Reference { slot: 0, epoch, q, omega, valid_ticks: 20, stamp })
                .state
                .torque
        } else {
            bench.turn(rng.vector(3.0)).state.torque
        };
        fastest = fastest.max((torque - last).length());
        last = torque;
    }
    // The torque goes through the joints and back, with rounding.
    assert!((fastest - 20.0e-3).abs() < 1e-12, "{fastest} N m in a tick");
}

/// Rounding of a fade whose clock is a sum of ticks: ten roundings of the sum.
const ROUNDING: f64 = 1e-12;

fn pull() -> Effect {
    effect(0, 9, Kind::Constant(Constant { torque: Vec3::X * 0.2, frame: Frame::World }))
}

#[test]
fn an_effect_fades_in_and_out_over_its_times() {
    let fading = Effect { fade_s: 0.2, fade_out_s: 0.1, ..pull() };
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    bench.scene = CompiledScene::new(1, &[fading]).unwrap();
    for k in 0..200 {
        let torque = bench.step().state.torque.x;
        assert!((torque - 0.2 * f64::from(k) / 200.0).abs() < ROUNDING, "{k} ms: {torque}");
    }
    assert!((bench.run(100).state.torque.x - 0.2).abs() < ROUNDING);
    bench.scene = CompiledScene::new(2, &[Effect { leaving: true, ..fading }]).unwrap();
    for k in 0..100 {
        let torque = bench.step().state.torque.x;
        assert!((torque - 0.2 * (1.0 - f64::from(k) / 100.0)).abs() < ROUNDING, "{k} ms: {torque}");
    }
    assert!(bench.run(3).state.torque.length() < ROUNDING);
    // Other changes do not bring the effect back.
    bench.scene = CompiledScene::new(3, &[Effect { leaving: true, ..fading }]).unwrap();
    assert!(bench.run(60).state.torque.length() < ROUNDING);
}

#[test]
fn one_that_leaves_in_the_middle_of_its_coming_goes_from_there() {
    let fading = Effect { fade_s: 0.2, fade_out_s: 0.1, ..pull() };
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    bench.scene = CompiledScene::new(1, &[fading]).unwrap();
    bench.run(100);
    bench.scene = CompiledScene::new(2, &[Effect { leaving: true, ..fading }]).unwrap();
    for k in 0..110 {
        let torque = bench.step().state.torque.x;
        // The fade reverses within a tick. The increase missed in that tick is blended.
        let want = 0.1 * (1.0 - f64::from(k) / 100.0).max(0.0);
        assert!((torque - want).abs() < 1.001e-3, "{k} ms: {torque}");
    }
    // The leaving effect no longer accepts references.
    let stamp = Stamp::default();
    let command =
        Command::Reference { slot: 0, epoch: 9, q: Quat::IDENTITY, omega: Vec3::ZERO, valid_ticks: 1, stamp };
    assert_eq!(bench.command(command).reply(), Reply::Refused(Refusal::NoReference));
}

#[test]
fn one_that_was_leaving_when_the_rig_went_idle_does_not_come_back() {
    let fading = Effect { fade_out_s: 10.0, ..pull() };
    let mut bench = Bench::active(rig(), CompiledScene::new(1, &[fading]).unwrap());
    bench.scene = CompiledScene::new(2, &[Effect { leaving: true, ..fading }]).unwrap();
    assert!(bench.run(100).state.torque.x > 0.19);
    bench.command(Command::Disable);
    bench.run(100);
    bench.command(Command::Enable);
    assert_eq!(bench.run(700).state.torque, Vec3::ZERO);
}

#[test]
fn enable_is_refused_with_the_angle_to_the_nearest_rest_of_each_kind() {
    let rig = altered(&rig(), |rig| rig.limits.enable_max_angle = 0.05);
    let q = rotation::exp(Vec3::new(0.3, -0.5, 0.4));
    let across = axis().any_orthonormal_vector();
    // The reference relative to which the sphere is at `x`.
    let target = |x: Quat| Target::new(q * x.conjugate(), Anchor::Absolute).unwrap();
    let swung = |swing: f64, twist: f64| rotation::exp(across * swing) * rotation::exp(axis() * twist);
    let dial = |psi, end_stiffness| {
        Kind::Detents(Detents { target: target(swung(0.4, psi)), end_stiffness, ..detents(0, 0.0) })
    };
    // The cone is 0.5 rad wide, and the twist goes from -0.3 to 0.8 rad.
    let walls =
        |swing, twist| Kind::EndStop(EndStop { target: target(swung(swing, twist)), ..end_stop(0.0) });
    let hinge = |x, free| {
        let (stiffness, damping, deadband) = (3.0, 0.0, 0.0);
        Kind::Guide(Guide { target: target(x), axis: axis(), free, stiffness, damping, deadband })
    };
    // The pointer at the angle `rise` above the plane of the guide.
    let plane = |rise: f64| {
        let up = across * rise.cos() + axis() * rise.sin();
        hinge(Quat::from_rotation_arc(pointer(), up), Freedom::Plane(pointer()))
    };
    // A path that begins `away` from the sphere.
    let first = rotation::exp(Vec3::new(0.2, 0.6, -0.3));
    let track = |away: Vec3| {
        let target = Target::new(first.conjugate() * rotation::exp(away) * q, Anchor::Absolute).unwrap();
        let path = TrackPath::Points { rest: false, repeat: false };
        Kind::Track(Track { target, path, stiffness: 2.0, damping: 0.0, deadband: 0.0 })
    };
    let [w, x, y, z] = rotation::to_wxyz(first);
    let points = vec![0.0, w, x, y, z, 1.0, 1.0, 0.0, 0.0, 0.0];
    let ends = vec![0.4, 1.0];
    let half = target(swung(0.0, std::f64::consts::PI));
    let cases = [
        (dial(-0.5, 2.0), ends.clone(), 0.9),
        (dial(1.8, 2.0), ends.clone(), 0.8),
        (dial(0.7, 2.0), ends.clone(), 0.0),
        // An open dial has no walls, and rests anywhere beyond its last notch.
        (dial(-0.5, 0.0), ends, 0.0),
        (walls(1.2, 0.1), vec![], 0.7),
        (walls(0.2, 1.4), vec![], 0.6),
        (walls(0.2, -1.0), vec![], 0.7),
        (walls(0.9, 1.0), vec![], 0.4),
        (walls(0.2, 0.1), vec![], 0.0),
        (hinge(swung(0.6, 0.0), Freedom::Axis), vec![], 0.6),
        (hinge(swung(0.0, 2.0), Freedom::Axis), vec![], 0.0),
        (hinge(swung(0.0, -0.7), Freedom::Swing), vec![], 0.7),
        (hinge(swung(2.0, 0.0), Freedom::Swing), vec![], 0.0),
        (plane(0.9), vec![], 0.9),
        (plane(-0.4), vec![], 0.4),
        (plane(0.0), vec![], 0.0),
        (track(Vec3::new(0.0, 0.48, -0.64)), points.clone(), 0.8),
        (track(Vec3::ZERO), points, 0.0),
        // The torque of a magnet does not grow with the angle.
        (Kind::Magnet(Magnet { target: half, strength: 0.2, width: 0.3 }), vec![], 0.0),
    ];
    for (kind, figures, angle) in cases {
        let mut bench = Bench::new(rig);
        bench.run(5);
        bench.command(Command::Align { q, weight: 1.0, tick: 3 });
        bench.scene = scene(1, kind, &figures);
        bench.step();
        match bench.command(Command::Enable).reply() {
            Reply::Done => assert_eq!(angle, 0.0, "{kind:?}"),
            Reply::Refused(Refusal::TooFar { slot: 0, angle: said }) => {
                assert!((said - angle).abs() < 1e-9, "{kind:?}: {said} rad, not {angle}");
            }
            other => panic!("{other:?}"),
        }
    }
}
