//! Tests of the ODrive driver with simulated ODrives, for properties that the conformance suite
//! does not cover.

use std::io;
use std::sync::mpsc::{Sender, channel};

use hbot_config::rig::Protocol as Name;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::mode::{Cause, Mode};
use hbot_core::{Controller, MAX_JOINTS};
use hbot_host::bridge::bridge;
use hbot_host::bus::odrive::Odrive;
use hbot_host::bus::{BusCommand, Expected, Heard, MotorBus, Protocol, Telemetry};
use hbot_host::engine::{Engine, Recorder, TickTime};
use hbot_host::layout::Layout;
use hbot_host::line::{Line, Memory, SimulatorCall};
use hbot_host::motors::Motors;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::Link;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

const RIG: &str = include_str!("../../../rigs/prototype-odrive.toml");
const COUNTS: i32 = 1 << 21;

/// Returns a line to simulated ODrives for the rig file of the prototype, the sender of calls to
/// the simulated rig, and the axes that the driver must expect. `change` first alters the simulated
/// rig.
fn line(change: impl FnOnce(&mut SimulatedRig)) -> (Memory, Sender<SimulatorCall>, Expected) {
    let rig = RigConfig::from_toml(RIG, "rigs/prototype-odrive.toml").expect("it is legal");
    let config = SimulatedConfig { line: Name::Odrive.into(), ..SimulatedConfig::new(&rig.rig) };
    let mut simulated = SimulatedRig::new(&config).expect("it can be simulated");
    change(&mut simulated);
    let (calls, inbox) = channel();
    (Memory::new(simulated, inbox), calls, Expected::new("test", &rig.rig, &Layout::of(&rig), 0))
}

/// Returns the message with which bring-up fails after `change` has altered the simulated rig, or
/// "met" if it succeeds.
fn refusal(change: impl FnOnce(&mut SimulatedRig)) -> String {
    let (mut line, _, expected) = line(change);
    Odrive.meet(&mut line, &expected).map_or_else(|error| error.to_string(), |()| "met".to_owned())
}

/// Sets a setting of the simulated axis of `joint`, by the name that the vendor's tools use.
fn set(rig: &mut SimulatedRig, joint: usize, name: &str, value: f64) {
    assert!(rig.controllers_mut().set(joint, name, value), "{name}");
}

#[test]
fn axes_that_may_not_be_asked_for_torque_are_refused_with_the_command_that_mends_it() {
    assert_eq!(refusal(|_| ()), "met");
    for (name, value, words) in [
        ("config.enable_watchdog", 0.0, "odrv0.axis0.config.enable_watchdog = True"),
        ("config.watchdog_timeout", 0.5, "odrv0.axis0.config.watchdog_timeout = 0.02"),
        ("config.can.encoder_msg_rate_ms", 10.0, "odrv0.axis0.config.can.encoder_msg_rate_ms = 1"),
        ("config.can.encoder_msg_rate_ms", 0.0, "odrv0.axis0.config.can.encoder_msg_rate_ms = 1"),
        ("config.can.heartbeat_msg_rate_ms", 100.0, "odrv0.axis0.config.can.heartbeat_msg_rate_ms = 10"),
        ("config.can.encoder_msg_rate_ms", 0.0, "it has said its position 0 times in 150 ms"),
        ("fw_version_minor", 5.0, "odrivetool dfu"),
    ] {
        let said = refusal(|rig| set(rig, 2, name, value));
        assert!(
            said.contains(words) && said.contains("ODrive 2 (wheel[1].steer)"),
            "{name} = {value}: {said}"
        );
    }
    let said = refusal(|rig| rig.inject(InjectedFault::DeafOne { joint: 1, on: true }));
    assert!(said.contains("no answer from ODrive 1 (wheel[0].drive); the ids 0, 2, 3 were heard"), "{said}");
    let said = refusal(|rig| rig.controllers_mut().set_id(1, 2));
    assert!(said.contains("two ODrives have the id 2"), "{said}");
    let (mut line, _, expected) = line(|_| ());
    let said = Odrive.meet(&mut line, &expected.without_last()).expect_err("there are four").to_string();
    assert!(
        said.contains("ODrives of id 3 are on the line and not in the rig file, which has 0, 1, 2"),
        "{said}"
    );
}

