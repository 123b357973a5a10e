//! Readings and ticks that are late, repeated, out of order or far ahead.

use crate::prelude::*;

#[test]
fn joints_turned_far_during_a_lost_link_do_not_keep_it_from_being_reset() {
    let mut bench = active();
    for _ in 0..30 {
        bench.deaf();
    }
    for _ in 0..1000 {
        bench.sphere.turn(Vec3::new(3.0, -2.0, 1.0), DT);
    }
    bench.sphere.omega = Vec3::ZERO;
    let state = bench.run(3).state;
    assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::LinkLost)), "the first cause stands");
    assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
}

#[test]
fn odometry_follows_a_sphere_that_turns() {
    let mut bench = Bench::new(rig());
    for k in 0..3000 {
        let t = f64::from(k) * DT;
        bench.turn(Vec3::new(2.0 * (3.0 * t).cos(), 1.5, -2.0 * (2.0 * t).sin()));
    }
    let state = bench.step().state;
    // With 16384 counts per turn and straight joint paths between readings 1 ms apart, the error is
    // at most 1e-4 rad over 3 s (physics notes, section 4: 2.6e-5 in 2 s).
    let drift = rotation::angle_between(state.q, bench.sphere.q);
    assert!(drift < 1e-4, "{drift:e} rad");
    assert!((state.omega - bench.sphere.omega).length() < 1e-2);
}

#[test]
fn feedback_that_is_old_or_comes_twice_is_left_out() {
    let mut bench = active();
    let old = bench.feedback();
    assert!(bench.step().state.fresh);
    bench.sphere.turn(Vec3::X, DT);
    let newest = bench.feedback();
    let taken = bench.step().state;
    assert!(taken.fresh);
    let elsewhere = |feedback: JointReadings| JointReadings { counts: [7; 16], rates: [0.1; 16], ..feedback };
    for stale in [newest, elsewhere(newest), old, elsewhere(old)] {
        let state = bench.step_with(|inputs| inputs.feedback = Some(stale)).state;
        assert!(!state.fresh);
        assert_eq!((state.q, state.omega, state.angle), (taken.q, taken.omega, taken.angle));
    }
    // Repeated feedback does not keep a dead link alive.
    for _ in 0..16 {
        assert_eq!(bench.step_with(|inputs| inputs.feedback = Some(newest)).state.cause, None);
    }
    assert_eq!(bench.step_with(|inputs| inputs.feedback = Some(newest)).state.cause, Some(Cause::LinkLost));
}

#[test]
fn feedback_to_a_command_of_the_future_is_left_out_and_does_not_make_the_rest_look_old() {
    let mut bench = active();
    let ahead = JointReadings { sequence: bench.sent().wrapping_add(1000), ..bench.feedback() };
    assert!(!bench.step_with(|inputs| inputs.feedback = Some(ahead)).state.fresh);
    assert!(bench.step().state.fresh);
}

#[test]
fn feedback_whose_number_wraps_is_still_the_newest() {
    let mut bench = Bench::from_tick(rig(), u64::from(u32::MAX) - 50);
    bench.scene = spring_scene(1, 2.0, Vec3::X * 0.1);
    bench.step();
    for k in 0..100 {
        let state = bench.turn(Vec3::Y).state;
        assert!(state.fresh && state.cause.is_none(), "tick {k}");
    }
}

#[test]
fn the_end_of_all_ticks_is_no_danger() {
    let mut bench = Bench::from_tick(rig(), u64::MAX - 40);
    bench.scene = spring_scene(1, 2.0, Vec3::X * 0.1);
    bench.step();
    bench.command(Command::Enable);
    for _ in 0..30 {
        bench.command(crate::bench::stream(Vec3::X * 0.1, u32::MAX));
        bench.command(crate::bench::reference(0, 1, hbot_core::Quat::IDENTITY, Vec3::ZERO, u32::MAX));
        if bench.tick > u64::MAX - 4 {
            break;
        }
    }
}

#[test]
fn a_first_reading_from_the_future_does_not_find_the_zeros() {
    let mut bench = Bench::new(rig());
    let ahead = JointReadings { sequence: bench.sent().wrapping_add(1000), ..bench.feedback() };
    assert_eq!(bench.step_with(|inputs| inputs.feedback = Some(ahead)).state.mode, Mode::Unreferenced);
    assert_eq!(bench.step().state.mode, Mode::Idle);
}

#[test]
fn a_joint_begins_at_the_angle_that_its_first_count_means() {
    for reversed in [false, true] {
        let rig = altered(&rig(), |rig| rig.joints.iter_mut().for_each(|joint| joint.reversed = reversed));
        for count in [1000, -1000, 16384 * 17 + 5] {
            let mut bench = Bench::new(rig);
            bench.offset = [count; 16];
            let angle = bench.step().state.angle;
            for j in 0..4 {
                let off =
                    rotation::wrap_angle(angle[j] - f64::from(count) * rig.joints[j].radians_per_count());
                assert!(off.abs() < 1e-12, "joint {j}, count {count}, reversed: {reversed}: {off} rad off");
            }
        }
    }
}

#[test]
fn angles_stay_within_a_turn_in_both_directions() {
    for by in [1000, -1000] {
        let mut bench = Bench::new(rig());
        for _ in 0..1000 {
            bench.offset[..4].iter_mut().for_each(|offset| *offset += by);
            let angle = bench.step().state.angle;
            let within = angle.iter().all(|angle| (0.0..std::f64::consts::TAU).contains(angle));
            assert!(within, "{by} counts a tick: {angle:?}");
        }
    }
}
