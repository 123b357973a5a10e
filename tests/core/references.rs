//! References that move, and corrections of the orientation from outside.

use crate::prelude::*;
use hbot_core::render::effects::Guide;

/// Returns a scene with a spring in slot 3, epoch 9, at rest at the sphere's initial orientation.
fn scene(stiffness: f64, damping: f64) -> CompiledScene {
    CompiledScene::new(1, &[effect(3, 9, spring(stiffness, damping, Quat::IDENTITY, Anchor::Absolute))])
        .unwrap()
}

fn reference(q: Quat, omega: Vec3, valid_ticks: u32) -> Command {
    crate::bench::reference(3, 9, q, omega, valid_ticks)
}

fn align(q: Quat, weight: f64, tick: u64) -> Command {
    Command::Align { q, weight, tick }
}

#[test]
fn a_reference_moves_at_most_at_its_rate_and_arrives() {
    let mut bench = Bench::active(rig(), scene(1.0, 0.0));
    let goal = Vec3::new(0.6, -0.8, 0.0);
    // The sphere is held, so the torque shows the reference. It moves at 5 rad/s: 5 mrad per tick
    // for 200 ticks.
    let mut last = bench.command(reference(rotation::exp(goal), Vec3::ZERO, 1)).state.torque;
    assert!((last - goal * 0.005).length() < 1e-12, "{last}");
    for k in 2..=205 {
        let torque = bench.step().state.torque;
        assert!((torque - last).length() < 5.0 * DT + 1e-12, "tick {k}");
        let want = goal * (f64::from(k) / 200.0).min(1.0);
        assert!((torque - want).length() < 1e-12, "tick {k}: {torque} against {want}");
        last = torque;
    }
}

#[test]
fn the_state_says_where_the_reference_is() {
    let mut bench = Bench::active(rig(), scene(1.0, 0.0));
    let goal = Vec3::new(0.6, -0.8, 0.0);
    bench.command(reference(rotation::exp(goal), Vec3::ZERO, 1));
    for k in 2..=205 {
        let state = bench.step().state;
        // The sphere is held at the identity. The torque is 1 N m/rad times the turn to the
        // reference of this tick.
        let way = rotation::log(state.reference.expect("the spring has one"));
        assert!((state.torque - way).length() < 1e-12, "tick {k}: {way} for {}", state.torque);
    }
    // A reference anchored at the sphere is reported too, and no reference after its effect is
    // removed.
    let here = CompiledScene::new(2, &[effect(3, 10, spring(1.0, 0.0, rotation::exp(goal), Anchor::Here))]);
    bench.scene = here.unwrap();
    let state = bench.step().state;
    assert_eq!(state.reference, Some(rotation::exp(goal) * state.q));
    bench.scene = CompiledScene::new(3, &[]).unwrap();
    assert_eq!(bench.step().state.reference, None);
}

#[test]
fn the_reference_of_the_state_is_that_of_the_first_effect_that_has_one_and_stays() {
    let turned = |slot: u8, angle: f64| {
        let kind = spring(0.1, 0.0, rotation::exp(Vec3::X * angle), Anchor::Absolute);
        Effect { fade_out_s: 0.05, ..effect(slot, 1 + u32::from(slot), kind) }
    };
    let torque = effect(0, 1, Kind::Constant(Constant { torque: Vec3::X * 0.01, frame: Frame::World }));
    let leaving = |effect: Effect| Effect { leaving: true, ..effect };
    let (first, second) = (turned(1, 0.1), turned(2, 0.2));
    let mut bench = Bench::active(rig(), CompiledScene::new(1, &[torque, first, second]).unwrap());
    let place = |reference: Option<Quat>| reference.map(|q| rotation::log(q).x);
    let near = |is: Option<f64>, want: f64| is.is_some_and(|is| (is - want).abs() < 1e-12);
    assert!(near(place(bench.step().state.reference), 0.1), "a constant torque has no reference");
    bench.scene = CompiledScene::new(2, &[torque, leaving(first), second]).unwrap();
    assert!(near(place(bench.step().state.reference), 0.2), "from the tick in which the first one leaves");
    bench.scene = CompiledScene::new(3, &[torque, leaving(first), leaving(second)]).unwrap();
    let state = bench.step().state;
    assert_eq!(state.reference, None, "they still fade out");
    assert!(state.torque.x > 0.012, "{}", state.torque);
}

