//! Tests the bus with answers whose bytes are written here, and reads the commands that it writes.

use hbot_config::RigConfig;
use hbot_core::MAX_JOINTS;
use moteus_protocol::CanFdFrame;

use super::super::Moteus;
use super::super::codec::{self, State};
use super::super::text::{Dialect, LONGEST, Said};
use super::{Bench, said};
use crate::bus::{BusCommand, Expected, Heard, MotorBus, Protocol as _};
use crate::rig::layout::Layout;
use crate::tests::scripted::ScriptedLine;

/// Returns the line with which an adapter hands over a frame: its CAN id and its data.
fn rcv(id: u32, data: &[u8]) -> Vec<u8> {
    let mut line = format!("rcv {id:X} ");
    for byte in data {
        line += &format!("{byte:02X}");
    }
    line += " E B F\r\n";
    line.into_bytes()
}

/// What a servo says in an answer.
#[derive(Clone, Copy)]
struct Told {
    /// The CAN id of the answer: the servo's id in bits 8 to 14, and that of the receiver below.
    can_id: u32,
    /// The tick of the command that is answered.
    tick: u32,
    mode: u8,
    position: i32,
    home: u8,
    /// The time since power-on, ms. With `None` the answer has the home state and the temperature
    /// instead.
    uptime_ms: Option<i32>,
}

impl Told {
    /// A servo at its zero that is stopped. It has 25 degrees Celsius and answers this program.
    fn by(id: u32, tick: u32) -> Self {
        Self { can_id: id << 8, tick, mode: 0, position: 0, home: 1, uptime_ms: None }
    }

    /// Returns the data of the answer. The first byte of each part has the number type in bits 2
    /// and 3 and the number of registers below. The number of the first register follows.
    fn data(self) -> Vec<u8> {
        // The mode as int8. Position, velocity and torque as int32.
        let mut data = vec![0x21, 0x00, self.mode, 0x2b, 0x01];
        data.extend(self.position.to_le_bytes());
        data.extend([0; 8]);
        match self.uptime_ms {
            Some(ms) => {
                data.extend([0x29, 0x70]);
                data.extend(ms.to_le_bytes());
            }
            None => data.extend([0x21, 0x0c, self.home, 0x21, 0x0e, 25]),
        }
        // The fault as int8, and the watchdog time as a float.
        data.extend([0x21, 0x0f, 0, 0x2d, 0x27]);
        data.extend(codec::stamp(20, self.tick).to_le_bytes());
        data
    }

    fn line(self) -> Vec<u8> {
        rcv(self.can_id, &self.data())
    }
}

/// The bus of two servos of ids 1 and 2, and the far end of its line.
struct Desk {
    bus: Box<dyn MotorBus>,
    far: ScriptedLine,
}

impl Desk {
    fn new() -> Self {
        let text = include_str!("../../../../../../../rigs/prototype-moteus.toml");
        let rig = RigConfig::from_toml(text, "rigs/prototype-moteus.toml").expect("legal");
        let expected = Expected::new("test", &rig.rig, &Layout::of(&rig), 0).without_last().without_last();
        let far = ScriptedLine::default();
        Self { bus: Moteus.bus(Box::new(far.clone()), expected), far }
    }

    fn hear(&mut self, now_ns: u64, tick: u32, lines: &[Vec<u8>]) -> Heard {
        self.far.end().arrived = lines.concat();
        self.bus.receive(now_ns, tick)
    }

    fn command(&mut self, now_ns: u64, tick: u32, enable: bool) -> Vec<String> {
        let command = BusCommand { tick, enable, watchdog_ms: 20, torque: [0.0; MAX_JOINTS] };
        self.far.end().written.clear();
        assert!(self.bus.command(now_ns, &command));
        let written = String::from_utf8(self.far.end().written.clone());
        written.expect("text").lines().map(str::to_owned).collect()
    }
}

/// A frame of the line is an answer to this program only if a servo of the rig sent it to CAN id 0,
/// without a prefix, and if it repeats the watchdog time of a command of the last 1000 ticks.
#[test]
fn frames_of_other_servos_and_to_other_programs_are_foreign_and_no_answers() {
    const TICK: u32 = 2000;
    let mut desk = Desk::new();
    let foreign = Heard { foreign: 1, ..Heard::default() };
    let heard = desk.hear(0, TICK, &[Told::by(1, TICK).line()]);
    assert_eq!(heard, foreign, "before the first command");
    desk.command(0, TICK, false);
    let good = Told::by(1, TICK);
    let mut without_watchdog = good.data();
    without_watchdog.truncate(without_watchdog.len() - 6);
    let mut of_another_time = without_watchdog.clone();
    of_another_time.extend([0x2d, 0x27]);
    of_another_time.extend(codec::stamp(40, TICK).to_le_bytes());
    for (what, line) in [
        ("a servo that is not in the rig file", Told { can_id: 0x300, ..good }.line()),
        ("an answer to the program with CAN id 5", Told { can_id: 0x105, ..good }.line()),
        ("a frame with a CAN prefix", Told { can_id: 0x1_0100, ..good }.line()),
        ("no watchdog time", rcv(0x100, &without_watchdog)),
        ("a watchdog time of 40 ms", rcv(0x100, &of_another_time)),
        ("1001 ticks old", Told { tick: TICK - 1001, ..good }.line()),
    ] {
        let two = [line.clone(), line];
        assert_eq!(desk.hear(0, TICK + 1, &two), Heard { foreign: 2, ..Heard::default() }, "{what}");
    }
    let heard = desk.hear(0, TICK + 1, &[Told::by(1, TICK - 1000).line(), Told::by(2, TICK).line()]);
    assert_eq!(heard.reading.map(|reading| reading.answers), Some(TICK - 1000));
    assert_eq!(Heard { reading: None, ..heard }, Heard::default());
}

