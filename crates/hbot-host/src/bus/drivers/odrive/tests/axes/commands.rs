//! Tests of the commands to one axis. The expected lines of text are written by hand from the
//! vendor's CAN protocol page.

use hbot_core::inputs::Complaints;

use super::super::super::message::{error, state};
use super::{Bench, DRV_FAULT, POSITION};

/// Commands to axis 1. Its state is message 0x27, its control mode 0x2b, its torque 0x2e, and its
/// errors are cleared by 0x38.
const IDLE: &str = "t02780100000000000000";
const CLOSED_LOOP: &str = "t02780800000000000000";
const TORQUE_MODE: &str = "t02B80100000001000000";
const NO_TORQUE: &str = "t02E80000000000000000";
const CLEAR_ERRORS: &str = "t038100";
/// 0.034 N m at a joint behind a gear of 17 is 0.002 N m at the motor: 0x3b03126f as an `f32`.
const TORQUE: &str = "t02E86F12033B00000000";

#[test]
fn motors_are_switched_on_with_mode_torque_and_state_and_the_state_is_repeated_for_0_3_s() {
    let mut bench = Bench::new(17.0);
    assert_eq!(bench.command(true), [TORQUE, TORQUE_MODE]);
    bench.beat(state::IDLE, 0);
    for tick in 1..400_u32 {
        let repeated = tick == 1 || tick.is_multiple_of(10) && tick < 300;
        let right: &[&str] = if repeated { &[TORQUE, TORQUE_MODE, CLOSED_LOOP] } else { &[TORQUE] };
        assert_eq!(bench.command(true), right, "tick {tick}");
    }
}

#[test]
fn a_motor_that_was_on_is_not_switched_on_again_before_motors_are_commanded_off() {
    let mut bench = Bench::new(17.0);
    bench.command(true);
    bench.beat(state::IDLE, 0);
    bench.commands_until(35, true);
    bench.beat(state::CLOSED_LOOP, 0);
    for tick in 35..60 {
        assert_eq!(bench.command(true), [TORQUE], "tick {tick}, on");
    }
    bench.beat(state::IDLE, DRV_FAULT);
    for tick in 60..200 {
        assert_eq!(bench.command(true), [TORQUE], "tick {tick}, failed");
    }
    // Motors are commanded off and on again, before a heartbeat reports that they were off.
    let mut bench = Bench::pushing();
    bench.commands_until(60, true);
    assert_eq!(bench.command(false), [IDLE, NO_TORQUE]);
    assert_eq!(bench.command(true), [TORQUE, TORQUE_MODE]);
    assert_eq!(bench.command(true), [TORQUE, TORQUE_MODE, CLOSED_LOOP]);
    bench.beat(state::IDLE, 0);
    assert_eq!(bench.complaints(), Complaints::default());
    assert!(!bench.axis.is_lost());
}

#[test]
fn motors_are_switched_off_at_once_and_the_state_is_repeated_until_they_are_off() {
    for (since, obeys) in [(7_u32, true), (8, true), (7, false), (8, false)] {
        let mut bench = Bench::pushing();
        bench.commands_until(since, true);
        assert_eq!(bench.command(false), [IDLE, NO_TORQUE], "off in tick {since}");
        if obeys {
            bench.beat(state::IDLE, 0);
        }
        for age in 1..150_u32 {
            // Until the motor is off for certain, both messages take turns. Each feeds the
            // watchdog.
            let certain = obeys && age > 20;
            let right = if certain || !(since + age).is_multiple_of(2) { NO_TORQUE } else { IDLE };
            assert_eq!(bench.command(false), [right], "{age} ticks after tick {since}");
        }
    }
}

#[test]
fn errors_are_cleared_every_tenth_of_a_second_while_motors_are_off() {
    let clears = |bench: &mut Bench, on: bool, ticks: u32| {
        let mut cleared = Vec::new();
        for _ in 0..ticks {
            let tick = bench.tick;
            if bench.command(on).iter().any(|line| line == CLEAR_ERRORS) {
                cleared.push(tick);
            }
        }
        cleared
    };
    let mut bench = Bench::new(1.0);
    assert!(clears(&mut bench, false, 5).is_empty(), "no heartbeat yet");
    bench.beat(state::IDLE, 0);
    assert!(clears(&mut bench, false, 200).is_empty(), "no error");
    bench.beat(state::IDLE, DRV_FAULT);
    assert_eq!(clears(&mut bench, false, 400), [205, 305, 405, 505]);
    bench.beat(state::IDLE, 0);
    assert!(clears(&mut bench, false, 200).is_empty(), "it is gone");
    let mut pushing = Bench::pushing();
    pushing.beat(state::IDLE, DRV_FAULT);
    assert!(clears(&mut pushing, true, 200).is_empty(), "motors are commanded on");
}

