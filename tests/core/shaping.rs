//! The stages between the scene and the motors: soft start, ramps, blending, streams, limits.

use crate::prelude::*;

/// The turn of a spring, rad. With 2 N m/rad it gives 0.5 N m about n1.
pub const WOUND: Vec3 = Vec3::new(0.25, 0.0, 0.0);

/// Rounding of a torque that goes through the joints and back, N m.
pub const ROUNDING: f64 = 1e-13;

#[test]
fn torque_comes_softly_over_half_a_second() {
    let mut bench = Bench::new(rig());
    bench.scene = spring_scene(1, 2.0, WOUND);
    bench.step();
    assert_eq!(bench.command(Command::Enable).state.mode, Mode::Enabling);
    let torque: Vec<f64> = (0..600).map(|_| bench.step().state.torque.x).collect();
    assert!(torque.windows(2).all(|w| w[1] >= w[0] - ROUNDING), "it only grows");
    // In the first 50 ms the scene itself is blended in. After that only the gain of the soft start
    // matters.
    for at in [100, 250, 400] {
        let want = 0.5 * (at + 2) as f64 / 500.0;
        assert!((torque[at] - want).abs() < 1e-9, "after {at} ms: {}", torque[at]);
    }
    assert!((torque[599] - 0.5).abs() < ROUNDING);
    // The gain is a sum of 500 rounded terms, so half a second can take a tick longer.
    let full = torque.iter().position(|t| (t - 0.5).abs() < ROUNDING).unwrap();
    assert!((497..=500).contains(&full), "full after {full} ticks");
    assert_eq!(bench.step().state.mode, Mode::Active);
}

#[test]
fn torque_goes_within_50_ms_of_disable() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
    let first = bench.command(Command::Disable);
    assert_eq!(first.state.mode, Mode::Idle);
    assert!(first.drive.enable, "the ramp needs its motors");
    let torque: Vec<f64> = (1..60).map(|_| bench.step().state.torque.x).collect();
    for at in [10, 25, 40] {
        // k ticks after the command, k + 1 steps of the ramp have been made.
        let want = 0.5 * (1.0 - (at + 1) as f64 / 50.0);
        assert!((torque[at - 1] - want).abs() < 1e-9, "after {at} ms: {}", torque[at - 1]);
    }
    assert!(torque[50..].iter().all(|t| *t == 0.0));
    assert!(!bench.step().drive.enable);
}

#[test]
fn motors_stay_on_for_the_ramp_of_a_disable_even_without_torque() {
    // Otherwise a torque that crosses zero within its ramp would switch the motors off and on.
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let off = (0..60).find(|k| {
        let outputs = if *k == 0 { bench.command(Command::Disable) } else { bench.step() };
        !outputs.drive.enable
    });
    // The gain is a sum of 50 rounded terms, so 50 ms can take a tick longer.
    assert!(off.is_some_and(|tick| (49..=50).contains(&tick)), "{off:?}");
}

/// Returns a scene with a constant torque (N m in N) in slot 0.
pub fn constant(revision: u64, torque: Vec3) -> CompiledScene {
    let kind = Kind::Constant(Constant { torque, frame: Frame::World });
    CompiledScene::new(revision, &[effect(0, revision as u32, kind)]).unwrap()
}

#[test]
fn full_torque_comes_over_half_a_second_however_much_is_asked_for() {
    let rig = altered(&rig(), |rig| rig.limits.torque = 0.9);
    // A torque within the limit, ten times and ten thousand times as much, and a stiff spring at
    // its largest angle.
    let scenes = [
        constant(1, Vec3::Y * 0.8),
        constant(1, Vec3::Y * 9.0),
        constant(1, Vec3::Y * 9000.0),
        spring_scene(1, 40.0, Vec3::Y * 0.45),
    ];
    for scene in scenes {
        let mut bench = Bench::new(rig);
        bench.scene = scene;
        bench.step();
        bench.command(Command::Enable);
        let torque: Vec<f64> = (0..600).map(|_| bench.step().state.torque.length()).collect();
        let full = torque[599];
        let ninety = torque.iter().position(|t| *t >= 0.9 * full).unwrap();
        assert!((440..=450).contains(&ninety), "90 % of {full} N m after {ninety} ms");
        let envelope = (0..600).all(|k| torque[k] <= 0.9 * (k + 2) as f64 / 500.0 + ROUNDING);
        assert!(envelope, "{torque:?}");
    }
}

