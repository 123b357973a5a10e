//! Tests of the codec against vectors that were made with independent software, and tests of the
//! bus.

mod axes;
mod wire;

use hbot_config::rig::Protocol as Name;
use hbot_core::MAX_JOINTS;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use serde_json::Value;

use super::message::{Command, Message, Question, decode};
use super::order::Times;
use super::slcan::{Decoder, Word};
use crate::bus::{BusCommand, Expected, Protocol as _};
use crate::line::Line;
use crate::rig::layout::Layout;

/// Returns the vectors called `name` from tests/vendor/odrive.json. The script
/// tests/vendor/make_odrive_vectors.py makes them with cantools, the DBC of firmware 0.6.10, and
/// python-can.
fn vectors(name: &str) -> Vec<Value> {
    let text = include_str!("../../../../../../tests/vendor/odrive.json");
    let all: Value = serde_json::from_str(text).expect("the script writes JSON");
    let rows = all[name].as_array().expect("a list").clone();
    assert!(rows.len() >= 200, "{} vectors of {name}", rows.len());
    rows
}

fn number(value: &Value) -> u32 {
    value.as_u64().expect("a whole number") as u32
}

#[test]
fn commands_are_those_of_cantools_and_python_can() {
    for vector in vectors("commands") {
        let value = number(&vector["value"]);
        let command = match vector["command"].as_str().expect("a name") {
            "InputTorque" => Command::InputTorque(f32::from_bits(value)),
            "AbsolutePosition" => Command::AbsolutePosition(f32::from_bits(value)),
            "AxisState" => Command::AxisState(value as u8),
            "Estop" => Command::Estop,
            "ClearErrors" => Command::ClearErrors,
            "TorqueMode" => Command::TorqueMode,
            "Ask Version" => Command::Ask(Question::Version),
            "Ask Error" => Command::Ask(Question::Errors),
            "Ask Iq" => Command::Ask(Question::Current),
            "Ask Temperature" => Command::Ask(Question::Temperature),
            "Ask Bus_Voltage_Current" => Command::Ask(Question::Supply),
            other => panic!("{other}"),
        };
        let mut line = Vec::new();
        command.write(number(&vector["axis"]) as u8, &mut line);
        assert_eq!(
            String::from_utf8(line).expect("text"),
            vector["line"].as_str().expect("text"),
            "{vector}"
        );
    }
}

#[test]
fn messages_say_what_cantools_reads_in_them() {
    for vector in vectors("messages") {
        let says = |name: &str| number(&vector["says"][name]);
        let bytes = ["Major", "Minor", "Variant"].map(|part| format!("Hw_Version_{part}"));
        let firmware = ["Major", "Minor", "Revision"].map(|part| format!("Fw_Version_{part}"));
        let line = vector["line"].as_str().expect("text").as_bytes();
        let mut decoder = Decoder::default();
        let words: Vec<_> = line.iter().filter_map(|byte| decoder.push(*byte)).collect();
        let [Ok(Word::Frame(frame))] = words[..] else { panic!("{words:?} of {vector}") };
        let (axis, message) = decode(&frame).expect("a message");
        assert_eq!(u32::from(axis), number(&vector["axis"]), "{vector}");
        // Floats are compared as bits, because NaN is not equal to itself.
        let (read, expected): (Vec<u32>, Vec<u32>) = match message {
            Message::Heartbeat { error, state, result } => (
                vec![error, state.into(), result.into()],
                ["Axis_Error", "Axis_State", "Procedure_Result"].map(says).to_vec(),
            ),
            Message::Estimates { position, velocity } => (
                vec![position.to_bits(), velocity.to_bits()],
                ["Pos_Estimate", "Vel_Estimate"].map(says).to_vec(),
            ),
            Message::Errors { active, disarm_reason } => {
                (vec![active, disarm_reason], ["Active_Errors", "Disarm_Reason"].map(says).to_vec())
            }
            Message::Current { setpoint, measured } => (
                vec![setpoint.to_bits(), measured.to_bits()],
                ["Iq_Setpoint", "Iq_Measured"].map(says).to_vec(),
            ),
            Message::Temperature { inverter, motor } => (
                vec![inverter.to_bits(), motor.to_bits()],
                ["FET_Temperature", "Motor_Temperature"].map(says).to_vec(),
            ),
            Message::Supply { voltage, current } => (
                vec![voltage.to_bits(), current.to_bits()],
                ["Bus_Voltage", "Bus_Current"].map(says).to_vec(),
            ),
            Message::Version { protocol, hardware, firmware: said } => (
                [&[protocol][..], &hardware, &said].concat().into_iter().map(u32::from).collect(),
                std::iter::once(says("Protocol_Version"))
                    .chain(bytes.iter().chain(&firmware).map(|name| says(name)))
                    .collect(),
            ),
        };
        assert_eq!(read, expected, "{vector}");
    }
}

