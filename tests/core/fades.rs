//! Changes of scene, whatever is asked for: each follows its fade, and none changes the torque
//! faster than the rig's limit in 50 ms.

use crate::prelude::*;
use crate::shaping::ROUNDING;
use hbot_core::render::effects::Pendulum;

/// Torque limit of the prototype, N m.
const LIMIT: f64 = 0.9;
/// Largest change of the torque in one tick by changes of scene, N m.
const STEP: f64 = LIMIT / 50.0;

/// Returns a rig whose torque only the limit bounds, so that neither slew nor motors hide a step.
fn strong() -> Rig {
    altered(&rig(), |rig| {
        (rig.limits.torque, rig.limits.torque_rate) = (LIMIT, 1e6);
        rig.joints.iter_mut().for_each(|joint| joint.peak *= 10.0);
    })
}

/// Returns an effect with a constant torque about n2, N m, with the fade-in of a scene file.
fn constant(slot: u8, epoch: u32, torque: f64) -> Effect {
    let kind = Kind::Constant(Constant { torque: Vec3::Y * torque, frame: Frame::World });
    Effect { fade_s: 0.05, ..effect(slot, epoch, kind) }
}

fn scene(revision: u64, effects: &[Effect]) -> CompiledScene {
    CompiledScene::new(revision, effects).unwrap()
}

/// How a torque goes from one value to another.
#[derive(Debug)]
struct Way {
    /// Ticks until half of the way, and until 90 % of it.
    half: usize,
    ninety: usize,
    /// Largest change in a tick, N m.
    step: f64,
    from: Vec3,
    to: Vec3,
}

/// Returns the way of the torque after a change from the effects `before` to `after`.
fn change(before: &[Effect], after: &[Effect]) -> Way {
    let mut bench = Bench::active(strong(), scene(1, before));
    let from = bench.run(10).state.torque;
    bench.scene = scene(2, after);
    way(&mut bench, from)
}

fn way(bench: &mut Bench, from: Vec3) -> Way {
    let torques: Vec<Vec3> = (0..1500).map(|_| bench.step().state.torque).collect();
    assert_eq!(bench.step().state.mode, Mode::Active);
    let to = torques[1499];
    let progress = |part: f64| {
        torques.iter().position(|t| (*t - from).length() >= part * (to - from).length() - ROUNDING).unwrap()
    };
    let all = core::iter::once(&from).chain(&torques);
    let step = all.zip(&torques).map(|(a, b)| (*b - *a).length()).fold(0.0, f64::max);
    Way { half: progress(0.5), ninety: progress(0.9), step, from, to }
}

/// Checks a linear change between the torques `from` and `to` about n2 (N m) in `ticks`.
fn assert_way(name: &str, way: &Way, (from, to): (f64, f64), ticks: f64) {
    assert!((way.from - Vec3::Y * from).length() < ROUNDING, "{name}: {way:?}");
    assert!((way.to - Vec3::Y * to).length() < ROUNDING, "{name}: {way:?}");
    // A clock of ticks can be a rounding short of its end.
    let is = |at: usize, part: f64| (0.0..=1.0).contains(&(at as f64 - part * ticks));
    assert!(is(way.half, 0.5) && is(way.ninety, 0.9), "{name}: {way:?}");
    assert!(way.step <= STEP + ROUNDING, "{name}: {way:?}");
}

#[test]
fn a_scene_that_asks_for_any_torque_comes_in_the_time_of_its_fade() {
    for size in [0.8, 9.0, 100.0, 1e300] {
        let full = f64::min(size, LIMIT);
        for (fade_s, ticks) in [(0.05, 50.0), (1.0, 1000.0), (0.0, 50.0)] {
            let way = change(&[], &[Effect { fade_s, ..constant(0, 9, size) }]);
            assert_way(&format!("{size} N m in {fade_s} s"), &way, (0.0, full), ticks);
        }
        // Its gain is a part of what an effect asks for.
        let way = change(&[], &[Effect { gain: 10.0, fade_s: 1.0, ..constant(0, 9, size) }]);
        assert_way("gain", &way, (0.0, LIMIT), 1000.0);
    }
    let pendulum = Pendulum { centre: Vec3::Z * 10.0, weight: Vec3::X * 10_000.0 };
    let way = change(&[], &[Effect { fade_s: 0.05, ..effect(0, 9, Kind::Pendulum(pendulum)) }]);
    assert_way("pendulum", &way, (0.0, LIMIT), 50.0);
}