/// The longest accepted average time between two positions is 4 ms. In 150 ms, 37 of them arrive.
#[test]
fn positions_that_come_just_often_enough_are_accepted() {
    assert_eq!(refusal(|rig| set(rig, 2, "config.can.encoder_msg_rate_ms", 4.05)), "met");
}

/// Axes whose watchdogs are too short switch their motors off between two commands.
#[test]
fn watchdogs_that_expire_although_they_are_fed_are_refused() {
    for axes in [2..3, 0..4] {
        let first = axes.start;
        let said = refusal(|rig| axes.for_each(|joint| set(rig, joint, "config.watchdog_timeout", 0.001)));
        let words = "its watchdog expires although it is fed every 2 ms";
        assert!(said.contains(words) && said.contains(&format!("ODrive {first} ")), "{said}");
    }
}

/// What the watchdog of firmware 0.6 could do otherwise than that of 0.5.6.
const ONLY_ARMED: &str = "watchdog counts only while armed";
const ONLY_INPUTS: &str = "only Set_Input_* feeds the watchdog";

/// Each axis is accepted, and its firmware says by which proof.
#[test]
fn watchdogs_that_count_only_while_motors_are_on_are_proved_with_motors_on() {
    for (only_armed, only_inputs) in [(false, true), (true, false), (true, true)] {
        let (mut line, _, expected) = line(|rig| {
            for joint in 0..4 {
                // The second axis differs from the others.
                set(rig, joint, ONLY_ARMED, f64::from(only_armed && joint != 1));
                set(rig, joint, ONLY_INPUTS, f64::from(only_inputs));
            }
        });
        for _ in 0..2 {
            Odrive.meet(&mut line, &expected).unwrap_or_else(|e| panic!("{only_armed} {only_inputs}: {e}"));
            for at in 0..4 {
                let proof = if only_armed && at != 1 { "armed at zero torque" } else { "idle" };
                let name = format!("ODrive 0.6.10, watchdog seen to expire {proof}");
                assert_eq!(expected.firmware(at), Some(name), "{only_armed} {only_inputs}");
            }
        }
    }
}

/// The proof with motors on fails like the one with motors off, and leaves the motors off.
#[test]
fn watchdogs_that_do_not_switch_a_motor_off_in_time_are_refused() {
    for (name, value) in [("config.enable_watchdog", 0.0), ("config.watchdog_timeout", 0.5)] {
        let (mut line, calls, expected) = line(|rig| {
            (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0));
            set(rig, 2, name, value);
        });
        let said = Odrive.meet(&mut line, &expected).expect_err("it does not expire").to_string();
        let words = "ODrive 2 (wheel[1].steer): left alone for 140 ms it does not say that its watchdog has expired, \
                     neither idle nor with its motor on at zero torque";
        assert!(said.contains(words) && said.contains("enable_watchdog = True"), "{name}: {said}");
        let (tell, told) = channel();
        let call: SimulatorCall = Box::new(move |rig| tell.send(states(rig)).expect("the test waits"));
        calls.send(call).expect("the line is there");
        let mut buffer = [0; 4096];
        line.read(10_000_000_000, &mut buffer).expect("a line in memory");
        line.write(10_000_000_000, b"\r").expect("a line in memory");
        assert_eq!(told.recv().expect("the states"), "1111", "{name}");
    }
    // An axis that fails does not switch its motor on.
    let said = refusal(|rig| {
        (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0));
        rig.inject(InjectedFault::FailedOne { joint: 3, on: true });
    });
    let words = "ODrive 3 (wheel[1].drive): left alone for 140 ms it does not say that its watchdog has expired, and it \
                 does not switch its motor on to show it at zero torque (errors 0x20)";
    assert!(said.contains(words), "{said}");
}

