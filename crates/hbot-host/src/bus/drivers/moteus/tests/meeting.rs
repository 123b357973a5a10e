//! Tests what the driver says to the servos before and after the loop, and what it reads in their
//! answers.

use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use hbot_config::RigConfig;
use hbot_config::rig::Protocol as Name;
use hbot_sim::controller::Line as SimulatedLine;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use rustix::time::{ClockId, clock_gettime};

use super::super::Moteus;
use super::super::codec;
use super::super::talk::{Talk, powered};
use super::super::text::{self, BREAK, Dialect};
use crate::bus::{BusTraffic, Expected, MeetError, Protocol as _, Traffic};
use crate::line::{Line, Memory, SimulatorCall};
use crate::rig::layout::Layout;

/// A line to simulated servos. A test changes the text that comes from them.
struct Changed<F> {
    line: Memory,
    change: F,
    waiting: Vec<u8>,
}

impl<F: FnMut(String) -> String + Send> Line for Changed<F> {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        // What the servos say to one question is less than this.
        let mut said = [0; 4096];
        let n = self.line.read(now_ns, &mut said)?;
        if n > 0 {
            let text = String::from_utf8(said[..n].to_vec()).expect("text");
            self.waiting.extend((self.change)(text).into_bytes());
        }
        let n = self.waiting.len().min(buffer.len());
        buffer[..n].copy_from_slice(&self.waiting[..n]);
        self.waiting.drain(..n);
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        self.line.write(now_ns, bytes)
    }
}

fn rig_file() -> RigConfig {
    let text = include_str!("../../../../../../../rigs/prototype-moteus.toml");
    RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal")
}

fn expected() -> Expected {
    let rig = rig_file();
    Expected::new("a line", &rig.rig, &Layout::of(&rig), 0)
}

fn servos() -> SimulatedRig {
    let line = SimulatedLine { protocol: Name::Moteus, checksums: false };
    let config = SimulatedConfig { line, ..SimulatedConfig::new(&rig_file().rig) };
    SimulatedRig::new(&config).expect("it can be simulated")
}

fn changed<F: FnMut(String) -> String + Send>(rig: SimulatedRig, change: F) -> Changed<F> {
    Changed { line: Memory::new(rig, channel().1), change, waiting: Vec::new() }
}

/// Replaces `from` by `to`, which has the same length, in the lines of one servo that contain its
/// model number. Three int32 from register 0x100 begin with the bytes 2B 80 02.
fn in_identity(text: String, id: u8, from: &str, to: &str) -> String {
    assert_eq!(from.len(), to.len());
    let mine = |line: &str| line.starts_with(&format!("rcv {id}00 ")) && line.contains("2B8002");
    let change = |line: &str| if mine(line) { line.replacen(from, to, 1) } else { line.to_owned() };
    text.split_inclusive('\n').map(change).collect()
}

/// The simulated servos are of model 4 and have the firmware 0x010f. The third and the fourth say
/// otherwise.
#[test]
fn each_servo_is_listed_with_its_own_model_and_firmware() {
    let of_model_and_firmware = "2B8002040000000F010000";
    let mut line = changed(servos(), |text| {
        let text = in_identity(text, 3, of_model_and_firmware, "2B80020201000010010000");
        in_identity(text, 4, of_model_and_firmware, "2B8002000900000F010000")
    });
    let expected = expected();
    Moteus.meet(&mut line, &expected).expect("they are the rig's");
    let firmware: Vec<String> = (0..4).filter_map(|at| expected.firmware(at)).collect();
    let named = |version: &str| format!("moteus {version}, register map 5");
    assert_eq!(firmware, ["0x010f", "0x010f", "0x0110", "0x010f"].map(named));
    let found = Moteus.scan(&mut line, &expected).expect("they answer");
    let models: Vec<&str> = found.iter().map(|it| it.model.as_str()).collect();
    let r4 = "moteus r4 (model 0x0004)";
    let other = "moteus of another family (model 0x0900)";
    assert_eq!(models, [r4, r4, "moteus n1 (model 0x0102)", other]);
}

