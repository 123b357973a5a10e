//! Compares the driver with vectors from the vendor's own software, and tests what the conformance
//! suite cannot see.

use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use hbot_config::RigConfig;
use hbot_config::rig::Protocol as Name;
use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;
use hbot_sim::controller::{InjectedFault, Line as SimulatedLine};
use hbot_sim::plant::PlantState;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::Value;

use super::text::{self, Dialect, Inbox, Said};
use super::{Moteus, codec};
use crate::attach::simulated_rig;
use crate::bus::{BusCommand, Expected, Heard, MotorBus, Protocol as _};
use crate::layout::Layout;
use crate::line::{Line, Memory, SimulatorCall};

/// Returns the test vectors called `name`. The script tests/vendor/make_moteus_vectors.py has
/// written them with the vendor's Python library.
fn vectors(name: &str) -> Vec<Value> {
    let text = include_str!("../../../../../tests/vendor/moteus.json");
    let all: Value = serde_json::from_str(text).expect("the script writes JSON");
    let rows = all[name].as_array().expect("a list").clone();
    assert!(rows.len() >= 200, "{} vectors of {name}", rows.len());
    rows
}

fn single(value: &Value) -> f32 {
    f32::from_bits(value.as_u64().expect("bits") as u32)
}

/// Returns the line of text that carries a frame, in two forms: for an fdcanusb adapter, and for a
/// servo's UART.
fn lines(frame: &moteus_protocol::CanFdFrame) -> [String; 2] {
    [Dialect::Fdcanusb, Dialect::Uart].map(|dialect| {
        let mut line = Vec::new();
        text::push(&mut line, frame, dialect);
        String::from_utf8(line).expect("text")
    })
}

#[test]
fn torque_commands_are_those_of_the_vendor_s_encoder() {
    for vector in vectors("torque") {
        let id = vector["id"].as_u64().expect("an id") as u8;
        let [torque, most, watchdog] = ["torque", "most", "watchdog"].map(|key| single(&vector[key]));
        let mut frame = codec::torque_frame(id, torque, most, watchdog, &codec::torque_format());
        codec::state_query().serialize(&mut frame);
        assert_eq!(lines(&frame).as_slice(), strings(&vector["lines"]), "{vector}");
    }
}

#[test]
fn stops_are_those_of_the_vendor_s_encoder() {
    for vector in vectors("stop") {
        let id = vector["id"].as_u64().expect("an id") as u8;
        let mut frame = codec::stop_frame(id, single(&vector["watchdog"]));
        if vector["rezero"] == true {
            codec::write_nearest_zero(&mut frame);
        }
        codec::state_query().serialize(&mut frame);
        assert_eq!(lines(&frame).as_slice(), strings(&vector["lines"]), "{vector}");
    }
}

fn strings(value: &Value) -> Vec<String> {
    value.as_array().expect("a list").iter().map(|line| line.as_str().expect("text").to_owned()).collect()
}

/// Gives a line to an [`Inbox`] byte by byte and returns the content that the inbox decodes.
fn said(line: &str, dialect: Dialect) -> Said {
    let mut inbox = Inbox::new(dialect);
    let mut said: Vec<_> = line.bytes().chain(*b"\r\n").filter_map(|byte| inbox.take(byte)).collect();
    assert_eq!(said.len(), 1, "{line}");
    said.remove(0).0
}

#[test]
fn answers_say_what_the_vendor_s_decoder_reads() {
    for vector in vectors("answers") {
        let line = vector["line"].as_str().expect("text");
        let checked = line.contains('*');
        let dialect = if checked { Dialect::Uart } else { Dialect::Fdcanusb };
        let Said::Frame(frame) = said(line, dialect) else { panic!("{line}") };
        assert_eq!(codec::sender(&frame).map(u64::from), vector["id"].as_u64());
        let state = codec::state(frame.payload()).expect(line);
        let raw = |register: &str| vector["registers"][register].as_i64();
        let bytes = [state.mode, state.home, state.temperature, state.fault].map(|it| it.map(i64::from));
        assert_eq!(bytes, ["0x000", "0x00c", "0x00e", "0x00f"].map(raw), "{line}");
        let words = [state.position, state.velocity, state.uptime_ms, state.model, state.register_map];
        let words = words.map(|it| it.map(i64::from));
        assert_eq!(words, ["0x001", "0x002", "0x070", "0x100", "0x102"].map(raw), "{line}");
        assert_eq!(state.watchdog.map(|time| i64::from(time.to_bits())), raw("0x027"));
        // Positions are in steps of 1e-5 turns, and the lowest integer means that there is no
        // value.
        let turns = state.position.filter(|at| *at != i32::MIN).map(|at| f64::from(at) * 1e-5);
        let theirs = vector["turns"].as_f64();
        assert_eq!(turns.is_some(), theirs.is_some(), "{line}");
        assert!(turns.zip(theirs).is_none_or(|(ours, theirs)| (ours - theirs).abs() < 1e-9), "{line}");
        assert_eq!(
            said(line, Dialect::Uart) != Said::Damaged,
            checked,
            "a UART takes no line without a checksum"
        );
        if checked {
            assert_eq!(said(&line.replacen("rcv", "rcw", 1), dialect), Said::Damaged);
        }
    }
}

