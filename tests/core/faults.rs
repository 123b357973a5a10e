//! When a link, a clock or an encoder is bad enough to stop, and when it is not.

use crate::bench::{Bench, DT, FirstReply, rig, spring_scene, stream};
use crate::rng::Rng;
use hbot_core::inputs::{Command, Inputs, JointFeedback};
use hbot_core::kinematics::Posture;
use hbot_core::mode::{Cause, Mode};
use hbot_core::outputs::Reply;
use hbot_core::rig::EnergyLimit;
use hbot_core::{CompiledScene, Vec3, rotation};

fn active() -> Bench {
    Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1))
}

#[test]
fn a_tick_is_too_late_above_20_ms_and_not_before() {
    let late = |ns: u64| active().step_with(|inputs| inputs.lateness_ns = ns).state.cause;
    assert_eq!(late(20_000_000), None);
    assert_eq!(late(20_000_001), Some(Cause::Deadline));
    assert_eq!(late(u64::MAX), Some(Cause::Deadline));
}

#[test]
fn ten_skipped_ticks_in_a_row_are_a_fault_and_nine_are_not() {
    let skip = |n: u64| {
        let mut bench = active();
        bench.tick += n;
        bench.step().state.cause
    };
    assert_eq!(skip(9), None);
    assert_eq!(skip(10), Some(Cause::Deadline));
    assert_eq!(skip(u64::MAX / 2), Some(Cause::Deadline));
}

#[test]
fn nine_skipped_ticks_again_and_again_ride_through() {
    let mut bench = active();
    for _ in 0..100 {
        bench.tick += 9;
        assert_eq!(bench.step().state.mode, Mode::Active);
    }
}

#[test]
fn a_link_is_lost_after_its_time_out_and_not_before() {
    for timeout in [1, 20, 100] {
        let mut rig = rig();
        rig.timing.timeout_ticks = timeout;
        let mut bench = Bench::active(rig, CompiledScene::empty());
        // So many ticks may miss their feedback; one more, and the link is lost.
        for k in 1..=timeout {
            assert_eq!(bench.deaf().state.cause, None, "{k} of {timeout} ticks without feedback");
        }
        assert_eq!(bench.deaf().state.cause, Some(Cause::LinkLost));
        assert!(matches!(bench.command(Command::Reset).reply(), Reply::Done), "feedback is back");
    }
}

#[test]
fn skipped_ticks_count_as_ticks_without_feedback() {
    let mut bench = active();
    bench.deaf();
    bench.tick += 9;
    assert_eq!(bench.deaf().state.cause, None);
    bench.tick += 9;
    assert_eq!(bench.deaf().state.cause, Some(Cause::LinkLost), "21 ticks");
}

#[test]
fn a_rig_that_never_answers_is_a_lost_link_too() {
    let mut bench = Bench::new(rig());
    let last = (0..25).map(|_| bench.deaf()).last().unwrap();
    assert_eq!(last.state.cause, Some(Cause::LinkLost));
    assert_eq!(bench.command(Command::Reset).state.mode, Mode::Unreferenced);
    assert_eq!(bench.step().state.mode, Mode::Idle);
}

#[test]
fn one_frame_in_a_hundred_may_be_damaged_and_every_second_one_may_not() {
    let mut rng = Rng(21);
    // 100 s at 1 kHz. A damaged frame is also one that is missing.
    let mut bench = active();
    for _ in 0..100_000 {
        let damaged = rng.once_in(100);
        let state = bench
            .step_with(|inputs| {
                if damaged {
                    (inputs.corrupt_frames, inputs.feedback) = (1, None);
                }
            })
            .state;
        assert_eq!(state.mode, Mode::Active);
    }
    let mut bench = active();
    let stopped = (0..200).find(|_| {
        let damaged = rng.once_in(2);
        let outputs = bench.step_with(|inputs| {
            if damaged {
                (inputs.corrupt_frames, inputs.feedback) = (1, None);
            }
        });
        outputs.state.cause == Some(Cause::LinkCorrupt)
    });
    assert!(stopped.is_some_and(|tick| tick < 60), "{stopped:?}");
    // Any number of damaged frames at once is forgiven within half a second.
    bench.step_with(|inputs| inputs.corrupt_frames = u16::MAX);
    bench.run(400);
    assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
}