#[test]
fn a_references_rate_expires_and_its_place_stays() {
    let mut bench = Bench::active(rig(), scene(1.0, 0.1));
    let (turn, omega) = (Vec3::X * 0.004, Vec3::Y);
    let first = bench.command(reference(rotation::exp(turn), omega, 10)).state.torque;
    assert!((first - turn - omega * 0.1).length() < 1e-12, "{first}");
    for k in 1..30 {
        let torque = bench.step().state.torque;
        let want = turn + if k < 10 { omega * 0.1 } else { Vec3::ZERO };
        assert!((torque - want).length() < 1e-12, "tick {k}: {torque}");
    }
}

/// Dampers act on the motion relative to the reference. So a reference that turns takes a sphere at
/// rest along, in the directions that the effect holds.
#[test]
fn a_reference_that_turns_takes_along_what_an_effect_holds() {
    const DAMPING: f64 = 0.1;
    let (axis, pointer, omega) = (Vec3::new(0.6, 0.0, 0.8), Vec3::Y, Vec3::new(0.5, -1.0, 0.75));
    let target = Target::N;
    let guide =
        |free| Kind::Guide(Guide { target, axis, free, stiffness: 2.0, damping: DAMPING, deadband: 0.0 });
    let (strength, width) = (0.1, 0.2);
    let dial = Detents { target, axis, strength, width, count: 12, end_stiffness: 0.0, damping: DAMPING };
    let set = SnapSet::Cube;
    let rounding = Snaps::rounding(set, &[]);
    let snaps = Snaps { target, set, strength, width, rounding, damping: DAMPING };
    let path = TrackPath::Swing { axis, amplitude: 0.0, from: 1.0, to: 1.0, sweep: 0.0, repeat: false };
    let track = Track { target, path, stiffness: 2.0, damping: DAMPING, deadband: 0.0 };
    let about = |unit: Vec3| unit * unit.dot(omega);
    for (kind, held) in [
        (guide(Freedom::Axis), omega - about(axis)),
        (guide(Freedom::Swing), about(axis)),
        // Only a turn about this axis moves the pointer out of the plane.
        (guide(Freedom::Plane(pointer)), about(pointer.cross(axis))),
        (Kind::Detents(dial), about(axis)),
        (Kind::Snaps(snaps), omega),
        (Kind::Track(track), omega),
    ] {
        let mut bench = Bench::active(rig(), CompiledScene::new(1, &[effect(3, 9, kind)]).unwrap());
        let torque = bench.command(reference(Quat::IDENTITY, omega, 10)).state.torque;
        assert!((torque - held * DAMPING).length() < 1e-12, "{kind:?}: {torque}");
    }
}

#[test]
fn a_reference_to_an_effect_that_is_not_there_is_refused() {
    let mut bench = Bench::active(rig(), scene(1.0, 0.0));
    for (slot, epoch) in [(3, 8), (3, 10), (4, 9), (31, 9), (255, 9)] {
        let outputs = bench.command(crate::bench::reference(slot, epoch, Quat::IDENTITY, Vec3::ZERO, 1));
        assert_eq!(outputs.reply(), Reply::Refused(Refusal::NoReference), "slot {slot}, epoch {epoch}");
        assert_eq!(outputs.state.client, None);
    }
}

/// A quaternion with four digits stands for the nearest rotation. Its missing length must not make
/// the spring stiffer.
#[test]
fn a_reference_of_four_digits_is_taken_as_the_rotation_that_it_means() {
    let q = rotation::exp(Vec3::new(0.3, 0.2, -0.1));
    let [exact, rough] = [q, q * 1.0004].map(|q| {
        let mut bench = Bench::active(rig(), scene(2.0, 0.1));
        bench.command(reference(q, Vec3::Z, 1000));
        bench.run(150).state.torque
    });
    // Equal to rounding: the scale of the quaternion has no meaning.
    assert!((exact - rough).length() < 1e-14, "{exact} and {rough}");
}