#[test]
fn a_disable_and_the_end_of_a_stream_keep_the_slew_limit_however_much_is_asked_for() {
    for (torque_rate, ms) in [(TORQUE_RATE, 50), (10.0, 90)] {
        for size in [0.8, 1e6] {
            let limits = (0.9, torque_rate);
            let rig = altered(&rig(), |rig| (rig.limits.torque, rig.limits.torque_rate) = limits);
            let ends = |bench: &mut Bench, most: f64| {
                let mut last = bench.step().state.torque;
                let zero = (0..200).find(|_| {
                    let torque = bench.step().state.torque;
                    assert!((torque - last).length() <= most + ROUNDING, "{last} to {torque}");
                    last = torque;
                    torque == Vec3::ZERO
                });
                zero.expect("it ends")
            };
            let mut bench = Bench::active(rig, constant(1, Vec3::Y * size));
            bench.command(Command::Disable);
            // No step exceeds the slew limit, or the ramp of 50 ms.
            let most = (torque_rate * DT).min(0.9 / 50.0);
            let took = ends(&mut bench, most);
            assert!((ms - 12..=ms).contains(&took), "disabled in {took} ms at {torque_rate} N m/s");
            assert!(!bench.step().drive.enable);
            // A stream of 20 ms, and its ramp of 20 ms.
            let mut bench = Bench::active(rig, CompiledScene::empty());
            bench.command(stream(Vec3::Y * size, 200));
            bench.run(199);
            let took = ends(&mut bench, (torque_rate * DT).min(0.9 / 20.0));
            assert!(took <= ms, "a stream ended in {took} ms at {torque_rate} N m/s");
        }
    }
}

#[test]
fn a_far_scene_or_reference_under_power_comes_over_half_a_second() {
    let rig = altered(&rig(), |rig| rig.limits.torque = 0.9);
    let half_a_turn = Quat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    let placed = |reference_revision, stiffness: f64, to: Quat| {
        let spring = spring(stiffness, 0.0, to, Anchor::Absolute);
        let effect = Effect { reference_revision, ..effect(0, 1, spring) };
        move |revision| CompiledScene::new(revision, &[effect]).unwrap()
    };
    // Another effect, a new reference for an effect, and a new stiffness for an effect whose
    // reference is already far.
    let far_effect =
        CompiledScene::new(2, &[effect(3, 9, spring(1000.0, 0.0, half_a_turn, Anchor::Absolute))]);
    let far_reference = placed(1, 1000.0, half_a_turn);
    for (name, scene) in [("load", far_effect.unwrap()), ("set", far_reference(2))] {
        let mut bench = Bench::active(rig, placed(0, 1000.0, rotation::exp(Vec3::Z * 0.0004))(1));
        let before = bench.step().state.torque;
        assert!((before.length() - 0.4).abs() < 1e-9);
        bench.scene = scene;
        let torque: Vec<Vec3> = (0..700).map(|_| bench.step().state.torque).collect();
        // The old torque is gone within 50 ms, and full torque takes half a second.
        assert!((torque[0] - before).length() < 0.05, "{name}: no step");
        for k in 0..500 {
            let left = 0.4 * (1.0 - k as f64 / 50.0).max(0.0);
            let most = 0.9 * (k + 1) as f64 / 500.0 + left;
            assert!(torque[k].length() <= most + ROUNDING, "{name}, after {k} ms: {}", torque[k]);
        }
        assert!(torque[699].length() > 0.899, "{name}: {}", torque[699]);
    }
    // The hand holds a soft spring far from its reference. A change of its stiffness acts at once.
    let mut bench = Bench::active(rig, placed(0, 0.2, Quat::IDENTITY)(1));
    for _ in 0..600 {
        bench.turn(Vec3::Y * 2.0);
    }
    bench.sphere.omega = Vec3::ZERO;
    let before = bench.run(5).state.torque.length();
    for k in 0..20 {
        bench.scene = placed(0, 0.2 + 0.01 * f64::from(k), Quat::IDENTITY)(2 + k as u64);
        let torque = bench.run(20).state.torque.length();
        assert!(torque >= before - ROUNDING, "{torque} N m of {before}");
    }
    // A change to a hundred times the stiffness does not act at once.
    bench.scene = placed(0, 20.0, Quat::IDENTITY)(100);
    let torque: Vec<f64> = (0..600).map(|_| bench.step().state.torque.length()).collect();
    assert!(torque[80] < 0.2 && torque[440] < 0.85 && torque[599] > 0.899, "{} {}", torque[80], torque[440]);
}