#[test]
fn a_scene_that_asked_for_any_torque_goes_in_the_time_of_its_fade() {
    for size in [0.8, 9.0, 1e300] {
        let full = f64::min(size, LIMIT);
        let way = change(&[constant(0, 9, size)], &[]);
        assert_way("without fade_out_s", &way, (full, 0.0), 50.0);
        let before = Effect { fade_out_s: 0.3, ..constant(0, 9, size) };
        let way = change(&[before], &[Effect { leaving: true, ..before }]);
        assert_way("fade_out_s", &way, (full, 0.0), 300.0);
    }
}

#[test]
fn from_one_effect_to_another_torque_goes_straight_and_no_faster_than_the_limit_in_50_ms() {
    // The whole way is 1.8 N m, so it takes 100 ms.
    let way = change(&[constant(0, 9, 100.0)], &[constant(1, 10, -100.0)]);
    assert_way("another effect", &way, (LIMIT, -LIMIT), 100.0);
    // Both fade out and in within 0.3 s, which is slow enough.
    let slow = |e: Effect| Effect { fade_s: 0.3, fade_out_s: 0.3, ..e };
    let before = slow(constant(0, 9, 100.0));
    let after = [Effect { leaving: true, ..before }, slow(constant(1, 10, -100.0))];
    assert_way("crossing", &change(&[before], &after), (LIMIT, -LIMIT), 300.0);
    // One goes and the other comes in the same time: the torque stays.
    let after = [Effect { leaving: true, ..before }, slow(constant(1, 10, 100.0))];
    let mut bench = Bench::active(strong(), scene(1, &[before]));
    bench.scene = scene(2, &after);
    for _ in 0..400 {
        assert!((bench.step().state.torque - Vec3::Y * LIMIT).length() < ROUNDING);
    }
}

#[test]
fn a_set_of_any_size_is_blended_over_50_ms_or_twice_that_to_the_opposite() {
    let set = |from: f64, to: f64| change(&[constant(0, 9, from)], &[constant(0, 9, to)]);
    assert_way("up", &set(0.0, 100.0), (0.0, LIMIT), 50.0);
    assert_way("a little", &set(0.2, 0.3), (0.2, 0.3), 50.0);
    assert_way("over", &set(100.0, -100.0), (LIMIT, -LIMIT), 100.0);
    assert_way("from a half", &set(0.45, -100.0), (0.45, -LIMIT), 75.0);
    let gain = |gain| Effect { gain, ..constant(0, 9, 100.0) };
    assert_way("gain", &change(&[gain(0.0)], &[gain(10.0)]), (0.0, LIMIT), 50.0);
}

#[test]
fn several_effects_beyond_the_limit_fade_as_one() {
    let all = |torques: &[f64]| -> Vec<Effect> {
        torques.iter().enumerate().map(|(k, t)| constant(k as u8, 9 + k as u32, *t)).collect()
    };
    for (torques, sum) in [
        (vec![100.0, 100.0], LIMIT),
        (vec![9.0; 20], LIMIT),
        (vec![100.0, -100.0], 0.0),
        (vec![100.0, -99.5], 0.5),
        (vec![-100.0, 30.0, 80.0], LIMIT),
    ] {
        let way = change(&[], &all(&torques));
        let name = format!("{torques:?}");
        if sum == 0.0 {
            assert!(way.step < ROUNDING, "{name}: {way:?}");
        } else {
            assert_way(&name, &way, (0.0, sum), 50.0);
        }
    }
    // A wall that asks for more than the limit is not overcome by a weaker effect that comes, nor
    // weakened by one that has come.
    let wall = constant(0, 9, 5.0);
    let mut bench = Bench::active(strong(), scene(1, &[wall]));
    bench.scene = scene(2, &[wall, constant(1, 10, -3.0)]);
    for _ in 0..200 {
        assert!((bench.step().state.torque.y - LIMIT).abs() < ROUNDING);
    }
}