/// Up to firmware 0x010b the setting of the filter is its natural frequency and not its bandwidth,
/// so the rate is 2.48 times less late.
#[test]
fn the_filter_of_old_firmware_is_set_by_its_natural_frequency() {
    let identity = "2B8002040000000F010000";
    let mut line = changed(servos(), |text| {
        let text = in_identity(text, 2, identity, "2B8002040000000B010000");
        in_identity(text, 3, identity, "2B8002040000000C010000")
    });
    let expected = expected();
    Moteus.meet(&mut line, &expected).expect("they are the rig's");
    for (at, lag) in [(0, 0.003_947_04), (1, 0.001_591_55), (2, 0.003_947_04)] {
        let rate = expected.filtering(at).rate.expect("reported");
        assert!((rate.seconds - lag).abs() < 1e-8 && (rate.hz - 200.0).abs() < 1e-9, "{at}: {rate:?}");
        let torque = expected.filtering(at).torque.expect("reported");
        assert!((torque.seconds - 7.957_75e-4).abs() < 1e-8, "{at}: {torque:?}");
    }
}

/// A servo with other registers, or one that does not say how long it has had power, must not get
/// commands: its restarts would not be seen.
#[test]
fn a_servo_with_another_register_map_or_without_its_time_since_power_on_is_refused() {
    type Change = fn(String) -> String;
    // The time since power-on is one int32 of register 0x070, 5000 ms. The servo refuses to read
    // it.
    let without_uptime: Change = |text| in_identity(text, 2, "297088130000", "317001505050");
    let with_map_4: Change =
        |text| in_identity(text, 2, "2B8002040000000F01000005", "2B8002040000000F01000004");
    let with_map_6: Change =
        |text| in_identity(text, 2, "2B8002040000000F01000005", "2B8002040000000F01000006");
    for (what, remedy, change) in [
        ("it does not report its time since power-on", "update the firmware: ", without_uptime),
        ("its register map is version 4", "update the firmware: ", with_map_4),
        ("its register map is version 6", "flash an older firmware: ", with_map_6),
    ] {
        let mut line = changed(servos(), change);
        let found = Moteus.scan(&mut line, &expected()).expect("they answer");
        let wrong: Vec<(u8, usize)> = found.iter().map(|it| (it.id, it.remedies.len())).collect();
        assert_eq!(wrong, [(1, 0), (2, 1), (3, 0), (4, 0)], "{what}");
        assert!(found[1].remedies[0].command.starts_with(remedy), "{found:?}");
        let refused = Moteus.meet(&mut line, &expected()).expect_err(what).to_string();
        assert!(refused.starts_with(&format!("a line: moteus of id 2: {what}")), "{refused}");
    }
}

/// Both servos answer at once, so that it is not known which of them has a wrong setting.
#[test]
fn two_servos_of_one_id_are_not_asked_for_their_settings() {
    let mut rig = servos();
    let controllers = rig.controllers_mut();
    controllers.set_id(3, 1);
    for joint in [0, 2, 3] {
        assert!(controllers.set(joint, "servo.timeout_mode", 12.0));
    }
    let mut line = changed(rig, |text| text);
    let found = Moteus.scan(&mut line, &expected()).expect("they answer");
    let wrong: Vec<(u8, usize)> = found.iter().map(|it| (it.id, it.remedies.len())).collect();
    assert_eq!(wrong, [(1, 0), (1, 0), (2, 0), (3, 1)]);
}