#[test]
fn more_than_half_a_turn_between_readings_is_not_believed() {
    // A person may spin a dead sphere, up to where the way that a joint went is lost.
    for (joint, half) in [(0, 8192), (1, 139_264), (2, 8192), (3, 139_264)] {
        for sign in [1, -1] {
            let jump = |counts: i32| {
                let mut bench = Bench::new(rig());
                bench.run(3);
                bench
                    .step_with(|inputs| inputs.feedback.as_mut().unwrap().counts[joint] += sign * counts)
                    .state
                    .cause
            };
            assert_eq!(jump(half - 1), None, "joint {joint}");
            assert_eq!(jump(half), Some(Cause::ImplausibleFeedback), "joint {joint}");
            assert_eq!(jump(half + 1), Some(Cause::ImplausibleFeedback), "joint {joint}");
        }
    }
}

#[test]
fn under_power_a_count_beyond_four_times_the_limit_of_speed_is_not_believed() {
    let rig = rig();
    for joint in 0..4 {
        // The joint's rate about the axis that turns it most, at 30 rad/s of the sphere.
        let row = Posture::new(&rig.device, &[0.0; 2]).rows()[joint].length();
        let counts = f64::from(rig.joints[joint].counts_per_turn) * rig.joints[joint].gear;
        let most = 4.0 * rig.limits.speed * row * DT / std::f64::consts::TAU * counts;
        for (share, cause) in [(0.99, None), (1.01, Some(Cause::ImplausibleFeedback))] {
            // Two counts are left to rounding.
            let by = (most * share + if share > 1.0 { 3.0 } else { 0.0 }) as i32;
            for sign in [1, -1] {
                let mut bench = active();
                let state = bench
                    .step_with(|inputs| inputs.feedback.as_mut().unwrap().counts[joint] += sign * by)
                    .state;
                assert_eq!(state.cause, cause, "joint {joint} by {by} counts");
            }
        }
    }
}

/// Runs a powered rig whose counts move by `counts` a tick in each joint and whose controllers report
/// `rates`: the fault that it ends in, and after how many ticks.
fn lie(counts: [i32; 4], rates: [f64; 4]) -> Option<(Cause, usize)> {
    let mut bench = active();
    (1..200).find_map(|tick| {
        for (offset, by) in bench.offset.iter_mut().zip(counts) {
            *offset = offset.wrapping_add(by);
        }
        let state = bench
            .step_with(|inputs| inputs.feedback.as_mut().unwrap().rates[..4].copy_from_slice(&rates))
            .state;
        state.cause.map(|cause| (cause, tick))
    })
}

#[test]
fn a_sphere_that_turns_too_fast_by_its_counts_alone_is_overspeed_within_50_ms() {
    // Both drives roll: 41 rad/s at the sphere, of which 30 are allowed, with rates that say 0.
    let counts = (41.0 * 0.102 / 0.0155 * DT / std::f64::consts::TAU * 16384.0 * 17.0) as i32;
    let (cause, tick) = lie([0, counts, 0, counts], [0.0; 4]).expect("a fault");
    assert!(cause == Cause::Overspeed && tick <= 50, "{cause:?} after {tick} ms");
    assert_eq!(lie([0; 4], [0.0; 4]), None);
}

