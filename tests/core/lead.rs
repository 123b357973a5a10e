//! The lead: the scene is rendered at the pose that the sphere will have when the torque acts.

use crate::prelude::*;

const FACTOR: f64 = 1.25;
const LAG: f64 = 0.5e-3;

fn led_within(longest: f64) -> Rig {
    altered(&rig(), |rig| {
        rig.torque_lag = LAG;
        rig.lead = Some(LeadTime { factor: FACTOR, longest });
        rig.limits.slip = 10.0;
        rig.limits.torque_rate = 1.0e5;
        rig.limits.reference_rate = 1000.0;
        rig.limits.speed = 50.0;
    })
}

fn led() -> Rig {
    led_within(0.05)
}

/// Returns a scene with a spring of 1 N m/rad without damping in slot 3, epoch 9. So its torque is
/// the turn from the sphere to the reference.
fn unit() -> CompiledScene {
    CompiledScene::new(1, &[effect(3, 9, spring(1.0, 0.0, Quat::IDENTITY, Anchor::Absolute))]).unwrap()
}

/// Returns by how much the pose of the torque was turned on, rad in N.
fn ahead(state: &State) -> Vec3 {
    rotation::log(rotation::exp(-state.torque) * state.q.conjugate())
}

fn reference(q: Quat, omega: Vec3, valid_ticks: u32) -> Command {
    crate::bench::reference(3, 9, q, omega, valid_ticks)
}

/// Returns a dial about n3 with `count` notches.
fn dial(strength: f64, count: u16) -> Kind {
    let (target, axis) = (Target::N, Vec3::Z);
    Kind::Detents(Detents { target, axis, strength, width: 0.5, count, end_stiffness: 0.0, damping: 0.0 })
}

/// Joint torques are rounded, and counts are: a count of the drive turns the sphere by 3.4e-6 rad.
const ROUNDING: f64 = 1.0e-9;

#[test]
fn the_scene_is_rendered_at_the_pose_at_the_middle_of_the_torque() {
    let mut bench = Bench::active(led(), unit());
    let omega = Vec3::new(0.4, -0.3, 0.2);
    for _ in 0..20 {
        let state = bench.turn(omega).state;
        // A reading is one tick old, the torque is held for one, and it lags.
        let time = FACTOR * (1.5 * DT + LAG);
        assert!((state.lead_us - 1e6 * time).abs() < 1e-6, "{}", state.lead_us);
        assert!((ahead(&state) - state.omega * time).length() < ROUNDING, "{}", ahead(&state));
    }
    // Without the key nothing is ahead.
    let mut bench = Bench::active(altered(&led(), |rig| rig.lead = None), unit());
    for _ in 0..20 {
        let state = bench.turn(omega).state;
        assert!(state.lead_us == 0.0 && ahead(&state).length() < ROUNDING);
    }
}

#[test]
fn a_reading_that_is_late_or_missing_is_bridged_within_the_longest_time() {
    let omega = Vec3::new(0.4, -0.3, 0.2);
    for (longest, most) in [(0.05, 0.05), (4.0e-3, 4.0e-3)] {
        let mut bench = Bench::active(led_within(longest), unit());
        for _ in 0..5 {
            bench.turn(omega);
        }
        for missed in 1..=5_u32 {
            let state = bench.deaf().state;
            let time = (FACTOR * (f64::from(1 + missed) * DT + 0.5 * DT + LAG)).min(most);
            assert!((state.lead_us - 1e6 * time).abs() < 1e-6, "{missed} missed: {}", state.lead_us);
            assert!((ahead(&state) - state.omega * time).length() < ROUNDING, "{missed} missed");
        }
    }
}