/// Another program has asked for a setting and has not read the answer. Since then the setting has
/// been changed to one that makes the motor brake.
#[test]
fn an_answer_that_another_program_has_left_in_a_console_is_not_taken_for_ours() {
    let mut rig = servos();
    let question = b"conf get servo.timeout_mode\n";
    let mut frame = codec::frame_to(1, false);
    // Text to the console: its channel 1, the number of bytes, and the bytes.
    frame.data[..3].copy_from_slice(&[0x40, 1, question.len() as u8]);
    frame.data[3..3 + question.len()].copy_from_slice(question);
    frame.size = 3 + question.len() as u8;
    let mut bytes = Vec::new();
    text::push(&mut bytes, &frame, Dialect::Fdcanusb);
    rig.receive(0, &bytes, &mut Vec::new());
    assert!(rig.controllers_mut().set(0, "servo.timeout_mode", 12.0));
    let mut line = changed(rig, |text| text);
    let refused = Moteus.meet(&mut line, &expected()).expect_err("a wrong setting").to_string();
    assert!(refused.contains("moteus of id 1: servo.timeout_mode is 12, must be 0"), "{refused}");
}

/// Frames of a servo that is not in the rig file are on the line beside each answer. This servo has
/// just restarted.
#[test]
fn frames_of_another_servo_are_no_answers_to_a_question() {
    let other = "rcv 900 297000000000 E B F\r\n";
    let mut line = changed(servos(), |text| text + other);
    let expected = expected();
    Moteus.meet(&mut line, &expected).expect("they are the rig's");
    assert!(!Moteus.switch_off(&mut line, &expected).expect("they answer"), "no servo has restarted");
}

fn pushing(rig: &SimulatedRig) -> usize {
    rig.joint_torque().iter().filter(|torque| **torque != 0.0).count()
}

/// Returns four servos whose motors push without a watchdog, as another program has left them.
fn servos_that_push() -> SimulatedRig {
    let mut rig = servos();
    for id in 1..=4 {
        let frame = codec::torque_frame(id, 0.005, 1.0, f32::NAN, &codec::torque_format());
        let mut bytes = Vec::new();
        text::push(&mut bytes, &frame, Dialect::Fdcanusb);
        rig.receive(0, &bytes, &mut Vec::new());
    }
    assert_eq!(pushing(&rig), 4, "{:?}", rig.joint_torque());
    rig
}

/// Returns how many motors of the rig behind `line` give torque. Calls that are sent into `calls`
/// run on this rig.
fn pushing_behind(line: &mut Memory, calls: &Sender<SimulatorCall>) -> usize {
    let (speaker, hears) = channel();
    let ask = move |rig: &mut SimulatedRig| speaker.send(pushing(rig)).expect("somebody waits");
    assert!(calls.send(Box::new(ask)).is_ok(), "the line is there");
    line.write(1_000_000, b"\n").expect("it is in memory");
    hears.recv().expect("it was asked")
}

/// Motors that push when a server starts are off when it has checked the servos: if all is well,
/// and also if a setting is wrong.
#[test]
fn motors_that_another_program_has_left_on_are_switched_off_before_all_else() {
    for wrong_setting in [false, true] {
        let mut rig = servos_that_push();
        assert!(rig.controllers_mut().set(0, "servo.timeout_mode", if wrong_setting { 12.0 } else { 0.0 }));
        let (calls, inbox) = channel();
        let mut line = Memory::new(rig, inbox);
        let met = Moteus.meet(&mut line, &expected());
        assert_eq!(met.is_err(), wrong_setting, "{met:?}");
        assert_eq!(pushing_behind(&mut line, &calls), 0, "wrong setting {wrong_setting}");
    }
}

/// A line that is lost after some writes.
struct Lost {
    line: Memory,
    writes: u32,
}

impl Line for Lost {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.line.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        self.writes = self.writes.checked_sub(1).ok_or(std::io::ErrorKind::BrokenPipe)?;
        self.line.write(now_ns, bytes)
    }
}

/// The driver finds out whether the line has checksums, and then switches all motors off with one
/// command, before it asks any servo. A servo that does not answer keeps no other motor on.
#[test]
fn all_motors_are_off_before_a_servo_is_asked_whether_it_is() {
    let (calls, inbox) = channel();
    let mut line = Lost { line: Memory::new(servos_that_push(), inbox), writes: 2 };
    let off = Moteus.switch_off(&mut line, &expected());
    assert!(matches!(off, Err(MeetError::Line { .. })), "{off:?}");
    assert_eq!(pushing_behind(&mut line.line, &calls), 0);
}