#[test]
fn the_sender_of_a_frame_is_the_servo_that_answers_this_program() {
    for (can_id, sender) in [
        (0x0100, Some(1)),
        (0x8000_0100, Some(1)),
        (0x7f00, Some(127)),
        (0x0105, None),
        (0x0001_0100, None),
        (0x0001_0105, None),
        // A command of the host itself to servo 1, and a frame of nobody.
        (0x8001, None),
        (0x0000, None),
    ] {
        let mut frame = CanFdFrame::new();
        frame.arbitration_id = can_id;
        assert_eq!(codec::sender(&frame), sender, "{can_id:#x}");
    }
}

/// Other programs can ask for registers and number types that this driver never asks for. Their
/// values are skipped with the right length, and are not taken for others.
#[test]
fn registers_and_number_types_that_were_not_asked_for_are_skipped() {
    // The voltage (0x00d) as int16, then the mode as int8.
    let state = codec::state(&[0x25, 0x0d, 0xf0, 0x00, 0x21, 0x00, 10]);
    assert_eq!(state, Some(State { mode: Some(10), ..State::default() }));
    // The watchdog time as int8 and as int32.
    assert_eq!(codec::state(&[0x21, 0x27, 2]), Some(State::default()));
    assert_eq!(codec::state(&[0x29, 0x27, 0x0a, 0xd7, 0xa3, 0x3c]), Some(State::default()));
    // As a float, 0x3ca3d70a is 0.02.
    let state = codec::state(&[0x2d, 0x27, 0x0a, 0xd7, 0xa3, 0x3c]);
    assert_eq!(state, Some(State { watchdog: Some(0.02), ..State::default() }));
    // The version of the register map (0x102), then the d current (0x005).
    let state = codec::state(&[0x29, 0x82, 0x02, 5, 0, 0, 0, 0x29, 0x05, 7, 0, 0, 0]);
    assert_eq!(state, Some(State { register_map: Some(5), ..State::default() }));
}

/// A line with a wrong checksum is damaged on an adapter as well, which sends none.
#[test]
fn lines_that_are_damaged_too_long_or_begin_like_others_are_damaged() {
    let good = "rcv 100 21000A E B F ";
    let sum = |text: &str| {
        text.bytes().fold(0_u8, |crc, byte| {
            (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x97 })
        })
    };
    for dialect in [Dialect::Fdcanusb, Dialect::Uart] {
        let line = format!("{good}*{:02X}", sum(good));
        assert!(matches!(said(&line, dialect), Said::Frame(_)), "{line}");
        // A mode of 10 that has become 11, and a checksum with one wrong bit.
        assert_eq!(said(&line.replace("0A", "0B"), dialect), Said::Damaged);
        assert_eq!(said(&format!("{good}*{:02X}", sum(good) ^ 0x10), dialect), Said::Damaged);
    }
    // The checksums are those of the text up to the `*`.
    for (line, dialect, content) in [
        ("OK", Dialect::Fdcanusb, Said::Taken),
        ("OK *BD", Dialect::Uart, Said::Taken),
        ("OKAY", Dialect::Fdcanusb, Said::Damaged),
        ("OKAY *B4", Dialect::Uart, Said::Damaged),
        ("OKrcv 100 21000A E B F", Dialect::Fdcanusb, Said::Damaged),
        ("ERR unknown command", Dialect::Fdcanusb, Said::Refused),
        ("ERR unknown command *D1", Dialect::Uart, Said::Refused),
    ] {
        assert_eq!(said(line, dialect), content, "{line}");
    }
    let longest = format!("ERR {}", "x".repeat(LONGEST - 4));
    assert_eq!(said(&longest, Dialect::Fdcanusb), Said::Refused);
    assert_eq!(said(&format!("{longest}x"), Dialect::Fdcanusb), Said::Damaged);
}