#[test]
fn the_watchdog_time_carries_the_tick_and_is_hardly_longer() {
    for watchdog_ms in [1, 19, 20, 50, 1000] {
        for tick in [0, 1, 63, 4095, 4096, 1_000_000, u32::MAX] {
            let time = codec::stamp(watchdog_ms, tick);
            let asked = f64::from(watchdog_ms) * 1e-3;
            let longer = f64::from(time) / asked - 1.0;
            // The lowest bits of the requested time itself can differ from zero.
            assert!((-5e-4..5e-4).contains(&longer), "{watchdog_ms} ms became {time} s");
            for late in [0, 1, 100, 4095] {
                let last = tick.wrapping_add(late);
                assert_eq!(codec::stamped(time, watchdog_ms, last), Some(tick), "{late} ticks later");
            }
            // Ticks 4096 apart have equal times. The newer tick is returned, because the bus drops
            // answers that are 4096 ticks old.
            assert_eq!(
                codec::stamped(time, watchdog_ms, tick.wrapping_add(4096)),
                Some(tick.wrapping_add(4096))
            );
        }
        assert_eq!(codec::stamped(0.1, watchdog_ms, 5), None, "the time of another program");
    }
}

#[test]
fn a_malformed_answer_is_none_and_does_not_panic() {
    // The vendor's parser shifts a number too far if it has four bytes.
    for data in [
        &[0x21, 0xff, 0xff, 0xff, 0xff][..],
        &[0x21],
        &[0x20, 0xff, 0x7f, 0x00],
        &[0x2a, 0x01, 1, 2, 3],
        &[0x99],
    ] {
        assert_eq!(codec::state(data), None, "{data:x?}");
    }
    assert_eq!(codec::state(&[]), Some(codec::State::default()));
}

/// A test bench: four simulated servos on a line, and the bus that commands them.
struct Bench {
    bus: Box<dyn MotorBus>,
    calls: Sender<SimulatorCall>,
    tick: u32,
}

/// Returns the prototype's rig with moteus servos, a line to simulated servos, and a channel. A
/// function that is sent into the channel is run on the simulated rig between two ticks.
fn rig_and_line() -> (RigConfig, Memory, Sender<SimulatorCall>) {
    let text = include_str!("../../../../../rigs/prototype-moteus.toml");
    let rig = RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal");
    let simulated = simulated_rig(&rig, Default::default()).expect("it can be simulated");
    let (calls, inbox) = channel();
    (rig, Memory::new(simulated, inbox), calls)
}

impl Bench {
    fn new() -> Self {
        let (rig, mut line, calls) = rig_and_line();
        let expected = Expected::new("sim", &rig.rig, &Layout::of(&rig), 0);
        Moteus.meet(&mut line, &expected).expect("they are the rig's");
        Self { bus: Moteus.bus(Box::new(line), expected), calls, tick: 1 }
    }

    /// Makes the line run `call` on the simulated rig before the next command.
    fn post(&self, call: impl FnOnce(&mut SimulatedRig) + Send + 'static) {
        self.calls.send(Box::new(call)).expect("the line is there");
    }

    fn tick(&mut self, enable: bool) -> Heard {
        let now_ns = u64::from(self.tick) * 1_000_000;
        let heard = self.bus.receive(now_ns, self.tick);
        let mut torque = [0.0; MAX_JOINTS];
        if enable {
            torque[..4].copy_from_slice(&[0.01, -0.01, 0.02, 0.005]);
        }
        self.bus.command(now_ns, &BusCommand { tick: self.tick, enable, watchdog_ms: 20, torque });
        self.tick += 1;
        heard
    }

    /// Runs `n` ticks. Returns the complaints of all ticks combined, the number of readings, and
    /// whether any servo lost its zero.
    fn ticks(&mut self, n: u32, enable: bool) -> (Complaints, u32, bool) {
        (0..n).fold((Complaints::default(), 0, false), |(complaints, readings, lost), _| {
            let heard = self.tick(enable);
            let readings = readings + u32::from(heard.reading.is_some());
            (complaints.or(heard.complaints), readings, lost | heard.zeros_lost)
        })
    }
}

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