#[test]
fn an_outside_orientation_corrects_at_its_rate_while_powered() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let offset = Vec3::new(0.0, 0.03, 0.04);
    let seen = bench.tick - 1;
    let reply = bench.command(align(rotation::exp(offset), 1.0, seen)).reply();
    let Reply::Aligned { angle } = reply else { panic!("{reply:?}") };
    assert!((angle - 0.05).abs() < 1e-12, "{angle}");
    // At 0.5 rad/s, 0.05 rad take 100 ms.
    for k in 1..=110 {
        let q = bench.step().state.q;
        let want = offset * (f64::from(k) * 0.5 * DT / 0.05).min(1.0);
        assert!((rotation::log(q) - want).length() < 1e-12, "tick {k}");
    }
}

#[test]
fn an_outside_orientation_corrects_at_once_while_idle_and_by_its_weight() {
    let offset = Vec3::new(0.0, 0.6, 0.8);
    for weight in [1.0, 0.5, 0.1] {
        let mut bench = Bench::new(rig());
        bench.run(5);
        bench.command(align(rotation::exp(offset), weight, 3));
        let q = bench.step().state.q;
        assert!((rotation::log(q) - offset * weight).length() < 1e-12, "weight {weight}: {q}");
    }
}

#[test]
fn an_outside_orientation_of_weight_zero_is_measured_and_changes_nothing() {
    let mut bench = Bench::new(rig());
    bench.run(5);
    let reply = bench.command(align(rotation::exp(Vec3::X * 0.7), 0.0, 5)).reply();
    assert!(matches!(reply, Reply::Aligned { angle } if (angle - 0.7).abs() < 1e-12), "{reply:?}");
    assert_eq!(bench.run(3).state.q, Quat::IDENTITY);
}

#[test]
fn an_outside_orientation_of_weight_zero_does_not_end_a_correction() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let q = rotation::exp(Vec3::X * 0.2);
    bench.command(align(q, 1.0, bench.tick - 1));
    // At 0.5 rad/s the correction takes 400 ticks.
    bench.run(100);
    bench.command(align(q, 0.0, bench.tick - 1));
    let off = rotation::angle_between(bench.run(400).state.q, q);
    assert!(off < 1e-12, "{off} rad");
}

/// Returns a scene with a weak spring in slot 3: 0.02 N m/rad towards `reference`.
fn weak(revision: u64, reference_revision: u32, reference: Quat) -> CompiledScene {
    let spring = spring(0.02, 0.0, reference, Anchor::Absolute);
    let effect = Effect { reference_revision, ..effect(3, 1, spring) };
    CompiledScene::new(revision, &[effect]).unwrap()
}

#[test]
fn a_weak_effect_that_rests_far_away_comes_softly_too() {
    // The torque of 0.063 N m is a step of less than a tenth of the limit.
    let rig = altered(&rig(), |rig| rig.limits.reference_rate = 1000.0);
    let half_a_turn = Quat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    let full = 0.02 * core::f64::consts::PI;
    for (name, before) in [("load", CompiledScene::empty()), ("set", weak(1, 0, Quat::IDENTITY))] {
        let mut bench = Bench::active(rig, before);
        bench.scene = weak(2, 1, half_a_turn);
        let torque: Vec<f64> = (0..600).map(|_| bench.step().state.torque.length()).collect();
        for at in [100, 250, 400] {
            let most = full * (at + 1) as f64 / 500.0 + 1e-9;
            assert!(torque[at] <= most, "{name}: {} N m after {at} ms", torque[at]);
        }
        assert!((torque[599] - full).abs() < 1e-6, "{name}: {}", torque[599]);
    }
}

#[test]
fn an_outside_orientation_is_held_against_the_moment_that_it_shows() {
    let mut bench = Bench::new(rig());
    let mut truth = Vec::new();
    let offset = rotation::exp(Vec3::new(0.1, -0.2, 0.05));
    for k in 0..400 {
        let omega = Vec3::new(1.0, 2.0 * (0.02 * f64::from(k)).sin(), -0.5);
        let q = bench.turn(omega).state.q;
        truth.push((bench.tick - 1, q * offset));
    }
    let q = bench.step().state.q;
    truth.push((bench.tick - 1, q * offset));
    // 300 ms later: the measurement is of the past, and the present orientation is corrected.
    let (tick, q) = truth[100];
    bench.command(align(q, 1.0, tick));
    let now = bench.step().state.q;
    let (_, last) = truth[400];
    assert!(rotation::angle_between(now, last) < 1e-12);
    // A second measurement of the past is compared with the past as already corrected.
    let (tick, q) = truth[200];
    let reply = bench.command(align(q, 1.0, tick)).reply();
    assert!(matches!(reply, Reply::Aligned { angle } if angle < 1e-12), "{reply:?}");
}

