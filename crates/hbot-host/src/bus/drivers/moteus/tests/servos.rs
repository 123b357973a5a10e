//! Tests the bus with simulated servos that fail, fall silent, restart or turn far.

use std::sync::mpsc::channel;

use hbot_config::RigConfig;
use hbot_core::inputs::Complaints;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::Motor;
use hbot_sim::plant::PlantState;

use super::super::bus::MoteusBus;
use super::super::codec::{self, State, Turn};
use super::super::servo::{Servo, complaints};
use super::super::text::{self, Dialect, Said};
use super::{Bench, said};
use crate::bus::{Expected, ExpectedJoint, Obedience, Telemetry};
use crate::line::Memory;
use crate::rig::attach::simulated_rig;
use crate::rig::layout::Layout;

#[test]
fn one_servo_that_is_mute_is_a_lost_link() {
    let mut bench = Bench::new();
    assert_eq!(bench.ticks(50, true), (Complaints::default(), 49, false));
    bench.post(|rig| rig.inject(InjectedFault::DeafOne { joint: 2, on: true }));
    bench.ticks(2, true);
    assert_eq!(
        bench.ticks(50, true),
        (Complaints::default(), 0, false),
        "three answer, and it is no reading"
    );
    bench.post(|rig| rig.inject(InjectedFault::DeafOne { joint: 2, on: false }));
    let (complaints, readings, _) = bench.ticks(50, true);
    assert!(complaints.watchdog && readings > 45, "its watchdog has expired: {complaints:?} {readings}");
}

#[test]
fn one_servo_s_fault_is_reported_until_a_stop() {
    let mut bench = Bench::new();
    bench.ticks(20, true);
    bench.post(|rig| rig.inject(InjectedFault::FailedOne { joint: 1, on: true }));
    bench.ticks(2, true);
    let (complaints, readings, _) = bench.ticks(20, true);
    assert_eq!((complaints, readings), (Complaints { fault: true, ..Complaints::default() }, 20));
    bench.post(|rig| rig.inject(InjectedFault::FailedOne { joint: 1, on: false }));
    assert!(bench.ticks(5, true).0.fault, "it is latched");
    bench.ticks(2, false);
    assert_eq!(bench.ticks(20, true).0, Complaints::default());
}

#[test]
fn one_servo_that_restarts_has_lost_its_zero_pushing_or_idle() {
    for pushing in [true, false] {
        let mut bench = Bench::new();
        assert!(!bench.ticks(50, pushing).2);
        bench.post(|rig| rig.inject(InjectedFault::RebootOne(3)));
        let (complaints, _, lost) = bench.ticks(3, pushing);
        assert!(lost && complaints.disobeyed == pushing, "pushing {pushing}: {complaints:?}");
        assert!(bench.ticks(90, false).2, "it has not been off for long");
        bench.ticks(20, false);
        assert!(!bench.ticks(20, true).2, "met again");
    }
}

#[test]
fn a_limit_is_no_fault() {
    let mut bench = Bench::new();
    bench.ticks(20, true);
    bench.post(|rig| rig.inject(InjectedFault::Hot { joint: 0, on: true }));
    bench.ticks(2, true);
    let hot = Complaints { overtemperature: true, ..Complaints::default() };
    assert_eq!(bench.ticks(20, true).0, hot);
    let said = bench.ticks(20, false).0;
    assert!(said.overtemperature, "in the answer to the last command with the motor on");
    assert_eq!(bench.ticks(20, false).0, Complaints::default());
}

/// While the motor of a drive joint is off, the motor is turned by 229 turns. The servo subtracts
/// turns from its position, whole ones of the joint, so that a program that is started later reads
/// the joint's angle, and the encoder count continues without a jump.
#[test]
fn turns_are_taken_off_a_far_position_and_the_count_goes_on() {
    let mut bench = Bench::new();
    bench.ticks(5, false);
    let mut last = None;
    for step in 0..540 {
        // The wheel turns once in 40 ticks: 17 turns of the motor, 229.075 turns in all.
        let angle = f64::from(step) * 2.0 * std::f64::consts::PI / 40.0;
        bench.post(move |rig| rig.set_state(PlantState { drive: [angle; 8], ..PlantState::default() }));
        let heard = bench.tick(false);
        let counts = heard.reading.expect("they answer").joints.map(|joint| joint.count);
        if let Some(last) = last.replace(counts) {
            let moved = counts[1].wrapping_sub(last[1]);
            // Each tick adds 17/40 turns of 131072 counts.
            assert!(step < 3 || (moved - 55705).abs() <= 2, "{moved} counts in tick {step}");
        }
    }
    bench.ticks(200, false);
    // The servo's own position must stay within 100 turns.
    let position = asked(&mut bench, 2, false).position.expect("a position");
    assert!(position.abs() < 10_000_000, "{position} steps of 1e-5 turns");
    assert!((22_907_500 - position) % 1_700_000 <= 2, "{position} steps of 1e-5 turns");
}