/// Before each answer, the line says that it has accepted the command.
#[test]
fn a_line_in_order_has_neither_damaged_nor_foreign_frames() {
    let mut bench = Bench::new();
    for tick in 1..50 {
        let heard = bench.tick(tick > 20);
        assert_eq!((heard.damaged, heard.foreign), (0, 0), "tick {tick}");
    }
}

/// After a time in which the loop stood still, many bytes wait. The answers behind them are found
/// in the next tick, unless more than four reads of 4096 bytes are waiting.
#[test]
fn what_waits_on_a_line_is_read_in_one_tick() {
    for (before, reads, found) in
        [(0, 1, true), (3000, 1, true), (5000, 2, true), (13_000, 4, true), (17_000, 4, false)]
    {
        let mut desk = Desk::new();
        desk.command(0, 1, false);
        // Ends of empty lines, which say nothing.
        let waiting = [vec![b'\n'; before], Told::by(1, 1).line(), Told::by(2, 1).line()];
        let heard = desk.hear(1_000_000, 2, &waiting);
        assert_eq!(heard.reading.is_some(), found, "{before} bytes before the answers");
        assert_eq!(desk.far.end().reads, reads, "{before} bytes before the answers");
    }
}

/// A servo is asked to subtract whole turns only in every hundredth tick, only while its motor is
/// commanded off and reported as off, and only if it is further than 100 turns from its zero. The
/// request writes the float 0 to register 0x130, since the joint has no gear.
#[test]
fn whole_turns_are_subtracted_from_a_far_position_of_a_motor_that_is_off_and_never_otherwise() {
    const REQUEST: &str = "0DB00200000000";
    const FAR: i32 = 10_100_000;
    for (enable, mode, position, tick, asked) in [
        (false, 0, FAR, 2100, true),
        (false, 0, -FAR, 2100, true),
        (false, 0, 10_000_000, 2100, false),
        (false, 0, 5, 2100, false),
        (false, 0, FAR, 2101, false),
        (false, 10, FAR, 2100, false),
        (false, 11, FAR, 2100, false),
        (true, 0, FAR, 2100, false),
        (true, 10, FAR, 2100, false),
        (true, 10, 5, 2100, false),
        (true, 10, 5, 2101, false),
    ] {
        let mut desk = Desk::new();
        desk.command(0, tick - 1, false);
        let told = Told { mode, position, ..Told::by(1, tick - 1) };
        let heard = desk.hear(0, tick, &[told.line(), Told::by(2, tick - 1).line()]);
        assert!(heard.reading.is_some(), "{heard:?}");
        let lines = desk.command(0, tick, enable);
        let requests: Vec<bool> = lines.iter().map(|line| line.contains(REQUEST)).collect();
        assert_eq!(
            requests,
            [asked, false],
            "on {enable}, mode {mode}, at {position}, tick {tick}: {lines:?}"
        );
    }
}

/// A servo that has lost its zero is met again after 100 answers with its motor off. An answer that
/// comes twice counts once.
#[test]
fn an_answer_that_comes_twice_does_not_count_twice() {
    let mut desk = Desk::new();
    let mut lost = 0;
    for tick in 1..300 {
        desk.command(0, tick, false);
        // In the tenth answer the home state is lower: the servo no longer knows its zero.
        let told = Told { home: u8::from(tick < 10), ..Told::by(1, tick) };
        let lines = [told.line(), Told::by(2, tick).line(), told.line()];
        lost += u32::from(desk.hear(0, tick + 1, &lines).zeros_lost);
    }
    assert_eq!(lost, 100);
}

/// Ticks of a real clock do not begin at whole milliseconds. The time at which a servo got power is
/// still known to a millisecond.
#[test]
fn a_restart_is_seen_and_none_is_imagined_whatever_the_time_of_the_ticks() {
    let mut desk = Desk::new();
    let mut lost = Vec::new();
    for tick in 1..1000 {
        let now_ns = u64::from(tick) * 1_000_000 + u64::from(tick % 7) * 140_000;
        desk.command(now_ns, tick, false);
        // The servos have had power for 5 s, and the second restarts in tick 900.
        let uptime_ms =
            |restarted: bool| Some(if restarted { tick as i32 - 900 } else { tick as i32 + 5000 });
        let one = Told { uptime_ms: uptime_ms(false), ..Told::by(1, tick) };
        let two = Told { uptime_ms: uptime_ms(tick >= 900), ..Told::by(2, tick) };
        let heard = desk.hear(now_ns + 500_000, tick + 1, &[one.line(), two.line()]);
        assert!(heard.reading.is_some(), "{heard:?}");
        if heard.zeros_lost {
            lost.push(tick);
        }
    }
    assert_eq!(lost, (900..1000).collect::<Vec<_>>());
}

/// The line ends its helper process when it learns that the motors are off.
#[test]
fn the_line_learns_that_the_motors_are_off() {
    let mut desk = Desk::new();
    desk.command(0, 1, false);
    assert_eq!(desk.far.end().released, 0);
    desk.bus.release();
    assert_eq!(desk.far.end().released, 1);
}