#[test]
fn enable_is_refused_where_a_reference_is_too_far_with_slot_and_angle() {
    let far = effect(5, 1, spring(2.0, 0.0, rotation::exp(Vec3::Y * 0.6), Anchor::Absolute));
    let near = effect(2, 2, spring(2.0, 0.0, rotation::exp(Vec3::Y * 0.4), Anchor::Absolute));
    let mut bench = Bench::new(rig());
    bench.scene = CompiledScene::new(1, &[near, far]).unwrap();
    bench.step();
    let outputs = bench.command(Command::Enable);
    let Reply::Refused(Refusal::TooFar { slot: 5, angle }) = outputs.reply() else {
        panic!("{:?}", outputs.reply())
    };
    assert!((angle - 0.6).abs() < 1e-15, "{angle}");
    assert_eq!(outputs.state.mode, Mode::Idle);
    // After the sphere is turned nearer, enable is accepted.
    for _ in 0..200 {
        bench.turn(Vec3::Y);
    }
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
}

/// A dead band counts, since the sphere rests in it. An anchor at the sphere does not: a reference
/// that is turned away from it pulls as far.
#[test]
fn enable_asks_how_far_the_sphere_is_from_where_each_effect_rests() {
    let away = rotation::exp(Vec3::Y * 0.8);
    for (anchor, deadband, accepted) in [
        (Anchor::Absolute, 0.0, false),
        (Anchor::Absolute, 0.4, true),
        (Anchor::Here, 0.0, false),
        (Anchor::Here, 0.4, true),
    ] {
        let Kind::Spring(law) = spring(2.0, 0.0, away, anchor) else { panic!("a spring") };
        let kind = Kind::Spring(law.with_deadband(deadband));
        let mut bench = Bench::new(rig());
        bench.scene = CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
        bench.step();
        let reply = bench.command(Command::Enable).reply();
        assert_eq!(reply == Reply::Done, accepted, "{kind:?}: {reply:?}");
    }
}

#[test]
fn a_reference_anchored_here_begins_without_torque_however_far_the_sphere_was_turned() {
    let turned = rotation::exp(Vec3::Z * 0.3);
    for (reference, wound) in [(Quat::IDENTITY, Vec3::ZERO), (turned, Vec3::Z * 0.3)] {
        let mut bench = Bench::new(rig());
        bench.scene =
            CompiledScene::new(1, &[effect(0, 1, spring(2.0, 0.0, reference, Anchor::Here))]).unwrap();
        bench.step();
        // The sphere is far from where the scene was loaded.
        for _ in 0..700 {
            bench.turn(Vec3::new(2.0, 1.0, -1.0));
        }
        bench.sphere.omega = Vec3::ZERO;
        assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
        let torque = bench.run(600).state.torque;
        assert!((torque - wound * 2.0).length() < 1e-12, "{torque}");
    }
}