/// The mark of a gear of 17 is at 34 turns. Positions up to 12.75 turns from it are near.
#[test]
fn a_position_far_from_the_mark_is_moved_by_whole_turns_of_the_joint_while_the_motor_is_off_and_stands() {
    for (position, velocity, state, moved) in [
        (34.0, 0.0, state::IDLE, None),
        (36.0, 0.0, state::IDLE, None),
        (46.75, 0.0, state::IDLE, None),
        (21.25, 0.0, state::IDLE, None),
        // By 17 turns to 30.
        (47.0, 0.0, state::IDLE, Some("0000F041")),
        // By 51 turns to 36.5.
        (87.5, 0.0, state::IDLE, Some("00001242")),
        // By -51 turns to 37.
        (-14.0, 0.0, state::IDLE, Some("00001442")),
        (87.5, 0.009, state::IDLE, Some("00001242")),
        (87.5, 0.011, state::IDLE, None),
        (87.5, -0.011, state::IDLE, None),
        (87.5, 0.0, state::CLOSED_LOOP, None),
    ] {
        let mut bench = Bench::new(17.0);
        bench.tick = 90;
        bench.beat(state, 0);
        bench.at(position, velocity);
        let lines: Vec<_> = (0..20).flat_map(|_| bench.command(false)).collect();
        let positions: Vec<_> = lines.iter().filter(|line| line.starts_with(POSITION)).collect();
        let right: Vec<_> = moved.iter().map(|number| format!("{POSITION}{number}00000000")).collect();
        assert_eq!(positions, right.iter().collect::<Vec<_>>(), "{position} turns, {velocity} turns/s");
        assert!(!lines.iter().any(|line| line == TORQUE_MODE), "{lines:?}");
    }
}

/// Returns the commands of `ticks` ticks that are not empty, with the number of the tick from the
/// first one.
fn commands(bench: &mut Bench, ticks: u32, on: bool) -> Vec<(u32, Vec<String>)> {
    let all = (0..ticks).map(|tick| (tick, bench.command(on)));
    all.filter(|(_, lines)| !lines.is_empty()).collect()
}

/// An idle axis that has restarted and whose watchdog does not expire.
fn restarted(armed: bool) -> Bench {
    let mut bench = Bench::proved(17.0, armed);
    bench.beat(state::IDLE, 0);
    bench.commands_until(30, false);
    bench.beat(state::UNDEFINED, 0);
    bench.beat(state::IDLE, 0);
    assert!(bench.axis.is_lost());
    bench
}

/// 140 ms without a message are enough for any legal watchdog. An axis whose watchdog expired with
/// its motor off at bring-up is left alone for ever.
#[test]
fn a_motor_goes_on_for_the_proof_of_its_watchdog_only_if_it_did_at_bring_up() {
    assert_eq!(commands(&mut restarted(false), 2000, false), []);
    let mut bench = restarted(true);
    // While the motors are commanded on, this one is only switched off.
    let until_off: Vec<_> = commands(&mut bench, 30, true);
    assert!(until_off.iter().flat_map(|(_, lines)| lines).all(|line| line == IDLE || line == NO_TORQUE));
    assert_eq!(commands(&mut bench, 400, true), []);

    let mut bench = restarted(true);
    let sent = commands(&mut bench, 142 + 25, false);
    let right = |age: u32| {
        let turn = if age.is_multiple_of(2) { NO_TORQUE } else { TORQUE_MODE };
        let also = match age {
            5 => Some(CLEAR_ERRORS),
            10 | 20 => Some(CLOSED_LOOP),
            _ => None,
        };
        (141 + age, std::iter::once(turn).chain(also).map(str::to_owned).collect::<Vec<_>>())
    };
    assert_eq!(sent, (1..=25).map(right).collect::<Vec<_>>());
    // The motor is on. Now the axis is left alone, and its watchdog expires.
    bench.beat(state::CLOSED_LOOP, 0);
    assert_eq!(bench.complaints(), Complaints::default());
    assert_eq!(commands(&mut bench, 60, false), []);
    bench.beat(state::IDLE, error::WATCHDOG_TIMER_EXPIRED);
    assert_eq!(bench.command(false), [NO_TORQUE, CLEAR_ERRORS]);
}

/// A motor that is still on after 140 ms, or that goes off for another reason, is kept off. The
/// axis is not trusted again.
#[test]
fn a_motor_that_its_watchdog_does_not_switch_off_is_kept_off() {
    for other_error in [false, true] {
        let mut bench = restarted(true);
        bench.commands_until(30 + 142 + 15, false);
        bench.beat(state::CLOSED_LOOP, 0);
        if other_error {
            bench.commands_until(30 + 142 + 50, false);
            bench.beat(state::IDLE, DRV_FAULT);
            bench.beat(state::IDLE, 0);
        } else {
            assert_eq!(commands(&mut bench, 140, false), []);
            let sent: Vec<String> = commands(&mut bench, 4, false).into_iter().flat_map(|it| it.1).collect();
            assert!(sent.iter().any(|line| line == IDLE), "{sent:?}");
            bench.beat(state::IDLE, 0);
        }
        // A position away from 0, as after the axis was marked.
        bench.at(60.0, 0.0);
        for _ in 0..1000 {
            let sent = bench.command(false);
            assert!(
                sent.contains(&NO_TORQUE.to_owned()) && !sent.contains(&CLOSED_LOOP.to_owned()),
                "{sent:?}"
            );
            assert!(bench.axis.is_lost());
        }
    }
}