#[test]
fn a_wheel_that_slips_by_its_counts_alone_is_slip_within_50_ms() {
    // What no turn of the sphere explains of drive A's rolling, so that a contact slips at 0.2 m/s.
    let rig = rig();
    let posture = Posture::new(&rig.device, &[0.0; 2]);
    let alone = posture.forward(&rig.device, &[0.0, 1.0, 0.0, 0.0]);
    let explained = posture.inverse(alone.omega);
    let slip = alone.slip.iter().map(|[u, v]| u.hypot(*v)).fold(0.0, f64::max);
    let counts = [0, 1, 2, 3].map(|j| {
        let rate = (f64::from(u8::from(j == 1)) - explained[j]) * 0.2 / slip;
        let joint = &rig.joints[j];
        (rate * DT / std::f64::consts::TAU * f64::from(joint.counts_per_turn) * joint.gear) as i32
    });
    let (cause, tick) = lie(counts, [0.0; 4]).expect("a fault");
    assert!(cause == Cause::Slip && tick <= 50, "{cause:?} after {tick} ms");
}

#[test]
fn counts_and_rates_that_disagree_are_not_believed_within_75_ms() {
    // A steering joint that drifts at 1 rad/s, below the limit of slip, with rates that say 0; and rates
    // of 1 rad/s with counts that stand.
    let drift = (DT / std::f64::consts::TAU * 16384.0).ceil() as i32;
    for (counts, rates) in [([drift, 0, 0, 0], [0.0; 4]), ([0; 4], [1.0, 0.0, 0.0, 0.0])] {
        let (cause, tick) = lie(counts, rates).expect("a fault");
        assert!(
            cause == Cause::ImplausibleFeedback && (20..=75).contains(&tick),
            "{cause:?} after {tick} ms"
        );
    }
    // A lag of 5 ms in the rates of a sphere that is turned to and fro is no lie.
    let mut bench = active();
    let mut rates = [0.0; 4];
    for k in 0..2000 {
        let omega = Vec3::new(4.0, 2.0, 3.0) * (0.05 * f64::from(k)).sin();
        let reading = bench.feedback();
        bench.sphere.turn(omega, DT);
        for (rate, now) in rates.iter_mut().zip(reading.rates) {
            *rate += (now - *rate) * DT / 0.005;
        }
        let state = bench
            .step_with(|inputs| {
                inputs.feedback = Some(reading);
                inputs.feedback.as_mut().unwrap().rates[..4].copy_from_slice(&rates);
            })
            .state;
        assert_eq!(state.cause, None, "tick {k}");
    }
}

#[test]
fn readings_that_come_late_or_after_gaps_are_no_lies() {
    // A sphere that is turned to and fro. Now and then the line stands for up to 200 ms: the controllers
    // then answer the oldest command first, with what they read at that moment.
    let mut rig = rig();
    rig.timing.timeout_ticks = 1000;
    for pace in [0.002, 0.02, 0.1] {
        let mut bench = Bench::active(rig, spring_scene(1, 2.0, Vec3::X * 0.1));
        let mut rng = Rng(9);
        let mut line = std::collections::VecDeque::new();
        let mut wait = 0;
        for k in 0..20_000 {
            let reading = bench.feedback();
            bench.sphere.turn(Vec3::new(1.0, 0.3, -0.7) * (pace * f64::from(k)).sin(), DT);
            line.push_back(reading.sequence);
            let stood = wait > 0;
            wait = if stood {
                wait - 1
            } else if rng.once_in(400) {
                rng.below(200)
            } else {
                0
            };
            let answered = match (wait, stood) {
                (0, true) => line.pop_front(),
                (0, false) => line.drain(..).next_back(),
                _ => None,
            };
            let state = bench
                .step_with(|inputs| {
                    inputs.feedback = answered.map(|sequence| {
                        let mut late = reading;
                        late.sequence = sequence;
                        late
                    });
                })
                .state;
            assert_eq!(state.cause, None, "tick {k}, pace {pace}");
        }
    }
}