/// A sphere that turns with its reference is at rest relative to it, so a spring must not brake it.
#[test]
fn a_reference_that_turns_with_the_sphere_is_led_as_far_as_the_sphere() {
    for speed in [1.0, 20.0] {
        let omega = Vec3::new(0.6, 0.0, 0.8) * speed;
        let mut bench = Bench::active(
            altered(&led(), |rig| {
                rig.lead = Some(LeadTime { factor: 1.0, longest: 0.05 });
                rig.limits.reference_rate = 1000.0;
            }),
            unit(),
        );
        for k in 0..200 {
            let reading = bench.feedback();
            bench.sphere.turn(omega, DT);
            // The reference is where the sphere is now; the reading is one tick old.
            let now = reference(bench.sphere.q, omega, 10);
            let state = bench
                .step_with(|inputs| {
                    inputs.feedback = Some(reading);
                    inputs.commands.push(now).unwrap();
                })
                .state;
            // Rounding to counts, and the drift of the odometry.
            let off = state.torque.length();
            assert!(k < 2 || off < 2.0e-4 * speed.max(1.0), "tick {k} at {speed} rad/s: {off} rad");
        }
    }
}

#[test]
fn a_reference_that_jumps_is_led_to_its_goal_and_not_beyond() {
    let slow = altered(&led(), |rig| rig.limits.reference_rate = 5.0);
    let mut bench = Bench::active(slow, unit());
    let goal = Vec3::Y * 0.05;
    let mut torque = bench.command(reference(rotation::exp(goal), Vec3::ZERO, 1)).state.torque;
    // The time that is still to come when the tick begins.
    let still = FACTOR * (1.5 * DT + LAG) - DT;
    for k in 1..=20 {
        let want = (5.0 * (f64::from(k) * DT + still)).min(0.05);
        assert!((torque - Vec3::Y * want).length() < ROUNDING, "tick {k}: {torque} for {want}");
        torque = bench.step().state.torque;
    }
    assert!((torque - goal).length() < ROUNDING);
}

#[test]
fn a_track_is_led_by_its_own_rate() {
    let swing =
        TrackPath::Swing { axis: Vec3::X, amplitude: 0.1, from: 2.0, to: 2.0, sweep: 0.0, repeat: false };
    let track = Track { target: Target::N, path: swing, stiffness: 1.0, damping: 0.0, deadband: 0.0 };
    let scene = CompiledScene::new(1, &[effect(0, 1, Kind::Track(track))]).unwrap();
    let mut plain = Bench::active(altered(&led(), |rig| rig.lead = None), scene.clone());
    let mut ahead = Bench::active(led(), scene);
    // The sphere rests, so the torque is the reference's turn.
    let torques: Vec<f64> = (0..200).map(|_| plain.step().state.torque.x).collect();
    let led: Vec<f64> = (0..200).map(|_| ahead.step().state.torque.x).collect();
    let still = FACTOR * (1.5 * DT + LAG) - DT;
    for k in 1..199 {
        let rate = (torques[k + 1] - torques[k - 1]) / (2.0 * DT);
        // The rate changes by at most 0.1 (4 pi)² rad/s² times the time, and the difference has an
        // error of h² w³/6.
        assert!(
            (led[k] - torques[k] - rate * still).abs() < 5.0e-6,
            "tick {k}: {} and {}",
            led[k],
            torques[k]
        );
    }
}

#[test]
fn at_half_a_turn_from_the_reference_the_torque_stays_finite_and_in_one_direction() {
    let half = Vec3::Z * core::f64::consts::PI;
    let mut bench = Bench::active(led(), spring_scene(1, 0.1, Vec3::Z * 0.3));
    bench.command(crate::bench::reference(0, 1, rotation::exp(half), Vec3::ZERO, 1));
    let rest = bench.run(3).state.torque;
    assert!((rest.length() - 0.1 * core::f64::consts::PI).abs() < 1e-9, "{rest}");
    // The sphere turns through the half turn. The torque changes its direction once.
    let mut changes = 0;
    let mut last = bench.turn(Vec3::Z * -2.0).state.torque.z;
    for k in 0..60 {
        let omega = if k < 10 { -2.0 } else { 2.0 };
        let z = bench.turn(Vec3::Z * omega).state.torque.z;
        assert!(z.abs() > 0.29, "tick {k}: {z}");
        changes += u32::from(z * last < 0.0);
        last = z;
    }
    assert!(changes <= 2, "{changes}");
}

