//! Readings from encoders and motor controllers that cannot be true are refused.

use crate::prelude::*;

#[test]
fn under_power_a_count_beyond_four_times_the_limit_of_speed_is_not_believed() {
    let rig = rig();
    for joint in 0..4 {
        // The joint's rate about the axis that turns it most, at 30 rad/s of the sphere.
        let row = Posture::new(&rig.device, &[0.0; 2]).rows()[joint].length();
        let most = 4.0 * rig.limits.speed * row * DT / rig.joints[joint].radians_per_count();
        // Two counts are allowed for rounding.
        for (more, cause) in [(-1.0, None), (1.0, None), (3.0, Some(Cause::ImplausibleFeedback))] {
            let by = (most + more) as i32;
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

/// Runs an active rig whose joints move by `counts` per tick while the motor controllers report
/// `rates` (rad/s). Returns the fault in which it ends, and after how many ticks.
fn lie(counts: [i32; 4], rates: [f64; 4]) -> Option<(Cause, usize)> {
    lie_to(rig(), 1, counts, rates)
}

/// Does the same as [`lie`] with the rig `rig`. Only every `every`-th tick has a reading.
fn lie_to(rig: Rig, every: usize, counts: [i32; 4], rates: [f64; 4]) -> Option<(Cause, usize)> {
    lie_late(rig, every, 0, counts, rates)
}

/// Does the same as [`lie_to`]. Each reading answers a command that is `late` ticks older.
fn lie_late(rig: Rig, every: usize, late: u32, counts: [i32; 4], rates: [f64; 4]) -> Option<(Cause, usize)> {
    let mut bench = Bench::active(rig, spring_scene(1, 2.0, Vec3::X * 0.1));
    (1..200).find_map(|tick| {
        for (offset, by) in bench.offset.iter_mut().zip(counts) {
            *offset = offset.wrapping_add(by);
        }
        let mut reading = bench.feedback();
        reading.rates[..4].copy_from_slice(&rates);
        reading.sequence = reading.sequence.wrapping_sub(late);
        let heard = tick % every == 0;
        let state = bench.step_with(|inputs| inputs.feedback = heard.then_some(reading)).state;
        state.cause.map(|cause| (cause, tick))
    })
}

#[test]
fn a_sphere_that_turns_too_fast_by_its_counts_alone_is_overspeed_within_50_ms() {
    // Both drives roll, which is 41 rad/s at the sphere, above the limit of 30. The reported rates
    // are 0.
    let counts = (41.0 * 0.102 / 0.0155 * DT / std::f64::consts::TAU * 16384.0 * 17.0) as i32;
    let (cause, tick) = lie([0, counts, 0, counts], [0.0; 4]).expect("a fault");
    assert!(cause == Cause::Overspeed && tick <= 50, "{cause:?} after {tick} ms");
    assert_eq!(lie([0; 4], [0.0; 4]), None);
}

/// Returns the counts per tick at which a contact slips at 0.2 m/s: the part of drive A's rolling
/// that no turn of the sphere explains.
fn slipping() -> [i32; 4] {
    let rig = rig();
    let posture = Posture::new(&rig.device, &[0.0; 2]);
    let alone = posture.forward(&rig.device, &[0.0, 1.0, 0.0, 0.0]);
    let explained = posture.inverse(alone.omega);
    let slip = alone.slip.iter().map(|[u, v]| u.hypot(*v)).fold(0.0, f64::max);
    [0, 1, 2, 3].map(|j| {
        let rate = (f64::from(u8::from(j == 1)) - explained[j]) * 0.2 / slip;
        (rate * DT / rig.joints[j].radians_per_count()) as i32
    })
}

#[test]
fn a_wheel_that_slips_by_its_counts_alone_is_slip_within_50_ms() {
    let (cause, tick) = lie(slipping(), [0.0; 4]).expect("a fault");
    assert!(cause == Cause::Slip && tick <= 50, "{cause:?} after {tick} ms");
}

/// Returns the slip of the two wheels in the steer angles `steer` if `joint` alone moves, at
/// 1 rad/s: the largest along an axle (c1) and along a rolling direction (c2), m/s. The last value
/// holds the joint rates that no turn of the sphere explains, rad/s.
fn slip_of_joint(rig: &Rig, steer: [f64; 2], joint: usize) -> ([f64; 2], [f64; 4]) {
    let posture = Posture::new(&rig.device, &steer);
    let alone = [0, 1, 2, 3].map(|j| f64::from(u8::from(j == joint)));
    let moved = posture.forward(&rig.device, &alone);
    let explained = posture.inverse(moved.omega);
    let largest = |axis: usize| moved.slip[..2].iter().map(|slip| slip[axis].abs()).fold(0.0, f64::max);
    ([largest(0), largest(1)], [0, 1, 2, 3].map(|j| alone[j] - explained[j]))
}

#[test]
fn slip_along_the_axles_or_along_the_rolling_directions_alone_is_slip_by_counts_too() {
    let rig = rig();
    let angle = |k: u32| f64::from(k) * core::f64::consts::TAU / 72.0;
    // Two contacts slip towards each other. In some posture both axles point that way, in another
    // both rolling directions.
    for axis in [0, 1] {
        // The first wheel steers, or it rolls.
        let joint = axis;
        let postures = (0..72 * 72).map(|k| [angle(k / 72), angle(k % 72)]);
        let share = |steer: &[f64; 2]| {
            let (slip, _) = slip_of_joint(&rig, *steer, joint);
            if slip[axis] > 1.0e-3 { slip[1 - axis] / slip[axis] } else { f64::INFINITY }
        };
        let steer = postures.min_by(|a, b| share(a).total_cmp(&share(b))).expect("some postures");
        let (slip, rates) = slip_of_joint(&rig, steer, joint);
        assert!(share(&steer) < 0.1, "{} at {steer:?}", share(&steer));
        for sign in [1.0, -1.0] {
            // The slip is twice the limit.
            let counts = [0, 1, 2, 3].map(|j| {
                let rate = sign * rates[j] * 2.0 * rig.limits.slip / slip[axis];
                (rate * DT / rig.joints[j].radians_per_count()).round() as i32
            });
            let mut bench = Bench::new(rig);
            for (wheel, angle) in steer.into_iter().enumerate() {
                bench.offset[2 * wheel] = (angle / rig.joints[2 * wheel].radians_per_count()).round() as i32;
            }
            bench.run(2);
            assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
            let fault = (1..=50).find_map(|tick| {
                for (offset, by) in bench.offset.iter_mut().zip(counts) {
                    *offset += by;
                }
                // The motor controllers report rates of 0.
                bench.step().state.cause.map(|cause| (cause, tick))
            });
            // At this speed the wheels steer by a tenth of a radian at most in a block of 25 ms, so
            // the slip stays along one axis.
            let (cause, tick) = fault.expect("a fault");
            assert!(cause == Cause::Slip && tick <= 50, "{cause:?} after {tick} ms, {counts:?}");
        }
    }
}

#[test]
fn over_gaps_of_more_than_five_ticks_neither_slip_nor_rates_are_judged() {
    // In six ticks the wheels can have steered far.
    for (every, cause) in [(4, Some(Cause::Slip)), (5, Some(Cause::Slip)), (6, None), (7, None)] {
        let found = lie_to(rig(), every, slipping(), [0.0; 4]).map(|(cause, _)| cause);
        assert_eq!(found, cause, "one reading in {every} ticks");
    }
}

#[test]
fn counts_and_rates_that_disagree_are_not_believed_within_75_ms() {
    // First a steer joint drifts at 1 rad/s, below the slip limit, with reported rates of 0. Then
    // the reported rate is 1 rad/s while the counts stand still.
    let drift = (DT / std::f64::consts::TAU * 16384.0).ceil() as i32;
    let (drifts, stands) = (([drift, 0, 0, 0], [0.0; 4]), ([0; 4], [1.0, 0.0, 0.0, 0.0]));
    // Rates that are estimated from counts always agree with them.
    let estimated = RateEstimate::Kalman { acceleration: 100.0 };
    for (rate, (counts, rates)) in
        [(RateEstimate::Controller, drifts), (RateEstimate::Controller, stands), (estimated, stands)]
    {
        let rig = altered(&rig(), |rig| rig.methods.rate = rate);
        let (cause, tick) = lie_to(rig, 1, counts, rates).expect("a fault");
        assert!(
            cause == Cause::ImplausibleFeedback && (20..=75).contains(&tick),
            "{cause:?} after {tick} ms with {rate:?}"
        );
    }
    // A controller that reports no rate says 0.
    let rig = altered(&rig(), |rig| rig.methods.rate = estimated);
    assert_eq!(lie_to(rig, 1, drifts.0, drifts.1), None);
    // A lag of 5 ms in the rates is accepted while the sphere turns back and forth.
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
fn counts_and_rates_may_differ_by_half_of_the_larger_and_a_tenth_of_a_rad_per_s() {
    let rig = altered(&rig(), |rig| rig.limits.slip = 10.0);
    // Five counts a tick are 1.917 rad/s. In addition to half and to 0.1 rad/s, two counts in 50 ms
    // are allowed, which is 0.015 rad/s.
    for sign in [1, -1] {
        for (rate, cause) in [
            (0.87, None),
            (0.83, Some(Cause::ImplausibleFeedback)),
            (4.03, None),
            (4.10, Some(Cause::ImplausibleFeedback)),
        ] {
            let (mut counts, mut rates) = ([0; 4], [0.0; 4]);
            (counts[0], rates[0]) = (5 * sign, rate * f64::from(sign));
            let found = lie_to(rig, 1, counts, rates).map(|(cause, _)| cause);
            assert_eq!(found, cause, "{} counts a tick, {} rad/s", counts[0], rates[0]);
        }
    }
}

#[test]
fn readings_that_come_late_may_differ_by_more() {
    let rig = altered(&rig(), |rig| rig.limits.slip = 10.0);
    // In a block of 50 ms, four ticks are 8 % of the motion in addition to half of it.
    for (late, rate, cause) in [
        (0, 0.80, Some(Cause::ImplausibleFeedback)),
        (4, 0.80, None),
        (4, 0.65, Some(Cause::ImplausibleFeedback)),
    ] {
        let found = lie_late(rig, 1, late, [5, 0, 0, 0], [rate, 0.0, 0.0, 0.0]).map(|(cause, _)| cause);
        assert_eq!(found, cause, "{late} ticks late, {rate} rad/s");
    }
}

#[test]
fn a_sphere_may_turn_five_percent_faster_than_the_limit_by_its_counts_alone() {
    // Both drives roll. The reported rates are those of 29 rad/s, below the limit of 30.
    let rig = altered(&rig(), |rig| rig.limits.slip = 10.0);
    let device = rig.device;
    let roll = 1.0 / Posture::new(&device, &[0.0; 2]).forward(&device, &[0.0, 1.0, 0.0, 1.0]).omega.length();
    for (omega, cause) in [(31.25, None), (31.8, Some(Cause::Overspeed))] {
        let counts = (omega * roll * DT / std::f64::consts::TAU * 16384.0 * 17.0) as i32;
        let rates = [0.0, 29.0 * roll, 0.0, 29.0 * roll];
        let found = lie_to(rig, 1, [0, counts, 0, counts], rates).map(|(cause, _)| cause);
        assert_eq!(found, cause, "{omega} rad/s");
    }
}

#[test]
fn an_overspeed_by_counts_that_an_estop_ended_does_not_come_back() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let counts = (41.0 * 0.102 / 0.0155 * DT / std::f64::consts::TAU * 16384.0 * 17.0) as i32;
    let fault = (0..100).find_map(|_| {
        bench.offset[1] += counts;
        bench.offset[3] += counts;
        bench.step().state.cause
    });
    assert_eq!(fault, Some(Cause::Overspeed));
    assert_eq!(bench.command(Command::Estop).state.mode, Mode::Estop);
    bench.run(100);
    assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
    assert_eq!(bench.run(600).state.mode, Mode::Active);
}

#[test]
fn a_rate_of_ten_thousand_rad_per_s_is_believed_and_no_larger_one() {
    for (rate, cause) in [(1.0e4, None), (1.0e4 + 1e-9, Some(Cause::ImplausibleFeedback))] {
        for sign in [1.0, -1.0] {
            let mut bench = Bench::new(rig());
            bench.run(3);
            let state =
                bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates[1] = sign * rate).state;
            assert_eq!(state.cause, cause, "{rate} rad/s");
        }
    }
}

#[test]
fn readings_that_come_late_or_after_gaps_are_no_lies() {
    // The sphere turns back and forth. From time to time the line stops for up to 200 ms. Then the
    // motor controllers answer the oldest command first, with what they read at that moment.
    let rig = altered(&rig(), |rig| rig.timing.timeout_ticks = 1000);
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
        // A single disagreement is not a fault, for example while a power stage starts.
        for _ in 0..100 {
            bench.step_with(disobey);
            assert_eq!(bench.step().state.cause, None);
        }
    }
}

#[test]
fn after_a_reading_that_was_not_believed_the_rig_works_again() {
    // Either a single reading is wrong, or the joints were turned far between two readings.
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
        // The direction of the sphere's turn is unknown, so its orientation stays. The steer angle
        // is the one that is read now.
        assert!(rotation::angle_between(after.q, before.q) < 1e-12);
        let steering = if stays { core::f64::consts::TAU * 10_000.0 / 16384.0 } else { 0.0 };
        let off = rotation::wrap_angle(after.angle[0] - before.angle[0] - steering);
        assert!(off.abs() < 1e-12, "stays: {stays}, {off}");
        assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
        assert_eq!(bench.run(510).state.mode, Mode::Active);
    }
}
