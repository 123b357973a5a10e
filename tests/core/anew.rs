//! What begins anew after an interruption, and what happens in one tick together with something
//! else.

use crate::prelude::*;
use crate::shaping::{ROUNDING, STEEPEST, WOUND};
use hbot_core::design::rig::{OdometryMethod, PathFit};
use hbot_core::motion::odometry;

/// Estimates that are computed from counts.
const ESTIMATES: [RateEstimate; 4] = [
    RateEstimate::Difference,
    RateEstimate::LowPass { cutoff_hz: 30.0 },
    RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 32 },
    RateEstimate::Kalman { acceleration: 100.0 },
];

fn rig_with(rate: RateEstimate) -> Rig {
    altered(&rig(), |rig| rig.methods.rate = rate)
}

/// Turns the sphere for a tick. The motor controllers report rates of 0.125 rad/s.
fn turn(bench: &mut Bench, omega: Vec3) -> State {
    let mut reading = bench.feedback();
    reading.rates = [0.125; MAX_JOINTS];
    bench.sphere.turn(omega, DT);
    bench.step_with(|inputs| inputs.feedback = Some(reading)).state
}

fn jump(bench: &mut Bench) {
    bench.offset[0] += bench.rig().joints[0].counts_per_turn as i32 * 3 / 5;
}

#[test]
fn the_rate_estimate_that_the_rig_names_is_the_one_used() {
    // In slow motion each estimate smooths the steps of the counts in another way.
    let rates = |rate| {
        let mut bench = Bench::new(rig_with(rate));
        let last = (0..40).map(|_| turn(&mut bench, Vec3::new(0.42, -0.336, 0.448))).last();
        last.unwrap().rate[..4].to_vec()
    };
    assert_eq!(rates(RateEstimate::Controller), [0.125; 4], "those that are reported");
    let all = ESTIMATES.map(rates);
    for (i, estimate) in all.iter().enumerate() {
        let reported = estimate.contains(&0.125);
        assert!(!reported, "{:?}: {estimate:?}", ESTIMATES[i]);
        for other in &all[..i] {
            assert_ne!(estimate, other, "{:?}", ESTIMATES[i]);
        }
    }
    // The difference is counts times the angle of a count, over the time.
    let step = rig().joints[1].radians_per_count() / DT;
    let counts = all[0][1] / step;
    assert!((counts - counts.round()).abs() < 1e-9 && counts.round() != 0.0, "{counts} counts");
}

#[test]
fn after_an_implausible_reading_no_rate_remembers_the_motion_before() {
    // The slow motion is less than a count in a tick. A window that kept it would still fit it.
    for (rate, speed) in ESTIMATES.into_iter().flat_map(|rate| [(rate, 2.0), (rate, 0.02)]) {
        let mut bench = Bench::new(rig_with(rate));
        for _ in 0..100 {
            turn(&mut bench, Vec3::Y * speed);
        }
        jump(&mut bench);
        let state = turn(&mut bench, Vec3::ZERO);
        assert_eq!(state.cause, Some(Cause::ImplausibleFeedback), "{rate:?}");
        for k in 0..50 {
            let rates = turn(&mut bench, Vec3::ZERO).rate;
            assert_eq!(rates, [0.0; MAX_JOINTS], "{rate:?}, {k} ticks after the jump");
        }
    }
}

#[test]
fn after_an_implausible_reading_the_path_begins_anew() {
    for path in [PathFit::Quadratic, PathFit::Cubic] {
        let mut bench = Bench::new(altered(&rig(), |rig| rig.methods.path = path));
        for _ in 0..10 {
            bench.turn(Vec3::new(6.0, -4.0, 5.0));
        }
        jump(&mut bench);
        let from = bench.turn(Vec3::new(1.0, 2.0, -1.5)).state;
        assert_eq!(from.cause, Some(Cause::ImplausibleFeedback));
        assert_straight(&mut bench, &from, path);
    }
}

/// Runs a tick and asserts that the sphere has turned since the state `from` as on a straight path
/// of the joints.
fn assert_straight(bench: &mut Bench, from: &State, path: PathFit) {
    let rig = *bench.rig();
    let now = bench.step().state;
    let th = [from.angle[0], from.angle[2]];
    let delta: Vec<f64> = (0..4).map(|j| rotation::wrap_angle(now.angle[j] - from.angle[j])).collect();
    let straight = odometry::turn(&rig.device, OdometryMethod::Magnus4, &th, &delta);
    let turned = rotation::difference(now.q, from.q);
    assert!(straight.length() > 1e-4, "{straight}");
    // Rounding of angles of up to a turn. A path that remembers the motion before errs by 1e-6 rad.
    assert!((turned - straight).length() < 1e-13, "{path:?}: {turned} against {straight}");
}