#[test]
fn a_reference_that_is_anchored_anew_takes_the_torque_over_without_a_step() {
    let rig = altered(&rig(), |rig| rig.limits.torque_rate = 1e6);
    let spring = spring(2.0, 0.0, Quat::IDENTITY, Anchor::Here);
    let mut bench = Bench::active(rig, CompiledScene::new(1, &[effect(0, 1, spring)]).unwrap());
    for _ in 0..100 {
        bench.turn(Vec3::Y * 2.5);
    }
    bench.sphere.omega = Vec3::ZERO;
    let wound = bench.run(3).state.torque.length();
    bench.command(Command::Disable);
    let mut last = bench.run(20).state.torque;
    assert!(last.length() > 0.5 * wound);
    // Enabled again within its ramp, the spring starts without torque at the present orientation of
    // the sphere.
    bench.command(Command::Enable);
    for k in 0..60 {
        let torque = bench.step().state.torque;
        // The steepest slope of the blend, and that of the gain from its present value.
        assert!((torque - last).length() < wound * (STEEPEST + 1.0 / 500.0), "tick {k}: {last} to {torque}");
        last = torque;
    }
    assert!(last.length() < ROUNDING, "{last}");
}

#[test]
fn a_scene_that_is_set_again_every_tick_acts_as_if_it_were_not() {
    // The sphere turns while a client sets equal parameters again and again.
    let torque = |every: Option<u64>| {
        let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
        for k in 1..=300 {
            if every.is_some_and(|every| k % every == 0) {
                bench.scene = spring_scene(1 + k, 2.0, WOUND);
            }
            // The sphere stays within what `enable` accepts. Beyond it each load would begin the
            // soft start again.
            bench.turn(Vec3::Y * 1.4);
        }
        bench.step().state.torque
    };
    let untouched = torque(None);
    assert!(untouched.length() > 0.5, "{untouched}");
    for every in [1, 2, 10] {
        assert!(
            (torque(Some(every)) - untouched).length() < ROUNDING,
            "every {every} ticks: {}",
            torque(Some(every))
        );
    }
}

#[test]
fn a_change_takes_effect_though_the_scene_is_set_every_tick() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
    bench.step();
    for k in 0..100 {
        bench.scene = CompiledScene::new(2 + k, &[]).unwrap();
        bench.step();
    }
    // The spring's torque is gone: each change fades, and the first was a hundred ticks ago.
    assert!(bench.step().state.torque.length() < 1e-6, "{}", bench.step().state.torque);
}

/// Largest change of a blend in one tick of 1 ms, relative to the step: it is linear in 50 ms.
pub const STEEPEST: f64 = 1.0 / 50.0;

#[test]
fn one_scene_becomes_another_within_50_ms_without_a_step() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
    let mut last = bench.step().state.torque;
    let scenes = [
        (spring_scene(2, 4.0, Vec3::new(-0.2, 0.0, 0.1)), Vec3::new(-0.8, 0.0, 0.4)),
        (CompiledScene::new(3, &[]).unwrap(), Vec3::ZERO),
        (spring_scene(4, 2.0, Vec3::Y * 0.3), Vec3::Y * 0.6),
    ];
    for (scene, after) in scenes {
        bench.scene = scene;
        let step = (after - last).length();
        for k in 1..=60 {
            let torque = bench.step().state.torque;
            assert!((torque - last).length() <= STEEPEST * step + ROUNDING, "tick {k}: {last} to {torque}");
            assert!((torque - last).length() <= TORQUE_RATE * DT + ROUNDING);
            last = torque;
            if k > 50 {
                assert!((torque - after).length() < ROUNDING, "after {k} ms: {torque}");
            }
        }
    }
}

#[test]
fn torque_never_changes_faster_than_the_rig_allows() {
    let rig = altered(&rig(), |rig| rig.limits.torque_rate = 5.0);
    let mut bench = Bench::active(rig, CompiledScene::empty());
    let mut rng = Rng(11);
    let mut last = Vec3::ZERO;
    let mut fastest = 0.0_f64;
    for _ in 0..5000 {
        let torque = if rng.once_in(20) {
            bench.command(stream(rng.vector(1.0), 1 + rng.below(60) as u32)).state.torque
        } else {
            bench.step().state.torque
        };
        fastest = fastest.max((torque - last).length());
        last = torque;
    }
    assert!((fastest - 5.0 * DT).abs() < ROUNDING, "{fastest} N m a tick: at the limit, and not above it");
}