#[test]
fn a_marked_position_is_none_after_a_restart_within_three_quarters_of_a_turn_of_the_joint() {
    for gear in [0.5, 1.0, 1.5, 3.0, 6.6, 17.0, 100.0] {
        let mark = super::axis::mark(gear);
        let turns = mark / gear;
        assert!((turns - turns.round()).abs() < 1e-12, "{gear}: whole turns of the joint");
        for near in [-0.75, 0.0, 0.75] {
            assert!(!super::axis::may_be_booted(mark + near * gear), "{gear}");
        }
    }
}

/// A line on which every read returns the positions and heartbeats of four axes and two answers of
/// the adapter.
struct Canned {
    bytes: Vec<u8>,
    reads: usize,
}

impl Line for Canned {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.reads += 1;
        let n = self.bytes.len().min(buffer.len());
        buffer[..n].copy_from_slice(&self.bytes[..n]);
        Ok(n)
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }

    fn pause(&mut self) {}
}

/// Returns the axes of the prototype: 0 to 3, of which 1 and 3 have a gear of 17.
fn expected() -> Expected {
    let text = include_str!("../../../../../../rigs/prototype-odrive.toml");
    let rig = hbot_config::RigConfig::from_toml(text, "rigs/prototype-odrive.toml").expect("it is legal");
    Expected::new("test", &rig.rig, &Layout::of(&rig), 0)
}

#[test]
fn a_tick_allocates_nothing() {
    const TICKS: u32 = 500;
    // Positions of 3.25 and 34.5 turns at 0 turns per second. All axes are in closed loop without
    // an error.
    let positions = ["00005040", "00000A42", "00005040", "00000A42"];
    let mut bytes = b"z\rz\r".to_vec();
    for (id, position) in positions.iter().enumerate() {
        bytes.extend(format!("t{:03X}8{position}00000000\r", id << 5 | 9).bytes());
        bytes.extend(format!("t{:03X}80000000008000000\r", id << 5 | 1).bytes());
        // A temperature of 25 degrees, which is asked for in the first tick.
        bytes.extend(format!("t{:03X}80000C8410000C841\r", id << 5 | 0x15).bytes());
    }
    let mut bus = super::Odrive.bus(Box::new(Canned { bytes, reads: 0 }), expected());
    let mut readings = 0;
    let allocated = allocation_counter::measure(|| {
        for tick in 0..TICKS {
            let now_ns = u64::from(tick) * 1_000_000;
            readings += u32::from(bus.receive(now_ns, tick).reading.is_some());
            let command = BusCommand { tick, enable: tick > 100, watchdog_ms: 20, torque: [0.1; MAX_JOINTS] };
            assert!(bus.command(now_ns, &command));
        }
    });
    assert_eq!((allocated.count_total, readings), (0, TICKS - 1));
}

/// At each rate, a time in ticks is at least the time in ms, and less than a tick longer.
#[test]
fn times_are_the_same_at_every_rate() {
    let text = include_str!("../../../../../../rigs/prototype-odrive.toml");
    for rate_hz in [1000, 500, 333, 250] {
        let text = text.replacen("rate_hz = 1000", &format!("rate_hz = {rate_hz}"), 1);
        let rig = hbot_config::RigConfig::from_toml(&text, "x.toml").expect("it is legal");
        let times = Times::new(&Expected::new("test", &rig.rig, &Layout::of(&rig), 0));
        for (ticks, ms) in [(times.off, 20.0), (times.on, 300.0), (times.on_again, 10.0), (times.ask, 50.0)] {
            let longer_ms = f64::from(ticks) * 1000.0 / f64::from(rate_hz) - ms;
            // The period is a whole number of nanoseconds.
            assert!((-1e-3..1000.0 / f64::from(rate_hz)).contains(&longer_ms), "{rate_hz} Hz: {ticks}");
        }
    }
}

/// If a command is cut off and then ended by a carriage return, no simulated ODrive obeys the part
/// that arrived. The test tries every length of the part.
#[test]
fn half_a_command_is_never_obeyed() {
    let rig = hbot_config::RigConfig::prototype().rig;
    let config = SimulatedConfig { line: Name::Odrive.into(), ..SimulatedConfig::new(&rig) };
    let mut rig = SimulatedRig::new(&config).expect("it can be simulated");
    let mut reply = Vec::new();
    rig.receive(0, super::slcan::OPEN, &mut reply);
    let mut command = Vec::new();
    Command::ClearErrors.write(0, &mut command);
    Command::TorqueMode.write(0, &mut command);
    Command::InputTorque(0.5).write(0, &mut command);
    rig.receive(0, &command, &mut reply);
    command.clear();
    Command::AxisState(super::state::CLOSED_LOOP).write(0, &mut command);
    for most in 0..command.len() - 1 {
        let half = [&command[..most], b"\r"].concat();
        rig.receive(0, &half, &mut reply);
        assert_eq!(rig.joint_torque()[0], 0.0, "after {most} bytes of {}", command.escape_ascii());
    }
    rig.receive(0, &command, &mut reply);
    assert!((rig.joint_torque()[0] - 0.5).abs() < 1e-6, "the whole of it is");
}