/// A line on which each answer arrives 40 ms after the one before.
struct Slow(Vec<Vec<u8>>);

impl Line for Slow {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        let Some(answer) = self.0.pop() else { return Ok(0) };
        std::thread::sleep(Duration::from_millis(40));
        buffer[..answer.len()].copy_from_slice(&answer);
        Ok(answer.len())
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        // The first question ends an incomplete line, and is refused. The second is for everybody:
        // each servo says its model, its firmware and its register map.
        self.0 = if bytes == BREAK {
            vec![b"ERR unknown command\r\n".to_vec()]
        } else {
            let identity = "2B8002040000000F01000005000000";
            [4, 3, 2, 1].map(|id| format!("rcv {id}00 {identity} E B F\r\n").into_bytes()).to_vec()
        };
        Ok(bytes.len())
    }
}

#[test]
fn servos_are_found_as_long_as_answers_arrive() {
    let (mut line, expected) = (Slow(Vec::new()), expected());
    let mut talk = Talk::open(&mut line, &expected).expect("it answers");
    let ids: Vec<u8> = talk.everybody().expect("it is open").iter().map(|(id, _)| *id).collect();
    assert_eq!(ids, [1, 2, 3, 4]);
}

/// The time of power-on is on the clock that also counts while the machine is suspended.
#[test]
fn the_time_of_power_on_is_the_time_of_the_system_without_that_since_power_on() {
    let clock_ms = || {
        let now = clock_gettime(ClockId::Boottime);
        let since = Duration::new(now.tv_sec as u64, now.tv_nsec as u32);
        since.as_millis() as i64
    };
    // A servo counts to 2^32 ms, so that the sign of the number means nothing.
    for uptime_ms in [0, 1, 5000, i32::MAX, -1] {
        let before = clock_ms();
        let at = powered(uptime_ms) + i64::from(uptime_ms as u32);
        let after = clock_ms();
        assert!((before..=after).contains(&at), "{at} ms, from {before} to {after} ms");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The bytes of the helper process: an end of an incomplete line, and the command that sets the
/// mode (register 0x000) of all servos to 0, without and with a checksum.
#[test]
fn the_last_word_is_off_for_all_servos_in_both_dialects() {
    let bytes = Moteus.off_bytes(&expected());
    let text = "x\ncan send 007f 010000 BF\ncan send 007f 010000 BF *FB\n";
    assert_eq!(String::from_utf8(bytes).expect("text"), text);
}

/// For each servo: a line `can send 8001 DATA BF *00` with 48 bytes of data and its end, which are
/// 9 + 5 + 96 + 3 + 4 + 1 characters. The answers are `OK *00` with its end of two characters, and
/// `rcv 100 DATA E B F *00` with 32 bytes of data and up to 28 other characters.
#[test]
fn the_traffic_of_a_tick_is_that_of_all_servos() {
    // 48 bytes with a long id: 49 bits of 1 us and 389 + 32 bits of 0.2 us. With the most stuff
    // bits 8 and 97 more.
    let command_ns = [49_000 + 84_200, 57_000 + 103_600];
    // 32 bytes with a short id: 30 bits and 261 + 32 bits. With a long id and the most stuff bits
    // 57 bits and 261 + 65 + 32 bits.
    let answer_ns = [30_000 + 58_600, 57_000 + 71_600];
    let [least_ns, most_ns] = [0, 1].map(|at| 4 * (command_ns[at] + answer_ns[at]));
    let bus = BusTraffic { name: "CAN-FD at 1 and 5 Mbit/s", least_ns, most_ns };
    let traffic = Traffic { commands: 4 * 118, feedback: 4 * 100, turnaround_us: 0, bus: Some(bus) };
    assert_eq!(Moteus.traffic(4), traffic);
}