/// Without whole turns of both, a steer joint's zero would be another one for the next program.
#[test]
fn nothing_is_subtracted_from_a_steer_joint_whose_gear_is_a_fraction() {
    for (number, gear, near) in [(0, 2.5, None), (1, 2.5, Some(0)), (0, 3.0, Some(100_000)), (0, 500.0, None)]
    {
        let mut servo =
            Servo::new(&ExpectedJoint { number, id: 1, counts_per_turn: 131_072, gear, peak: 0.93 });
        servo.position = 12_100_000;
        assert_eq!(servo.set_back(), near, "joint {number}, gear {gear}");
    }
}

/// Lines are met one after the other, so seconds can pass before the first tick.
#[test]
fn a_servo_that_restarts_between_bring_up_and_the_first_tick_has_lost_its_zero() {
    let mut bench = Bench::new();
    bench.post(|rig| rig.inject(InjectedFault::RebootOne(3)));
    assert!(bench.ticks(5, false).2);
}

/// Runs one tick. Returns the state that servo `id` reports if it is queried before this tick's
/// command.
fn asked(bench: &mut Bench, id: u8, enable: bool) -> State {
    let (speaker, hears) = channel();
    let (mut frame, mut question) = (codec::frame_to(id, true), Vec::new());
    codec::state_query(Turn::Home).serialize(&mut frame);
    text::push(&mut question, &frame, Dialect::Uart);
    bench.post(move |rig| {
        let mut reply = Vec::new();
        rig.receive(0, &question, &mut reply);
        speaker.send(String::from_utf8(reply).expect("text")).expect("somebody waits");
    });
    bench.tick(enable);
    let answer = hears.recv().expect("it was asked");
    let line = answer.lines().find(|line| line.starts_with("rcv")).expect("an answer to hand over");
    let Said::Frame(frame) = said(line, Dialect::Uart) else { panic!("{answer}") };
    codec::state(frame.payload()).expect("a legal answer")
}

/// The bench commands 0.02 N m at the third joint, which has no gear, and 0.005 N m at the fourth,
/// which has a gear of 17.
#[test]
fn a_servo_reports_the_torque_that_its_motor_holds() {
    let mut bench = Bench::new();
    bench.ticks(20, true);
    // In steps of 0.001 N m, rounded towards zero.
    assert!(matches!(asked(&mut bench, 3, true).torque, Some(19..=20)));
    assert_eq!(asked(&mut bench, 4, true).torque, Some(0), "0.0003 N m");
    assert_eq!(asked(&mut bench, 2, true).torque, Some(0), "0.0006 N m the other way");
    // A motor that builds up its torque within seconds has given hardly any after milliseconds.
    bench.ticks(5, false);
    let slow = Motor { lag_s: 10.0, ..Motor::default() };
    bench.post(move |rig| rig.controllers_mut().set_motor(Some(slow)));
    bench.ticks(20, true);
    assert_eq!(asked(&mut bench, 3, true).torque, Some(0), "a lag of 10 s");
}

#[test]
fn a_torque_far_beyond_the_largest_command_or_none_at_all_is_a_complaint() {
    let joint = ExpectedJoint { number: 0, id: 1, counts_per_turn: 131_072, gear: 1.0, peak: 0.93 };
    let servo = Servo::new(&joint);
    let of = |torque: i32| {
        let state = State { torque: Some(torque), ..State::default() };
        complaints(&state, &servo, 5, &Obedience::default())
    };
    let too_strong = Complaints { overcurrent: true, ..Complaints::default() };
    // The largest torque of a command is 5 % above the peak, 0.977 N m; 0.5 N m more is too much.
    for (steps, wanted) in [(930, Complaints::default()), (1476, Complaints::default()), (1477, too_strong)] {
        assert_eq!((of(steps), of(-steps)), (wanted, wanted), "{steps} steps of 0.001 N m");
    }
    assert_eq!(of(i32::MIN), Complaints { not_finite: true, ..Complaints::default() });
}

/// Every answer contains the registers of one turn. A servo that gets hot is noticed in the next
/// answer that has its temperature, and stays noticed in the answer without.
#[test]
fn a_temperature_counts_until_the_next_one_is_reported() {
    let joint = ExpectedJoint { number: 0, id: 1, counts_per_turn: 131_072, gear: 1.0, peak: 0.93 };
    let mut servo = Servo::new(&joint);
    let seen = State {
        mode: Some(0),
        position: Some(0),
        velocity: Some(0),
        torque: Some(0),
        fault: Some(0),
        ..State::default()
    };
    let home = |temperature| State { home: Some(1), temperature: Some(temperature), ..seen };
    let uptime = State { uptime_ms: Some(5000), ..seen };
    for (state, tick, hot) in [
        (home(25), 0, false),
        (uptime, 1, false),
        (home(121), 2, true),
        (uptime, 3, true),
        (home(25), 4, false),
    ] {
        let said = complaints(&state, &servo, tick, &Obedience::default());
        assert_eq!(said, Complaints { overtemperature: hot, ..Complaints::default() }, "tick {tick}");
        assert_eq!(servo.take(&state, tick, 1000 + i64::from(tick)), Some(()), "tick {tick}");
    }
    let neither = State { home: Some(1), ..seen };
    assert_eq!(servo.take(&neither, 5, 1005), None, "the registers of no turn");
    assert_eq!(servo.take(&State { torque: None, ..uptime }, 5, 1005), None, "no torque");
}