/// Returns the state of each axis, as a digit.
fn states(rig: &mut SimulatedRig) -> String {
    let mut reply = Vec::new();
    // The heartbeats of the next 100 ms.
    rig.receive(10_100_000_000, b"", &mut reply);
    let text = String::from_utf8(reply).expect("text");
    let state = |id: u32| {
        let start = format!("t{:03X}8", id << 5 | 1);
        let last = text.split('\r').rfind(|line| line.starts_with(&start));
        last.map_or('?', |line| line.as_bytes()[14] as char)
    };
    (0..4).map(state).collect()
}

/// In no proof does a torque other than zero reach the line, and torque mode comes before each motor
/// goes on.
#[test]
fn a_watchdog_is_proved_without_torque() {
    for lost in [None, Some("t04B8"), Some("t04E8")] {
        let (line, _calls, expected) = line(|rig| (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0)));
        let (mut on, mut mode, mut left) = (0, [false; 4], 3);
        let (tell, told) = channel();
        let loses = move |text: &str| {
            let Some(Ok(id)) = text.get(1..4).map(|id| usize::from_str_radix(id, 16)) else { return false };
            let rest = &text[1..];
            let (axis, message) = (id >> 5, id & 0x1f);
            let command = text.starts_with('t');
            if command && message == 0x0e {
                assert_eq!(&rest[4..12], "00000000", "{text}");
            }
            if command && message == 0x0b {
                assert_eq!(&rest[4..20], "0100000001000000", "{text}");
                mode[axis] = true;
            }
            if command && message == 0x07 && &rest[4..6] == "08" {
                assert!(mode[axis], "{text}");
                on += 1;
                tell.send(on).expect("the test waits");
            }
            let hit = lost.is_some_and(|lost| text.starts_with(lost)) && left > 0;
            left -= i32::from(hit);
            hit
        };
        Odrive.meet(&mut Lossy { line, loses }, &expected).unwrap_or_else(|e| panic!("{lost:?}: {e}"));
        assert!(told.try_iter().count() >= 4, "each motor was on");
    }
}

/// The watchdogs expire at 125 ms. The driver clears their errors at 150 ms. For 30 ms more,
/// heartbeats from before then arrive. They prove nothing. After the clearing, the next expired
/// watchdog is reported after more than 125 + 30 ms, which is too late.
#[test]
fn heartbeats_from_before_the_clearing_of_errors_do_not_show_that_a_watchdog_works() {
    let said = refusal(|rig| {
        (0..4).for_each(|joint| set(rig, joint, "config.watchdog_timeout", 0.125));
        rig.set_link(link(0.03));
    });
    let words = "left alone for 140 ms it does not say that its watchdog has expired";
    assert!(said.contains(words), "{said}");
}

/// A line to simulated ODrives that loses some of the commands: those lines of text for which
/// `loses` returns true.
struct Lossy<F> {
    line: Memory,
    loses: F,
}

impl<F: FnMut(&str) -> bool + Send> Line for Lossy<F> {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        self.line.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        let text = std::str::from_utf8(bytes).expect("commands are text");
        let kept: String = text.split_inclusive('\r').filter(|&line| !(self.loses)(line)).collect();
        self.line.write(now_ns, kept.as_bytes())?;
        Ok(bytes.len())
    }

    fn pause(&mut self) {}
}

/// Returns a function that returns true for the first `times` texts that begin with `start`.
fn first(times: u32, start: &'static str) -> impl FnMut(&str) -> bool + Send {
    let mut left = times;
    move |text: &str| {
        let hit = left > 0 && text.starts_with(start);
        left -= u32::from(hit);
        hit
    }
}