#[test]
fn motors_that_are_on_or_off_against_the_command_for_20_ms_are_a_fault() {
    for powered in [true, false] {
        let mut bench = if powered { active() } else { Bench::new(rig()) };
        bench.run(2);
        let disobey = |inputs: &mut Inputs| {
            inputs.feedback.as_mut().unwrap().complaints.disobeyed = true;
        };
        let tick = (1..100).find(|_| bench.step_with(disobey).state.cause == Some(Cause::ControllerFault));
        assert_eq!(tick, Some(21), "powered: {powered}");
        assert!(bench.command(Command::Reset).reply() == Reply::Done, "it obeys again");
        // Now and then is no fault: a power stage that wakes.
        for _ in 0..100 {
            bench.step_with(disobey);
            assert_eq!(bench.step().state.cause, None);
        }
    }
}

#[test]
fn readings_that_answer_too_old_a_command_are_a_lost_link_for_as_long_as_they_do() {
    for (late, lost) in [(18, false), (19, false), (20, true), (30, true), (100, true)] {
        let mut bench = active();
        let mut line = std::collections::VecDeque::new();
        let mut cause = None;
        for k in 0..400_u32 {
            line.push_back(bench.feedback());
            // Later and later, so that no gap is long.
            let now = line.len() as u32 > late.min(k / 4);
            let reading = if now { line.pop_front() } else { None };
            cause = bench.step_with(|inputs| inputs.feedback = reading).state.cause;
        }
        assert_eq!(cause, lost.then_some(Cause::LinkLost), "{late} ticks late");
        if lost {
            assert_eq!(bench.command(Command::Reset).reply(), Reply::Done, "news again");
        }
    }
}

#[test]
fn one_reading_in_twenty_for_ever_is_a_lost_link_and_one_in_five_is_not() {
    for (every, lost) in [(20, true), (10, true), (5, false), (2, false)] {
        let mut bench = active();
        let cause =
            (0..2000).find_map(|k| if k % every == 0 { bench.step() } else { bench.deaf() }.state.cause);
        assert_eq!(cause, lost.then_some(Cause::LinkLost), "one in {every}");
    }
}

#[test]
fn after_a_reading_that_was_not_believed_the_rig_works_again() {
    // One reading alone, and joints that were turned far while nobody looked.
    for stays in [false, true] {
        let mut bench = active();
        let before = bench.step().state;
        let jump = |bench: &mut Bench| bench.offset[0] = bench.offset[0].wrapping_add(10_000);
        jump(&mut bench);
        assert_eq!(bench.step().state.cause, Some(Cause::ImplausibleFeedback));
        if !stays {
            bench.offset[0] -= 10_000;
        }
        bench.run(2);
        assert_eq!(bench.command(Command::Reset).reply(), Reply::Done, "stays: {stays}");
        let after = bench.step().state;
        // Which way the sphere went is not known, so no turn is made of it; the steering angle is what is read now.
        assert!(rotation::angle_between(after.q, before.q) < 1e-12);
        let steering = if stays { core::f64::consts::TAU * 10_000.0 / 16384.0 } else { 0.0 };
        let off = rotation::wrap_angle(after.angle[0] - before.angle[0] - steering);
        assert!(off.abs() < 1e-12, "stays: {stays}, {off}");
        assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
        assert_eq!(bench.run(510).state.mode, Mode::Active);
    }
}

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
fn counts_that_wrap_at_32_bits_change_nothing() {
    // As many whole turns of each encoder as there are below 2^31, so that the angles are the same.
    let whole = |turn: i32| i32::MAX / turn * turn;
    for sign in [1, -1] {
        let mut plain = Bench::new(rig());
        let mut wrapping = Bench::new(rig());
        for (j, offset) in wrapping.offset[..4].iter_mut().enumerate() {
            *offset = sign * whole(if j % 2 == 0 { 16384 } else { 278_528 });
        }
        let mut wrapped = 0;
        for k in 0..4000 {
            let t = f64::from(k) * DT;
            let omega = Vec3::new(8.0, 3.0 * (2.0 * t).sin(), 6.0 * (0.3 * t).cos());
            let [a, b] = [&mut plain, &mut wrapping].map(|bench| bench.turn(omega).state);
            assert_eq!(a, b, "tick {k}");
            let counts = wrapping.feedback().counts;
            wrapped += usize::from(counts[..4].iter().any(|count| count.signum() == -sign));
        }
        assert!(wrapped > 100, "some joint did pass 2^31");
    }
}