/// A law that is a wave of the number k gets a lead of at most a quarter of a wave. Beyond, a lead
/// would give energy out. The laws have up to 360 N m/rad, so 1e-6 N m are 3e-9 rad: a lead
/// that is wrong by a thousandth of a wave changes the torque by more.
#[test]
fn a_law_is_led_by_at_most_a_quarter_of_its_wave() {
    let axis = Vec3::Z;
    let wave = core::f64::consts::TAU / 720.0;
    let scene = CompiledScene::new(1, &[effect(0, 1, dial(0.5, 720))]).unwrap();
    let mut bench = Bench::active(led(), scene);
    bench.turn(axis * 20.0);
    for k in 0..40 {
        let state = bench.turn(axis * 20.0).state;
        let psi = rotation::log(state.q).z;
        let want = -0.5 * (core::f64::consts::TAU * (psi + 0.25 * wave) / wave).sin();
        assert!((state.torque.z - want).abs() < 1e-6, "tick {k}: {} for {want}", state.torque.z);
    }
    // A texture at the same speed. Its point under the normal moves by the same angle.
    let texture = Texture { at: Vec3::X, wave_number: 500.0, depth: 0.5 };
    let scene = CompiledScene::new(1, &[effect(0, 1, Kind::Texture(texture))]).unwrap();
    let mut bench = Bench::active(led(), scene);
    bench.turn(axis * 20.0);
    for k in 0..40 {
        let state = bench.turn(axis * 20.0).state;
        let pose = rotation::exp(state.omega.normalize() * (0.25 * core::f64::consts::TAU / 500.0)) * state.q;
        let s = pose.conjugate() * Vec3::X;
        let f = Vec3::new((500.0 * s.x).sin(), (500.0 * s.y).sin(), (500.0 * s.z).sin());
        let want = pose * (f.cross(s) * 0.5);
        assert!((state.torque - want).length() < 1e-6, "tick {k}: {} for {want}", state.torque);
    }
}

/// Notches that are given one by one get a lead of a quarter of their own gap, even if it is
/// smaller than their width.
#[test]
fn notches_given_one_by_one_are_led_by_a_quarter_of_their_gap() {
    let axis = Vec3::Z;
    let gap = core::f64::consts::TAU / 720.0;
    let positions: Vec<f64> = (0..100).map(|k| gap * f64::from(k)).collect();
    let numbers = Span { start: 0, len: 100 };
    let notches = Effect { numbers, ..effect(0, 1, dial(0.5, 0)) };
    let scene = CompiledScene::with_numbers(1, &[notches], &positions).unwrap();
    let mut bench = Bench::active(led(), scene);
    bench.turn(axis * 10.0);
    for k in 0..40 {
        let state = bench.turn(axis * 10.0).state;
        let psi = rotation::log(state.q).z;
        let want = -0.5 * (core::f64::consts::TAU * (psi + 0.25 * gap) / gap).sin();
        assert!((state.torque.z - want).abs() < 1e-6, "tick {k}: {} for {want}", state.torque.z);
    }
}

/// A spring of 100 N m/rad that is left at 5 rad/s asks for 0.5 N m less in each tick. The slew
/// limit allows 0.2, so the torque falls before, and is gone when that of the spring is.
#[test]
fn a_torque_falls_as_early_as_the_slew_limit_makes_it_rise_late() {
    let rig = altered(&led(), |rig| rig.limits.torque_rate = 200.0);
    let stiff = effect(3, 9, spring(100.0, 0.0, Quat::IDENTITY, Anchor::Absolute));
    let scene = CompiledScene::new(1, &[stiff]).unwrap();
    let mut bench = Bench::active(rig, scene);
    for _ in 0..20 {
        bench.turn(Vec3::Y * 5.0);
    }
    bench.turn(Vec3::ZERO);
    let held = bench.run(30).state;
    assert!((held.torque.length() - 2.0).abs() < 1e-9, "the torque limit: {}", held.torque);
    let mut last = held.torque;
    for k in 0..30 {
        let state = bench.turn(Vec3::Y * -5.0).state;
        assert!((state.torque - last).length() < 0.2 + 1e-9, "tick {k}");
        last = state.torque;
        // The spring's torque about n2 at the pose of the lead.
        let spring = -100.0 * (rotation::log(state.q) + state.omega * (1e-6 * state.lead_us)).y;
        if spring > -0.25 {
            assert!(state.torque.y > -0.45, "tick {k}: {} where the spring has {spring}", state.torque);
            return;
        }
    }
    panic!("the spring is never left");
}