#[test]
fn a_gap_of_a_thousand_ticks_moves_ramps_by_ten_at_most() {
    let align = |bench: &mut Bench| {
        let tick = bench.tick - 1;
        let q = rotation::exp(Vec3::Z * 0.3);
        let reply = bench.command(Command::Align { q, weight: 1.0, tick }).reply();
        assert!(matches!(reply, Reply::Aligned { .. }), "{reply:?}");
    };
    for (skipped, ticks) in [(0, 1.0), (4, 5.0), (999, 10.0)] {
        let mut bench = active();
        align(&mut bench);
        let before = bench.step().state.q;
        bench.tick += skipped;
        let after = bench.step().state.q;
        // The correction of the orientation moves at `align_rate`, 0.5 rad/s.
        let moved = rotation::angle_between(after, before);
        assert!((moved - 0.5 * DT * ticks).abs() < 1e-12, "{skipped} ticks skipped: {moved} rad");
    }
}

#[test]
fn a_second_cause_during_an_emergency_stop_is_a_fault() {
    let mut bench = active();
    let hot = Complaints { overtemperature: true, ..Complaints::default() };
    let with = |bench: &mut Bench, complaints, command: Option<Command>| {
        bench
            .step_with(|inputs| {
                inputs.feedback.as_mut().unwrap().complaints = complaints;
                command.into_iter().for_each(|command| inputs.commands.push(command).unwrap());
            })
            .state
    };
    assert_eq!(with(&mut bench, hot, Some(Command::Estop)).mode, Mode::Estop);
    assert_eq!(with(&mut bench, hot, None).mode, Mode::Estop, "the first cause is still there");
    let worse = Complaints { fault: true, ..hot };
    let state = with(&mut bench, worse, None);
    assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::ControllerFault)));
    assert_eq!(state.torque, Vec3::ZERO);
}

#[test]
fn a_reset_without_a_reading_does_not_find_the_cause_gone() {
    let mut bench = active();
    let with = |bench: &mut Bench, complaints: Option<Complaints>| {
        bench
            .step_with(|inputs| {
                match complaints {
                    Some(complaints) => inputs.feedback.as_mut().unwrap().complaints = complaints,
                    None => inputs.feedback = None,
                }
                inputs.commands.push(Command::Reset).unwrap();
            })
            .state
            .mode
    };
    let hot = Complaints { overtemperature: true, ..Complaints::default() };
    for complaints in [Some(hot), None, None, Some(hot), None] {
        assert_eq!(with(&mut bench, complaints), Mode::Fault, "{complaints:?}");
    }
    assert_eq!(with(&mut bench, Some(Complaints::default())), Mode::Idle);
}

#[test]
fn a_reboot_counts_although_the_reading_of_its_tick_complains_of_less() {
    // The reading of the tick says that the motor is too hot and that its watchdog expired.
    let complaints = Complaints { overtemperature: true, watchdog: true, ..Complaints::default() };
    let mut bench = active();
    let state = bench
        .step_with(|inputs| {
            inputs.rebooted = true;
            inputs.feedback.as_mut().unwrap().complaints = complaints;
        })
        .state;
    assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::ControllerFault)));
    // The zeros are no longer known.
    assert_eq!(bench.command(Command::Reset).state.mode, Mode::Unreferenced);
    assert_eq!(bench.step().state.mode, Mode::Unreferenced, "zeros that were assumed are not assumed again");
}

#[test]
fn a_blend_that_begins_when_another_ends_makes_no_step() {
    // The second change comes within the 50 ticks of the first blend, and around its last tick.
    for apart in [5, 20].into_iter().chain(46..=54) {
        let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
        let mut last = bench.step().state.torque;
        // Two blends at once are no steeper than both together.
        let (mut step, mut before) = (0.0_f64, 2.0);
        for k in 0..2 * apart {
            if k % apart == 0 {
                let stiffness = if k == 0 { 3.0 } else { 1.0 };
                bench.scene = spring_scene(2 + k, stiffness, WOUND);
                step += (WOUND * (stiffness - before)).length();
                before = stiffness;
            }
            let torque = bench.step().state.torque;
            assert!(
                (torque - last).length() <= STEEPEST * step + ROUNDING,
                "{apart}, {k}: {last} to {torque}"
            );
            last = torque;
        }
    }
}

#[test]
fn a_blend_that_follows_another_is_as_if_there_had_been_none() {
    // The torques after a change from 3 to 1 N m/rad.
    let change = |bench: &mut Bench| -> Vec<Vec3> {
        bench.scene = spring_scene(9, 1.0, WOUND);
        (0..60).map(|_| bench.step().state.torque).collect()
    };
    let alone = change(&mut Bench::active(rig(), spring_scene(1, 3.0, WOUND)));
    for apart in [52, 60, 500] {
        let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
        bench.scene = spring_scene(2, 3.0, WOUND);
        bench.run(apart);
        for (k, (torque, alone)) in change(&mut bench).iter().zip(&alone).enumerate() {
            assert!((*torque - *alone).length() < ROUNDING, "{apart}, {k}: {torque}, alone {alone}");
        }
    }
}

#[test]
fn a_stream_that_expires_while_the_rig_is_disabled_does_not_come_back() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    assert_eq!(bench.command(stream(Vec3::X * 0.3, 100)).reply(), Reply::Done);
    bench.run(20);
    bench.command(Command::Disable);
    assert_eq!(bench.run(200).state.torque, Vec3::ZERO);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
    for k in 0..600 {
        assert_eq!(bench.step().state.torque, Vec3::ZERO, "{k} ticks after enable");
    }
}