#[test]
fn odometry_follows_a_sphere_that_turns() {
    let mut bench = Bench::new(rig());
    for k in 0..3000 {
        let t = f64::from(k) * DT;
        bench.turn(Vec3::new(2.0 * (3.0 * t).cos(), 1.5, -2.0 * (2.0 * t).sin()));
    }
    let state = bench.step().state;
    // 16384 counts a turn and straight joint paths between readings 1 ms apart: 1e-4 rad over 3 s at the most (physics notes,
    // section 4: 2.6e-5 in 2 s).
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
    let elsewhere = |feedback: JointFeedback| JointFeedback { counts: [7; 16], rates: [0.1; 16], ..feedback };
    for stale in [newest, elsewhere(newest), old, elsewhere(old)] {
        let state = bench.step_with(|inputs| inputs.feedback = Some(stale)).state;
        assert!(!state.fresh);
        assert_eq!((state.q, state.omega, state.angle), (taken.q, taken.omega, taken.angle));
    }
    // And does not keep a dead link alive.
    for _ in 0..16 {
        assert_eq!(bench.step_with(|inputs| inputs.feedback = Some(newest)).state.cause, None);
    }
    assert_eq!(bench.step_with(|inputs| inputs.feedback = Some(newest)).state.cause, Some(Cause::LinkLost));
}