/// Axis 2 has the CAN ids 0x40 (version), 0x57 (supply), and 0x59 (setting of the position).
#[test]
fn a_lost_question_is_repeated_and_an_axis_that_takes_no_position_is_refused() {
    let (line, _calls, expected) = line(|_| ());
    let mut lossy = Lossy { line, loses: first(u32::MAX, "t0598") };
    let said = Odrive.meet(&mut lossy, &expected).expect_err("it takes no position").to_string();
    assert!(
        said.contains("ODrive 2 (wheel[1].steer): it does not take a position (Set_Absolute_Position)"),
        "{said}"
    );
    // A question is repeated every 50 ms.
    let mut lossy = Lossy { line: lossy.line, loses: first(6, "r0408") };
    Odrive.meet(&mut lossy, &expected).expect("it answers the seventh question");
    let mut lossy = Lossy { line: lossy.line, loses: first(1, "r0578") };
    let found = Odrive.scan(&mut lossy, &expected).expect("they answer");
    assert_eq!(found.iter().map(|it| it.supply_v).collect::<Vec<_>>(), [Some(24.0); 4]);
}

#[test]
fn axes_that_have_been_met_are_met_again_and_have_not_restarted() {
    let (mut line, calls, expected) = line(|_| ());
    for _ in 0..2 {
        Odrive.meet(&mut line, &expected).expect("they are good");
        assert!(!Odrive.switch_off(&mut line, &expected).expect("they answer"));
    }
    let call: SimulatorCall = Box::new(|rig| rig.inject(InjectedFault::RebootOne(3)));
    calls.send(call).expect("the line is there");
    assert!(Odrive.switch_off(&mut line, &expected).expect("they answer"), "the last has restarted");
}

#[test]
fn a_scan_names_each_wrong_setting_and_its_remedy_and_changes_nothing() {
    let scan = |line: &mut Memory, expected: &Expected| Odrive.scan(line, expected).expect("they answer");
    let (mut line, _, expected) = line(|rig| {
        set(rig, 0, "config.enable_watchdog", 0.0);
        set(rig, 1, "config.can.heartbeat_msg_rate_ms", 100.0);
        set(rig, 3, "config.can.encoder_msg_rate_ms", 10.0);
    });
    for _ in 0..2 {
        let found = scan(&mut line, &expected);
        let remedies: Vec<_> =
            found.iter().map(|it| it.remedies.iter().map(|r| r.command.as_str()).collect()).collect();
        let remedies: Vec<Vec<&str>> = remedies;
        assert_eq!(
            found.iter().map(|it| (it.id, it.supply_v)).collect::<Vec<_>>(),
            (0..4).map(|id| (id, Some(24.0))).collect::<Vec<_>>()
        );
        assert!(
            remedies[0][..] == [remedies[0][0]] && remedies[0][0].contains("enable_watchdog = True"),
            "{remedies:?}"
        );
        assert!(
            remedies[1][..] == [remedies[1][0]] && remedies[1][0].contains("heartbeat_msg_rate_ms = 10"),
            "{remedies:?}"
        );
        assert!(remedies[2].is_empty(), "{remedies:?}");
        assert!(
            remedies[3][..] == [remedies[3][0]] && remedies[3][0].contains("encoder_msg_rate_ms = 1"),
            "{remedies:?}"
        );
    }
}

#[test]
fn a_scan_lists_two_of_one_id_twice_and_strangers_too() {
    let (mut line, _, expected) = line(|rig| {
        rig.controllers_mut().set_id(1, 2);
        rig.controllers_mut().set_id(3, 40);
    });
    let found = Odrive.scan(&mut line, &expected).expect("they answer");
    assert_eq!(found.iter().map(|it| it.id).collect::<Vec<_>>(), [0, 2, 2, 40]);
    // The stranger is asked for the same.
    let stranger = &found[3];
    assert_eq!((stranger.firmware.as_str(), stranger.supply_v), ("0.6.10, CANSimple", Some(24.0)));
    assert_eq!((&stranger.model, stranger.remedies.len()), (&found[0].model, 0));
}