/// While the motor of a drive joint is off, the motor is turned by 255 turns. The servo subtracts
/// whole turns from its position, and the encoder count continues without a jump.
#[test]
fn turns_are_taken_off_a_far_position_and_the_count_goes_on() {
    let mut bench = Bench::new();
    bench.ticks(5, false);
    let mut last = None;
    for step in 0..600 {
        // The wheel turns once in 40 ticks: 17 turns of the motor, 255 turns in all.
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
    let (speaker, hears) = channel();
    let (mut frame, mut question) = (codec::frame_to(2, true), Vec::new());
    codec::state_query().serialize(&mut frame);
    text::push(&mut question, &frame, Dialect::Uart);
    bench.post(move |rig| {
        let mut reply = Vec::new();
        rig.receive(0, &question, &mut reply);
        speaker.send(String::from_utf8(reply).expect("text")).expect("somebody waits");
    });
    bench.tick(false);
    let answer = hears.recv().expect("it was asked");
    let line = answer.lines().find(|line| line.starts_with("rcv")).expect("an answer to hand over");
    let Said::Frame(frame) = said(line, Dialect::Uart) else { panic!("{answer}") };
    let position = codec::state(frame.payload()).and_then(|state| state.position).expect("a position");
    assert!(position.abs() < 10_000_000, "{position} steps of 1e-5 turns");
}

/// A line for tests that returns one prepared answer per tick and ignores all written bytes.
struct Canned {
    answers: Vec<Vec<u8>>,
    next: usize,
}

impl Line for Canned {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        // The first read comes before the first command, so there is no answer yet.
        let answer = self.next.checked_sub(1).and_then(|at| self.answers.get(at));
        self.next += 1;
        let answer = answer.map_or(&[][..], |answer| answer);
        buffer[..answer.len()].copy_from_slice(answer);
        Ok(answer.len())
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }
}

/// A line to simulated servos that records the bytes of their answers.
struct Noted(Memory, Arc<Mutex<Vec<Vec<u8>>>>);

impl Line for Noted {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.0.read(now_ns, buffer)?;
        if n > 0 {
            self.1.lock().unwrap_or_else(PoisonError::into_inner).push(buffer[..n].to_vec());
        }
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.write(now_ns, bytes)
    }
}

#[test]
fn a_tick_allocates_nothing() {
    const TICKS: u32 = 200;
    let (rig, mut line, _calls) = rig_and_line();
    let expected = Expected::new("sim", &rig.rig, &Layout::of(&rig), 0);
    Moteus.meet(&mut line, &expected).expect("they are the rig's");
    let noted = Arc::default();
    let bus = Moteus.bus(Box::new(Noted(line, Arc::clone(&noted))), expected.clone());
    let mut bench = Bench { bus, calls: channel().0, tick: 1 };
    assert_eq!(bench.ticks(TICKS, true).1, TICKS - 1);
    let answers = std::mem::take(&mut *noted.lock().unwrap_or_else(PoisonError::into_inner));
    assert_eq!(answers.len() as u32, TICKS - 1);
    bench.bus = Moteus.bus(Box::new(Canned { answers, next: 0 }), expected);
    bench.tick = 1;
    let mut readings = 0;
    let allocated = allocation_counter::measure(|| readings = bench.ticks(TICKS, true).1);
    assert_eq!((allocated.count_total, readings), (0, TICKS - 1));
}

/// A torque command is cut short after any number of bytes, and then ended with
/// [`BREAK`](text::BREAK). The servo refuses it and stays in mode 0. If only an end of line
/// followed, the servo would obey the first part: a mode without torque and gains, which is
/// position mode.
#[test]
fn half_a_command_is_never_obeyed() {
    for (checksums, dialect) in [(false, Dialect::Fdcanusb), (true, Dialect::Uart)] {
        let rig = RigConfig::prototype().rig;
        let line = SimulatedLine { protocol: Name::Moteus, checksums };
        let config = SimulatedConfig { line, ..SimulatedConfig::new(&rig) };
        let mut rig = SimulatedRig::new(&config).expect("it can be simulated");
        let mut frame = codec::torque_frame(1, 0.1, 1.0, 0.02, &codec::torque_format());
        codec::state_query().serialize(&mut frame);
        let mut command = Vec::new();
        text::push(&mut command, &frame, dialect);
        for most in 0..command.len() {
            let mut bytes = command[..most].to_vec();
            bytes.extend_from_slice(text::BREAK);
            let (mut reply, mut query) = (Vec::new(), codec::frame_to(1, true));
            codec::state_query().serialize(&mut query);
            rig.receive(0, &bytes, &mut reply);
            reply.clear();
            let mut question = Vec::new();
            text::push(&mut question, &query, dialect);
            rig.receive(0, &question, &mut reply);
            let reply = String::from_utf8(reply).expect("text");
            let line = reply.lines().find(|line| line.starts_with("rcv")).expect("it answers");
            let Said::Frame(frame) = said(line, dialect) else { panic!("{line}") };
            let mode = codec::state(frame.payload()).and_then(|state| state.mode);
            assert_eq!(mode, Some(0), "after {most} bytes of {}", command.escape_ascii());
        }
    }
}