#[test]
fn fades_and_streams_share_the_limit() {
    let mut bench = Bench::active(strong(), CompiledScene::empty());
    bench.command(stream(Vec3::Y * 0.5, 10_000));
    bench.run(5);
    bench.scene = scene(2, &[constant(0, 9, -100.0)]);
    assert_way("under a stream", &way(&mut bench, Vec3::Y * 0.5), (0.5, -LIMIT), 1.4 / STEP);
}

#[test]
fn whatever_changes_when_the_torque_keeps_its_step() {
    let mut largest = 0.0_f64;
    for seed in 0..40 {
        let mut rng = Rng(seed);
        let mut bench = Bench::active(strong(), CompiledScene::empty());
        let (mut effects, mut last): (Vec<Effect>, Vec3) = (Vec::new(), Vec3::ZERO);
        let mut epoch = 0;
        for tick in 0..3000 {
            if rng.once_in(30) {
                effects.retain(|effect| !effect.leaving || !rng.once_in(3));
                for e in &mut effects {
                    e.leaving |= e.fade_out_s > 0.0 && rng.once_in(3);
                    if rng.once_in(4) {
                        e.gain = rng.between(0.0, 10.0);
                    }
                }
                effects.retain(|effect| effect.leaving || !rng.once_in(4));
                let free = (0..6).find(|slot| effects.iter().all(|effect| effect.slot != *slot));
                if let Some(slot) = free {
                    epoch += 1;
                    let size = 10.0_f64.powf(rng.between(-1.0, 2.0));
                    let torque = rng.vector(size);
                    let kind = Kind::Constant(Constant { torque, frame: Frame::World });
                    let fade_s = [0.0, 1e-4, 0.004, 0.05, 0.4][rng.below(5) as usize];
                    let fade_out_s = [0.0, 1e-4, 0.004, 0.05, 0.4][rng.below(5) as usize];
                    effects.push(Effect { fade_s, fade_out_s, ..effect(slot, epoch, kind) });
                }
                bench.scene = scene(2 + tick, &effects);
            }
            let state = bench.step().state;
            let step = (state.torque - last).length();
            assert!(step <= STEP * (1.0 + 1e-6), "seed {seed}, tick {tick}: {step} N m");
            largest = largest.max(step);
            last = state.torque;
        }
        // The fades go on: at the end the torque is what the scene asks for.
        let sum: Vec3 = effects.iter().filter(|e| !e.leaving).fold(Vec3::ZERO, |sum, e| {
            let Kind::Constant(constant) = e.kind else { unreachable!() };
            sum + constant.torque * e.gain
        });
        let want = if sum.length() > LIMIT { sum * (LIMIT / sum.length()) } else { sum };
        let torque = bench.run(700).state.torque;
        assert!((torque - want).length() < 1e-9, "seed {seed}: {torque}, not {want}");
    }
    assert!(largest > 0.999 * STEP, "{largest}");
}

#[test]
fn a_disable_ends_within_50_ms_though_a_blend_takes_longer() {
    let mut bench = Bench::active(strong(), scene(1, &[constant(0, 9, 100.0)]));
    bench.scene = scene(2, &[constant(0, 9, -100.0)]);
    bench.run(5);
    bench.command(Command::Disable);
    assert_eq!(bench.run(50).state.torque, Vec3::ZERO, "{DT} s a tick");
}