/// A bus whose axes have passed bring-up. It runs in ticks of one millisecond.
struct Bench {
    bus: Box<dyn MotorBus>,
    calls: Sender<SimulatorCall>,
    tick: u32,
    torque: [f64; MAX_JOINTS],
}

impl Bench {
    fn new() -> Self {
        Self::with(|_| ())
    }

    /// Returns a bus of axes that `change` has altered before bring-up.
    fn with(change: impl FnOnce(&mut SimulatedRig)) -> Self {
        let (mut line, calls, expected) = line(change);
        Odrive.meet(&mut line, &expected).expect("they are good");
        let bus = Odrive.bus(Box::new(line), expected);
        Self { bus, calls, tick: 0, torque: [0.0; MAX_JOINTS] }
    }

    /// Runs one tick and returns what the bus has received.
    fn tick(&mut self, enable: bool) -> Heard {
        let now_ns = u64::from(self.tick) * 1_000_000;
        let heard = self.bus.receive(now_ns, self.tick);
        let command = BusCommand { tick: self.tick, enable, watchdog_ms: 20, torque: self.torque };
        assert!(self.bus.command(now_ns, &command));
        self.tick += 1;
        heard
    }

    /// Runs ticks until `right` holds, for at most two seconds. Panics with `what` if it never
    /// does.
    fn until(&mut self, enable: bool, what: &str, right: impl Fn(&Heard) -> bool) -> Heard {
        let mut heard = self.tick(enable);
        for _ in 0..2000 {
            if right(&heard) {
                return heard;
            }
            heard = self.tick(enable);
        }
        panic!("{what}: {heard:?}")
    }

    fn telemetry(&self, at: usize) -> Telemetry {
        self.bus.telemetry(u64::from(self.tick - 1) * 1_000_000, at)
    }

    /// Injects a fault into the simulated rig. It takes effect before the next command is written.
    fn inject(&self, fault: InjectedFault) {
        let call: SimulatorCall = Box::new(move |rig| rig.inject(fault));
        self.calls.send(call).expect("the line is there");
    }
}

/// Returns whether the bus has received a reading, without any complaint or lost zero.
fn good(heard: &Heard) -> bool {
    heard.reading.is_some() && heard.complaints == Default::default() && !heard.zeros_lost
}

/// The simulated axes have 0.05 N m/A. The second and the fourth have a gear of 17.
#[test]
fn each_axis_reports_its_current_its_temperature_and_its_own_complaints() {
    let mut bench = Bench::new();
    bench.torque[..4].copy_from_slice(&[0.02, -0.034, -0.01, 0.017]);
    bench.until(true, "on", good);
    // Eight questions, one every 50 ms.
    for _ in 0..450 {
        bench.tick(true);
    }
    for (at, ampere) in [0.4, -0.04, -0.2, 0.02].into_iter().enumerate() {
        let told = bench.telemetry(at);
        let current = told.current.expect("reported");
        // Rounding of single precision.
        assert!((current - ampere).abs() < 1e-6, "{at}: {told:?}");
        let rest = Telemetry { current: None, ..told };
        assert_eq!(rest, Telemetry { temperature: Some(25.0), ..Telemetry::default() }, "{at}");
    }
    bench.inject(InjectedFault::Hot { joint: 0, on: true });
    bench.inject(InjectedFault::FailedOne { joint: 1, on: true });
    bench.inject(InjectedFault::DeafOne { joint: 2, on: true });
    for _ in 0..450 {
        bench.tick(true);
    }
    let hot = bench.telemetry(0);
    assert!(hot.temperature == Some(155.0) && hot.complaints.overtemperature, "{hot:?}");
    assert!(bench.telemetry(1).complaints.fault && !hot.complaints.fault, "{:?}", bench.telemetry(1));
    let deaf = bench.telemetry(2);
    assert_eq!((deaf.current, deaf.temperature, deaf.silent), (None, None, true));
    bench.inject(InjectedFault::RebootOne(3));
    bench.until(true, "a restart is seen", |heard| heard.zeros_lost);
    assert!(bench.telemetry(3).restarted && !bench.telemetry(0).restarted, "{:?}", bench.telemetry(3));
}

