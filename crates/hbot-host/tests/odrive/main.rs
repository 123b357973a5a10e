//! Tests of the ODrive driver with simulated ODrives, for properties that the conformance suite
//! does not cover.

mod ages;
mod watchdogs;

use std::io;
use std::sync::mpsc::{Sender, channel};

use hbot_config::RigConfig;
use hbot_config::rig::Protocol as Name;
use hbot_core::MAX_JOINTS;
use hbot_host::bus::drivers::odrive::Odrive;
use hbot_host::bus::{BusCommand, Expected, Heard, MotorBus, Protocol, Telemetry};
use hbot_host::line::{Line, Memory, SimulatorCall};
use hbot_host::rig::layout::Layout;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::Link;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

const RIG: &str = include_str!("../../../../rigs/prototype-odrive.toml");
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
    let mut lossy = Lossy { line: lossy.line, loses: first(u32::MAX, "r0408") };
    let silent = &Odrive.scan(&mut lossy, &expected).expect("they are there")[2];
    assert_eq!(silent.firmware, "unknown, CANSimple");
    assert!(silent.remedies[0].what.starts_with("it has not said its firmware"), "{silent:?}");
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
fn a_scan_lists_two_of_one_id_twice_and_foreign_axes_too() {
    let (mut line, _, expected) = line(|rig| {
        rig.controllers_mut().set_id(1, 2);
        rig.controllers_mut().set_id(3, 40);
    });
    let found = Odrive.scan(&mut line, &expected).expect("they answer");
    assert_eq!(found.iter().map(|it| it.id).collect::<Vec<_>>(), [0, 2, 2, 40]);
    // The foreign axis is asked for the same.
    let foreign = &found[3];
    assert_eq!((foreign.firmware.as_str(), foreign.supply_v), ("0.6.10, CANSimple", Some(24.0)));
    assert_eq!((&foreign.model, foreign.remedies.len()), (&found[0].model, 0));
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

/// A line to simulated ODrives on which axis 2 says a position that is not a number.
struct Nowhere(Memory);

impl Line for Nowhere {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.0.read(now_ns, buffer)?;
        for at in 0..n.saturating_sub(12) {
            if buffer[at..n].starts_with(b"t0498") {
                buffer[at + 5..at + 13].copy_from_slice(b"0000C07F");
            }
        }
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(now_ns, bytes)
    }

    fn pause(&mut self) {}
}

#[test]
fn an_axis_whose_position_is_no_number_needs_its_encoder_and_no_firmware() {
    let (line, _calls, expected) = line(|_| ());
    let said = Odrive.meet(&mut Nowhere(line), &expected).expect_err("it is no number").to_string();
    let words = "ODrive 2 (wheel[1].steer): its position is no number: check and calibrate its encoder";
    assert!(said.contains(words), "{said}");
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

fn link(latency_s: f64) -> Option<Link> {
    Some(Link { latency_s, command_latency_s: 0.0, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, seed: 1 })
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
