//! Tests what the driver makes of the state that a servo reports.

use std::f64::consts::TAU;

use hbot_core::inputs::Complaints;

use super::super::codec::State;
use super::super::servo::{Servo, complaints};
use crate::bus::{ExpectedJoint, Obedience};

fn servo_of_gear(gear: f64) -> Servo {
    Servo::new(&ExpectedJoint { number: 0, id: 1, counts_per_turn: 131_072, gear, peak: 0.93 })
}

/// The state of a servo that is stopped at its zero and has had power for 5 s.
const STOPPED: State = State {
    mode: Some(0),
    position: Some(0),
    velocity: Some(0),
    torque: Some(0),
    current: None,
    home: None,
    voltage: None,
    temperature: None,
    fault: Some(0),
    watchdog: None,
    uptime_ms: Some(5000),
    model: None,
    firmware: None,
    register_map: None,
};

/// Velocities are in steps of 1e-5 turns/s of the motor. The lowest integer is no velocity, and the
/// last one stays.
#[test]
fn a_velocity_is_the_rate_of_the_joint_after_its_gear() {
    for gear in [1.0, 17.0] {
        let mut servo = servo_of_gear(gear);
        for (steps, turns_per_s) in [(100_000, 1.0), (-250_000, -2.5), (i32::MIN, -2.5), (1, 1e-5), (0, 0.0)]
        {
            servo.take(&State { velocity: Some(steps), ..STOPPED }, 1, 0).expect("it is whole");
            let rate = turns_per_s * TAU / gear;
            assert!((servo.reading.rate - rate).abs() < 1e-12, "{steps}: {} rad/s", servo.reading.rate);
        }
    }
}

/// Positions are in steps of 1e-5 turns. The first position is as it is reported, and none is
/// changed by whole turns if this was not asked for.
#[test]
fn a_position_is_counted_from_the_servo_s_zero_however_far_it_jumps() {
    let mut servo = servo_of_gear(17.0);
    // 131072 counts a turn, rounded down.
    for (steps, counts) in [
        (70_000, 91_750),
        (-70_000, -91_751),
        (99_999, 131_070),
        (120_000, 157_286),
        (50_000, 65_536),
        (-2_000_000, -2_621_440),
        (i32::MIN, -2_621_440),
        (0, 0),
    ] {
        servo.take(&State { position: Some(steps), ..STOPPED }, 1, 0).expect("it is whole");
        assert_eq!(servo.reading.count, counts, "{steps} steps");
    }
}

/// Modes 2 to 4 explain for 100 answers in a row that a motor is not on yet. They are no motor that
/// is on against a command.
#[test]
fn a_servo_that_prepares_to_run_its_motor_disobeys_after_a_hundred_answers() {
    for mode in 2..=4 {
        let mut servo = servo_of_gear(1.0);
        let mut obedience = Obedience::default();
        let mut disobeys = |tick: u32, mode: i8, enable: bool| {
            obedience.note(tick, enable);
            let state = State { mode: Some(mode), ..STOPPED };
            let said = complaints(&state, &servo, tick + 1, &obedience);
            servo.take(&state, tick + 1, 0).expect("it is whole");
            assert_eq!(Complaints { disobeyed: false, ..said }, Complaints::default());
            said.disobeyed
        };
        for again in [0, 1000] {
            for tick in 0..150 {
                let disobeyed = disobeys(again + tick, mode, true);
                assert_eq!(disobeyed, tick >= 100, "mode {mode}, tick {tick} of {again}");
            }
            // Position mode, in which the motor is on. Then the motor is commanded off.
            assert!(!disobeys(again + 150, 10, true), "mode {mode}");
            assert!(!disobeys(again + 151, mode, false), "mode {mode} is not on");
            assert!(disobeys(again + 152, 10, false), "on against the command");
        }
    }
}

/// The servo's clock and the host's differ by up to 10 %. The time of power-on follows slowly, so
/// that no restart is seen. A servo that got power more than 500 ms later has restarted.
#[test]
fn clocks_that_drift_apart_are_no_restart_and_half_a_second_is_one() {
    for drift_per_mille in [-100, -1, 0, 1, 100] {
        let mut servo = servo_of_gear(1.0);
        for tick in 0..10_000 {
            let now_ms = 2 * tick;
            let uptime_ms = now_ms + 5000 - now_ms * drift_per_mille / 1000;
            let state = State { uptime_ms: Some(uptime_ms), ..STOPPED };
            servo.take(&state, tick as u32, i64::from(now_ms)).expect("it is whole");
            assert_eq!(servo.lost, 0, "drift {drift_per_mille} per mille, tick {tick}");
        }
    }
    for (later_ms, lost) in [(500, 0), (501, 100)] {
        let mut servo = servo_of_gear(1.0);
        for sent_ms in [0, later_ms] {
            servo.take(&STOPPED, 1, sent_ms).expect("it is whole");
        }
        assert_eq!(servo.lost, lost, "{later_ms} ms later");
    }
    // After 49.7 days with power, the servo's count begins again at 0. That of a servo that
    // restarts earlier does too.
    let days = |days: u32| (days * 86_400_000) as i32;
    for (before, lost) in [(-1, 0), (days(30), 100), (days(49), 100)] {
        let mut servo = servo_of_gear(1.0);
        for (uptime_ms, sent_ms) in [(before, 0), (3, 4)] {
            servo.take(&State { uptime_ms: Some(uptime_ms), ..STOPPED }, 1, sent_ms).expect("it is whole");
        }
        assert_eq!(servo.lost, lost, "{before} ms before");
    }
}

/// A count wraps at 16,384 turns. The lowest integer means that there is no value.
#[test]
fn a_position_too_far_a_value_that_is_missing_and_a_board_too_hot_are_complaints_each_alone() {
    let none = Complaints::default();
    let (fault, not_finite) = (Complaints { fault: true, ..none }, Complaints { not_finite: true, ..none });
    let hot = Complaints { overtemperature: true, ..none };
    let at = |steps| State { position: Some(steps), ..STOPPED };
    let warm = |degrees| State { temperature: Some(degrees), ..STOPPED };
    for (state, wanted) in [
        (STOPPED, none),
        // 16,000 turns.
        (at(1_600_000_000), none),
        (at(-1_600_000_000), none),
        (at(1_600_000_001), fault),
        (at(-1_600_000_001), fault),
        (at(i32::MAX), fault),
        (at(-i32::MAX), fault),
        (at(i32::MIN), not_finite),
        (State { velocity: Some(i32::MIN), ..STOPPED }, not_finite),
        (State { torque: Some(i32::MIN), ..STOPPED }, not_finite),
        (warm(i8::MIN), not_finite),
        (warm(120), none),
        (warm(121), hot),
    ] {
        let said = complaints(&state, &servo_of_gear(1.0), 5, &Obedience::default());
        assert_eq!(said, wanted, "{state:?}");
    }
}