/// The wheels are fixed in frame N, so a turn that they measure is about the same axis of N
/// whatever the orientation was before. A correction that turned these axes would let a spring push
/// sideways.
#[test]
fn turns_after_a_correction_keep_their_axes() {
    let mut bench = Bench::new(rig());
    bench.run(5);
    let quarter = rotation::exp(Vec3::new(0.0, 1.5, 0.5));
    bench.command(align(quarter, 1.0, bench.tick - 1));
    let before = bench.step().state.q;
    assert!(rotation::angle_between(before, quarter) < 1e-12);
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        let before = bench.step().state.q;
        for _ in 0..100 {
            bench.turn(axis);
        }
        let turned = rotation::difference(bench.step().state.q, before);
        // The counts of the bench's encoders round to about 1e-4 rad.
        assert!(turned.normalize().dot(axis) > 0.99999, "about {axis}: {turned}");
    }
}

#[test]
fn moments_that_are_too_old_or_not_yet_there_are_refused() {
    let mut bench = Bench::new(rig());
    bench.run(2000);
    let now = bench.tick;
    let reply = |bench: &mut Bench, seen: u64| bench.command(align(Quat::IDENTITY, 1.0, seen)).reply();
    for old in [0, now - 1025, now + 10, now + 1024, u64::MAX, u64::MAX - 1023] {
        assert_eq!(reply(&mut bench, old), Reply::Refused(Refusal::NotInHistory), "tick {old}, now {now}");
    }
    assert!(matches!(reply(&mut bench, now - 900), Reply::Aligned { .. }));
    // Before the history is full, moments that it lacks are refused as well.
    let mut young = Bench::new(rig());
    young.run(3);
    for seen in [0, 100, 1023, 1024, u64::MAX, u64::MAX - 1] {
        assert_eq!(reply(&mut young, seen), Reply::Refused(Refusal::NotInHistory), "tick {seen}");
    }
}

#[test]
fn the_sign_of_the_orientation_is_continuous_turn_after_turn_and_through_corrections() {
    let mut bench = Bench::new(rig());
    let mut last = bench.step().state.q;
    let mut least = 1.0_f64;
    for k in 0..4000 {
        let mut state = bench.turn(Vec3::Y * 4.0).state;
        if k == 700 {
            // A measurement from outside with the other sign and a small error.
            let seen = -(rotation::exp(Vec3::X * 0.02) * state.q);
            state = bench.command(align(seen, 1.0, state.tick)).state;
        }
        assert!(state.q.dot(last) > 0.99, "tick {k}: {last} to {}", state.q);
        last = state.q;
        least = least.min(last.w);
    }
    assert!(least < -0.9, "it did go the long way round");
}

#[test]
fn a_correction_moves_the_spring_no_faster_than_its_rate() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, Vec3::ZERO));
    bench.command(align(rotation::exp(Vec3::Y * 0.2), 1.0, bench.tick - 1));
    let mut last = bench.step().state.torque;
    for _ in 0..450 {
        let torque = bench.step().state.torque;
        assert!((torque - last).length() < 2.0 * 0.5 * DT + 1e-12, "a torque jumps");
        last = torque;
    }
    assert!((last + Vec3::Y * 0.4).length() < 1e-12, "{last}");
}

#[test]
fn a_step_of_a_tenth_of_the_limit_comes_softly_if_an_effect_rests_far_away() {
    let rig = altered(&rig(), |rig| rig.limits.torque = 0.9);
    let held = |revision: u64, stiffness: f64| {
        let spring = spring(stiffness, 0.0, Quat::IDENTITY, Anchor::Absolute);
        CompiledScene::new(revision, &[effect(0, 1, spring)]).unwrap()
    };
    for (step, soft) in [(0.088, false), (0.092, true)] {
        let mut bench = Bench::active(rig, held(1, 0.2));
        for _ in 0..600 {
            bench.turn(Vec3::Y * 2.0);
        }
        bench.sphere.omega = Vec3::ZERO;
        let before = bench.run(5).state.torque.length();
        bench.scene = held(2, 0.2 * (before + step) / before);
        let after = bench.run(60).state.torque.length();
        assert_eq!(after < before, soft, "{step} N m: {after} N m after {before} N m");
    }
}