/// An effect that takes its lead back must not change what others with the same reference see.
#[test]
fn a_narrow_effect_does_not_shorten_the_lead_of_others() {
    let axis = Vec3::Z;
    let stiff = effect(3, 9, spring(1.0, 0.0, Quat::IDENTITY, Anchor::Absolute));
    let narrow = effect(0, 1, dial(0.0, 720));
    let mut alone = Bench::active(led(), unit());
    let mut first = Bench::active(led(), CompiledScene::new(1, &[narrow, stiff]).unwrap());
    let mut last = Bench::active(led(), CompiledScene::new(1, &[stiff, narrow]).unwrap());
    for _ in 0..20 {
        let [alone, first, last] =
            [&mut alone, &mut first, &mut last].map(|b| b.turn(axis * 20.0).state.torque);
        assert!(
            (alone - first).length() < 1e-12 && (alone - last).length() < 1e-12,
            "{alone} {first} {last}"
        );
    }
}

#[test]
fn a_change_of_scene_at_speed_makes_no_step() {
    let mut bench = Bench::active(led(), unit());
    let omega = Vec3::X * 10.0;
    for _ in 0..5 {
        bench.turn(omega);
    }
    let before = bench.turn(omega).state.torque;
    bench.scene =
        CompiledScene::new(2, &[effect(3, 9, spring(20.0, 0.0, Quat::IDENTITY, Anchor::Absolute))]).unwrap();
    let after = bench.turn(omega).state.torque;
    // In one tick the sphere turns by 10 mrad, against 20 N m/rad.
    assert!((after - before).length() < 20.0 * 0.0101, "{before} then {after}");
}

#[test]
fn what_is_replayed_has_the_same_bits() {
    let texture = effect(1, 2, Kind::Texture(Texture { at: Vec3::X, wave_number: 500.0, depth: 0.1 }));
    let scene = CompiledScene::new(1, &[unit().effects()[0], texture]).unwrap();
    let run = || {
        let mut bench = Bench::active(led(), scene.clone());
        (0..200)
            .map(|k| {
                let omega = Vec3::new(3.0, -2.0, 5.0) * (0.1 * f64::from(k)).sin();
                if k % 7 == 3 { bench.deaf() } else { bench.turn(omega) }
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
    // A copy in the middle of the run goes on with the same bits.
    let mut bench = Bench::active(led(), scene);
    for _ in 0..20 {
        bench.turn(Vec3::X);
    }
    let mut copy = Bench::new(led());
    copy.controller = bench.controller.clone();
    (copy.scene, copy.sphere, copy.tick) = (bench.scene.clone(), bench.sphere.clone(), bench.tick);
    let inputs = bench.inputs();
    assert_eq!(bench.controller.tick(&bench.scene, &inputs), copy.controller.tick(&copy.scene, &inputs));
}

/// A scene that pulls less than the one before it is no fall: the torque follows the fade, and does
/// not dip when the fade is over.
#[test]
fn a_change_of_scene_is_no_fall() {
    let rig = altered(&led(), |rig| rig.limits.torque_rate = 200.0);
    let pull = |epoch: u32, torque: f64| {
        let kind = Kind::Constant(Constant { torque: Vec3::Y * torque, frame: Frame::World });
        let faded = Effect { fade_s: 0.05, ..effect(3, epoch, kind) };
        CompiledScene::new(u64::from(epoch), &[faded]).unwrap()
    };
    let mut bench = Bench::active(rig, pull(1, 1.2));
    let mut before = bench.run(1000).state.torque.y;
    assert!((before - 1.2).abs() < 1.0e-9, "{before}");
    bench.scene = pull(2, 0.4);
    for tick in 0..300 {
        let torque = bench.step().state.torque.y;
        assert!((torque - before).abs() < 0.1, "{tick}: {before} to {torque} N m");
        before = torque;
    }
    assert!((before - 0.4).abs() < 1.0e-9, "{before}");
}