#[test]
fn the_firmware_of_each_axis_is_known_after_bring_up() {
    let (mut line, _, expected) = line(|rig| set(rig, 2, "fw_version_minor", 7.0));
    assert_eq!(expected.firmware(0), None);
    let clone = expected.clone();
    Odrive.meet(&mut line, &expected).expect("they are good");
    let names: Vec<_> = (0..5).map(|at| clone.firmware(at)).collect();
    let named = |name: &str| Some(name.to_owned());
    let new = named("ODrive 0.6.10, watchdog seen to expire idle");
    let other = named("ODrive 0.7.10, watchdog seen to expire idle");
    assert_eq!(names, [new.clone(), new.clone(), other, new, None]);
}

#[test]
fn positions_are_set_back_while_motors_are_off_and_counts_go_on() {
    let mut bench = Bench::new();
    bench.until(true, "on", good);
    let mut before = 0;
    // The first joint turns by 60 turns, a tenth of a turn in each tick. The rates that its axis
    // reports stay 0.
    for k in 1..=600 {
        bench.inject(InjectedFault::Slipped { joint: 0, angle: std::f64::consts::TAU * f64::from(k) / 10.0 });
        let heard = bench.tick(true);
        assert!(!heard.zeros_lost, "{heard:?}");
        if let Some(reading) = heard.reading {
            assert!((reading.joints[0].count - before).abs() <= COUNTS / 5, "{k}");
            before = reading.joints[0].count;
        }
    }
    let turns = |heard: &Heard| f64::from(heard.reading.expect("good").joints[0].count) / f64::from(COUNTS);
    for _ in 0..400 {
        let heard = bench.until(false, "off", good);
        // An f32 of 64 turns has steps of 2^-18 turns.
        assert!((turns(&heard) - 60.0).abs() < 1.0 / f64::from(1 << 18) + 0.2, "{}", turns(&heard));
    }
    // The axis has set its own position near the mark again, so a restart is detected. After it the
    // encoder counts from 0.
    bench.inject(InjectedFault::Slipped { joint: 0, angle: 0.0 });
    bench.inject(InjectedFault::RebootOne(0));
    bench.until(false, "a restart is seen", |heard| heard.zeros_lost);
    let heard = bench.until(false, "it is met again", good);
    assert!(turns(&heard).abs() < 1e-3, "it counts from where it has started: {}", turns(&heard));
}

#[test]
fn one_axis_that_restarts_while_it_pushes_is_a_lost_zero_until_its_watchdog_has_shown_again() {
    let mut bench = Bench::new();
    bench.until(true, "on", good);
    for _ in 0..50 {
        bench.tick(true);
    }
    bench.inject(InjectedFault::RebootOne(2));
    bench.until(true, "a restart is seen", |heard| heard.zeros_lost);
    bench.until(false, "it is met again", good);
    // An axis without a watchdog stays untrusted after a restart.
    let call: SimulatorCall = Box::new(|rig| set(rig, 2, "config.enable_watchdog", 0.0));
    bench.calls.send(call).expect("the line is there");
    bench.inject(InjectedFault::RebootOne(2));
    bench.until(false, "a restart is seen", |heard| heard.zeros_lost);
    for _ in 0..1500 {
        assert!(bench.tick(false).zeros_lost);
    }
}