#[test]
fn feedback_to_a_command_of_the_future_is_left_out_and_does_not_make_the_rest_look_old() {
    let mut bench = active();
    let ahead = JointFeedback { sequence: bench.sent().wrapping_add(1000), ..bench.feedback() };
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
fn a_tick_that_comes_twice_or_is_of_the_past_takes_no_time() {
    let mut bench = Bench::new(rig());
    bench.scene = spring_scene(1, 2.0, Vec3::X * 0.1);
    bench.step();
    bench.command(Command::Enable);
    bench.run(200);
    let now = bench.step().state;
    for tick in [now.tick, now.tick, now.tick - 100, now.tick - 100, 0, 0] {
        let state = bench.step_with(|inputs| inputs.tick = tick).state;
        assert_eq!(state.mode, Mode::Enabling);
        assert!((state.torque - now.torque).length() < 1e-14, "no time, no ramp: tick {tick}");
    }
    // Time goes on from there.
    assert!(bench.step().state.torque.x > now.torque.x);
}

#[test]
fn the_end_of_all_ticks_is_no_danger() {
    let mut bench = Bench::from_tick(rig(), u64::MAX - 40);
    bench.scene = spring_scene(1, 2.0, Vec3::X * 0.1);
    bench.step();
    bench.command(Command::Enable);
    for _ in 0..30 {
        bench.command(crate::bench::stream(Vec3::X * 0.1, u32::MAX));
        bench.command(Command::Reference {
            slot: 0,
            epoch: 1,
            q: hbot_core::Quat::IDENTITY,
            omega: Vec3::ZERO,
            valid_ticks: u32::MAX,
            stamp: hbot_core::inputs::Stamp::default(),
        });
        if bench.tick > u64::MAX - 4 {
            break;
        }
    }
}

#[test]
fn a_motor_above_its_continuous_torque_is_too_hot_when_i_squared_t_says_so() {
    let thermal_time = 4.0;
    let ticks_until_hot = |factor: f64| {
        let mut rig = rig();
        rig.limits.thermal_time = Some(thermal_time);
        // The joint that works hardest holds `factor` times its continuous torque.
        let mut probe = Bench::active(rig, spring_scene(1, 2.0, Vec3::X * 0.1));
        let torques = probe.run(10).state.joint_torque;
        for (joint, torque) in rig.joints.iter_mut().zip(torques) {
            joint.continuous = (torque.abs() / factor).max(1e-9);
        }
        for j in [0, 2] {
            rig.joints[j].continuous = 10.0;
        }
        let mut bench = Bench::active(rig, CompiledScene::empty());
        bench.scene = spring_scene(2, 2.0, Vec3::X * 0.1);
        (0..40_000).find(|_| bench.step().state.cause == Some(Cause::Thermal))
    };
    for factor in [1.5, 3.0] {
        let ticks = ticks_until_hot(factor).expect("hot some time");
        let square = factor * factor;
        let expected = thermal_time * (square / (square - 1.0)).ln() / DT;
        // Half the fade of the new scene (50 ms) comes on top, and a thousandth for the steps.
        let off = ticks as f64 - expected;
        assert!((-20.0..80.0).contains(&off), "{factor}: {ticks} ticks, {expected} expected");
    }
    assert_eq!(ticks_until_hot(0.98), None, "below the continuous torque it works for ever");
}

#[test]
fn energy_beyond_its_limit_is_a_fault_when_it_has_added_up_and_not_before() {
    // The sphere turns along with 0.3 N m at 2 rad/s: 0.6 W into the hand; or against it, out of the hand.
    let ticks_until = |burst: f64, power: f64, omega: f64| {
        let mut rig = rig();
        rig.limits.energy = Some(EnergyLimit { burst, power });
        let mut bench = Bench::active(rig, CompiledScene::empty());
        bench.command(stream(Vec3::X * 0.3, 1_000_000));
        let found = (0..5000).find(|_| bench.turn(Vec3::X * omega).state.cause.is_some());
        if found.is_some() {
            let state = bench.step().state;
            assert_eq!((state.cause, state.torque), (Some(Cause::Overtorque), Vec3::ZERO));
            assert_eq!(
                bench.command(Command::Reset).reply(),
                Reply::Done,
                "without power nothing is given out"
            );
        }
        found
    };
    for (burst, power) in [(0.1, 0.1), (0.05, 0.4), (0.5, 0.35)] {
        let expected = burst / (0.6 - power) / DT;
        let ticks = ticks_until(burst, power, 2.0).expect("some time");
        // The slew of the torque, a tick's delay of the reading, and rounding.
        assert!(
            (ticks as f64 - expected).abs() <= 8.0,
            "{burst} J, {power} W: {ticks} ticks, not {expected}"
        );
    }
    assert_eq!(ticks_until(0.01, 0.61, 2.0), None, "a power that is allowed is allowed for ever");
    assert_eq!(ticks_until(0.01, 0.01, -2.0), None, "what comes in is no burst");
}

#[test]
fn energy_that_came_in_is_no_credit_for_a_burst() {
    let mut rig = rig();
    rig.limits.energy = Some(EnergyLimit { burst: 0.1, power: 0.01 });
    let mut bench = Bench::active(rig, CompiledScene::empty());
    bench.command(stream(Vec3::X * 0.3, 1_000_000));
    for _ in 0..3000 {
        assert_eq!(bench.turn(Vec3::X * -2.0).state.cause, None);
    }
    assert!(bench.step().state.energy < -1.0);
    let ticks = (0..1000).find(|_| bench.turn(Vec3::X * 2.0).state.cause.is_some()).expect("some time");
    assert!((160..190).contains(&ticks), "0.1 J at 0.59 W: {ticks} ticks");
}

#[test]
fn a_hot_motor_must_cool_down_before_reset() {
    let mut rig = rig();
    rig.limits.thermal_time = Some(1.0);
    rig.joints.iter_mut().for_each(|joint| joint.continuous = 1e-3);
    let mut bench = Bench::active(rig, CompiledScene::empty());
    bench.scene = spring_scene(2, 2.0, Vec3::X * 0.1);
    let hot = (0..5000).map(|_| bench.step()).find(|o| o.state.cause.is_some()).expect("hot some time");
    assert_eq!((hot.state.cause, hot.state.torque), (Some(Cause::Thermal), Vec3::ZERO));
    assert!(matches!(bench.command(Command::Reset).reply(), Reply::Refused(_)));
    bench.run(1000);
    assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
}