impl Bench {
    fn telemetry(&self, at: usize) -> Telemetry {
        self.bus.telemetry(u64::from(self.tick - 1) * 1_000_000, at)
    }
}

/// The bench commands torques of 0.01, -0.01, 0.02 and 0.005 N m. The simulated servos have 0.1 N
/// m/A, and the second and the fourth have a gear of 17.
#[test]
fn current_and_temperature_of_each_servo_are_reported_and_no_reading_is_missing_for_it() {
    let mut bench = Bench::new();
    bench.ticks(50, true);
    assert_eq!(bench.telemetry(3).current, None, "it has not been asked yet");
    assert_eq!(bench.ticks(450, true), (Complaints::default(), 450, false));
    let currents: Vec<f32> = (0..4).map(|at| bench.telemetry(at).current.expect("reported")).collect();
    for (current, torque) in currents.iter().zip([0.01, -0.01 / 17.0, 0.02, 0.005 / 17.0]) {
        // A current has steps of 0.001 A and is rounded towards zero.
        assert!((current - torque / 0.1).abs() <= 0.001, "{currents:?}");
    }
    assert!(currents[0] > 0.09 && currents[1] < -0.004, "{currents:?}");
    let temperatures: Vec<_> = (0..5).map(|at| bench.telemetry(at).temperature).collect();
    assert_eq!(temperatures, [Some(25.0), Some(25.0), Some(25.0), Some(25.0), None]);
    bench.ticks(500, false);
    let currents: Vec<_> = (0..4).map(|at| bench.telemetry(at).current).collect();
    assert_eq!(currents, [Some(0.0); 4], "the motors are off");
}

#[test]
fn complaints_and_silence_are_those_of_one_servo() {
    let mut bench = Bench::new();
    bench.ticks(500, true);
    bench.post(|rig| rig.inject(InjectedFault::Hot { joint: 1, on: true }));
    bench.post(|rig| rig.inject(InjectedFault::DeafOne { joint: 2, on: true }));
    bench.post(|rig| rig.inject(InjectedFault::RebootOne(3)));
    bench.ticks(250, true);
    let quiet =
        Telemetry { current: bench.telemetry(0).current, temperature: Some(25.0), ..Telemetry::default() };
    assert!(quiet.current.is_some() && bench.telemetry(0) == quiet, "{:?}", bench.telemetry(0));
    let hot = bench.telemetry(1);
    assert!(hot.complaints.overtemperature && hot.temperature == Some(80.0), "{hot:?}");
    assert_eq!(bench.telemetry(2), Telemetry { silent: true, ..Telemetry::default() });
    assert!(bench.telemetry(3).restarted && !hot.restarted);
}

/// At rates whose period is not a whole number of ms, the queries for a current still take the
/// place of those of even ticks: the time since power-on shows a restart.
#[test]
fn the_time_since_power_on_is_asked_for_in_every_odd_tick_at_each_rate() {
    for rate_hz in [1000, 500, 333, 250, 100] {
        let text = include_str!("../../../../../../../rigs/prototype-moteus.toml");
        let text = text.replacen("rate_hz = 1000", &format!("rate_hz = {rate_hz}"), 1);
        let rig = RigConfig::from_toml(&text, "x.toml").expect("legal");
        let expected = Expected::new("test", &rig.rig, &Layout::of(&rig), 0);
        let line = Memory::new(simulated_rig(&rig, Default::default()).expect("legal"), channel().1);
        let bus = MoteusBus::new(Box::new(line), expected);
        let asked: Vec<(u32, usize)> =
            (0..2 * rate_hz).filter_map(|tick| Some((tick, bus.asked_for_current(tick)?))).collect();
        assert!(asked.iter().all(|(tick, _)| tick % 2 == 0), "{rate_hz} Hz: {asked:?}");
        let servos: Vec<usize> = asked.iter().map(|(_, servo)| *servo).take(8).collect();
        assert_eq!(servos, [0, 1, 2, 3, 0, 1, 2, 3], "{rate_hz} Hz");
        let apart_ms = (asked[1].0 - asked[0].0) * 1000 / rate_hz;
        assert!((100..=120).contains(&apart_ms), "{rate_hz} Hz: {apart_ms} ms apart");
    }
}