/// The watchdog of an axis that restarts is proved as it was at bring-up: with the motor on, at zero
/// torque, while the motors are commanded off.
#[test]
fn an_axis_that_restarts_proves_its_watchdog_with_its_motor_on_if_it_did_so_before() {
    let only_armed = |rig: &mut SimulatedRig| (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0));
    let mut bench = Bench::with(only_armed);
    bench.torque[..4].copy_from_slice(&[0.02, -0.034, -0.01, 0.017]);
    bench.until(true, "on", good);
    bench.inject(InjectedFault::RebootOne(2));
    bench.until(true, "a restart is seen", |heard| heard.zeros_lost);
    // As long as the motors are commanded on, this one stays off.
    for _ in 0..500 {
        assert!(bench.tick(true).zeros_lost);
    }
    let (tell, told) = channel();
    let call: SimulatorCall = Box::new(move |rig| tell.send(rig.joint_torque()[2]).expect("heard"));
    bench.calls.send(call).expect("the line is there");
    bench.tick(true);
    assert_eq!(told.recv(), Ok(0.0));
    let mut pushed = 0.0_f64;
    for _ in 0..600 {
        let heard = bench.tick(false);
        assert!(!heard.complaints.disobeyed, "{heard:?}");
        let (tell, told) = channel();
        let call: SimulatorCall = Box::new(move |rig| tell.send(rig.joint_torque()[2]).expect("heard"));
        bench.calls.send(call).expect("the line is there");
        bench.tick(false);
        pushed = pushed.max(told.recv().expect("the torque").abs());
    }
    assert_eq!(pushed, 0.0, "N m, while its watchdog is proved");
    bench.until(false, "it is met again", good);
    // An axis whose watchdog is off stays untrusted, and its motor does not stay on.
    let call: SimulatorCall = Box::new(|rig| set(rig, 2, "config.enable_watchdog", 0.0));
    bench.calls.send(call).expect("the line is there");
    bench.inject(InjectedFault::RebootOne(2));
    bench.until(false, "a restart is seen", |heard| heard.zeros_lost);
    let mut disobeyed = 0;
    for _ in 0..1500 {
        let heard = bench.tick(false);
        assert!(heard.zeros_lost, "{heard:?}");
        disobeyed += u32::from(heard.complaints.disobeyed);
    }
    // Its motor is commanded off when the time is over. The heartbeat that says so comes within 10 ms.
    assert!((1..=12).contains(&disobeyed), "{disobeyed} ms");
}

fn link(latency_s: f64) -> Option<Link> {
    Some(Link { latency_s, command_latency_s: 0.0, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, seed: 1 })
}

/// Whatever the axes send comes 5 ms later every quarter of a second, and commands arrive at once. No
/// message says so, but the answers to questions come late too. The whole loop runs in virtual time.
#[test]
fn answers_that_come_later_and_later_have_their_age_and_end_in_link_lost() {
    let rig = RigConfig::from_toml(RIG, "rigs/prototype-odrive.toml").expect("it is legal");
    let (mut line, calls, expected) = line(|_| ());
    Odrive.meet(&mut line, &expected).expect("they are good");
    let motors = Motors::new(vec![Odrive.bus(Box::new(line), expected)], &Layout::of(&rig), 20);
    let (end, mut service) = bridge().expect("a bridge");
    let scene = Box::new(RunningScene::new().load(SceneFile::default_scene()));
    let (told, heard) = channel();
    let recorder: Recorder = Box::new(move |ticked| {
        let answered = ticked.inputs.feedback.map(|feedback| feedback.sequence);
        told.send(answered.filter(|_| ticked.outputs.state.fresh)).expect("the test waits for it");
    });
    let controller = Controller::new(rig.rig);
    let mut engine = Engine::new(motors, controller, scene, end, Some(recorder)).enabling(true);
    let (mut delay, mut lost, mut right) = (0, None, [0; 5]);
    for tick in 0..3000_u64 {
        if tick >= 1500 && tick.is_multiple_of(250) && lost.is_none() {
            delay += 5;
            let latency_s = f64::from(delay) * 1e-3;
            let call: SimulatorCall = Box::new(move |rig| rig.set_link(link(latency_s)));
            calls.send(call).expect("the line is there");
        }
        let time =
            TickTime { tick, t_ns: tick * 1_000_000, awake_ns: 0, lateness_ns: 0, late: false, skipped: 0 };
        engine.tick(&time);
        let sample = service.try_sample().expect("a sample a tick");
        if sample.state.mode == Mode::Fault {
            lost = lost.or(Some((delay, sample.state.cause)));
        } else if tick > 1400 {
            assert_eq!(sample.state.mode, Mode::Active, "{tick}");
        }
        // A position leaves its axis every millisecond and is read in the first tick after it has
        // arrived. The driver has 150 ms to notice a step.
        let settled = tick > 600 && tick % 250 > 150;
        if let Some(answered) = heard.recv().expect("a tick")
            && settled
            && lost.is_none()
        {
            assert_eq!((tick as u32).wrapping_sub(answered), delay + 1, "in tick {tick}");
            right[delay as usize / 5] += 1;
        }
    }
    assert_eq!(lost, Some((20, Some(Cause::LinkLost))), "20 ticks are legal, and 21 are not");
    assert!(right[..4].iter().all(|count| *count > 90), "readings of the right age: {right:?}");
}

/// A position whose age is not known is no reading. Questions are repeated until one is answered.
#[test]
fn there_is_no_reading_before_the_age_of_positions_is_known() {
    let (mut line, _calls, expected) = line(|_| ());
    Odrive.meet(&mut line, &expected).expect("they are good");
    // The current of axis 3 is message 0x74, its temperature 0x75.
    let mut left = 3;
    let loses = move |text: &str| {
        let hit = text.starts_with("r074") || text.starts_with("r075");
        left -= i32::from(hit && left > 0);
        hit && left > 0
    };
    let mut bus = Odrive.bus(Box::new(Lossy { line, loses }), expected);
    let mut first = None;
    for tick in 0..40 {
        let heard = bus.receive(u64::from(tick) * 1_000_000, tick);
        first = first.or(heard.reading.map(|reading| (tick, tick - reading.answers)));
        let command = BusCommand { tick, enable: false, watchdog_ms: 20, torque: [0.0; MAX_JOINTS] };
        assert!(bus.command(u64::from(tick) * 1_000_000, &command));
    }
    // The questions of ticks 0 and 5 are lost. That of tick 10 asks for the temperature again, so its
    // answer can be that to tick 0.
    assert_eq!(first, Some((11, 11)));
}

#[test]
fn a_silent_axis_ends_readings_and_a_failing_one_is_a_fault() {
    let mut bench = Bench::new();
    bench.until(true, "on", good);
    bench.inject(InjectedFault::DeafOne { joint: 3, on: true });
    bench.tick(true);
    bench.tick(true);
    for _ in 0..100 {
        assert!(bench.tick(true).reading.is_none());
    }
    bench.inject(InjectedFault::DeafOne { joint: 3, on: false });
    bench.until(false, "it is back", |heard| heard.reading.is_some());
    bench.until(false, "its watchdog had expired", good);
    bench.inject(InjectedFault::FailedOne { joint: 1, on: true });
    bench.until(false, "it fails", |heard| heard.complaints.fault);
    bench.inject(InjectedFault::FailedOne { joint: 1, on: false });
    bench.until(false, "its error is cleared while motors are off", good);
}

#[test]
fn a_joint_that_has_turned_so_far_that_its_position_is_coarse_is_a_fault() {
    let mut bench = Bench::new();
    bench.until(true, "on", good);
    let mut far = 0;
    for k in 1..=3000 {
        bench.inject(InjectedFault::Slipped { joint: 0, angle: std::f64::consts::TAU * 0.45 * f64::from(k) });
        far = k;
        if bench.tick(true).complaints.fault {
            break;
        }
    }
    // Above 1024 turns, the steps of an f32 are 2^-13 turns.
    assert!((2270..=2290).contains(&far), "{}", 0.45 * f64::from(far));
    bench.until(false, "set back", good);
}
