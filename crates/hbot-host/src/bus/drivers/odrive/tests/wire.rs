//! Tests of the bus and of bring-up with bytes that are written by hand.

use hbot_config::RigConfig;
use hbot_core::MAX_JOINTS;

use super::super::Odrive;
use super::super::message::{decode, error, state};
use super::super::slcan::Frame;
use super::super::talk::{Met, Talk};
use super::{Canned, expected};
use crate::bus::{BusCommand, BusTraffic, Expected, MotorBus, Protocol as _, Traffic};
use crate::rig::layout::Layout;
use crate::tests::scripted::ScriptedLine;

fn arrives(line: &ScriptedLine, text: &str, times: usize) {
    line.end().arrived.extend(text.repeat(times).bytes());
}

fn bus(line: &ScriptedLine) -> Box<dyn MotorBus> {
    Odrive.bus(Box::new(line.clone()), expected())
}

/// A heartbeat of axis 4, which the rig does not have.
const FOREIGN: &str = "t08180000000001000000\r";
/// A heartbeat of axis 0: idle and without an error.
const HEARTBEAT: &str = "t00180000000001000000\r";

#[test]
fn frames_of_others_are_foreign_and_not_damaged() {
    let wire = ScriptedLine::default();
    let mut bus = bus(&wire);
    arrives(&wire, HEARTBEAT, 1);
    arrives(&wire, FOREIGN, 2);
    // A frame whose id has 29 bits is not from an axis, whatever its id.
    arrives(&wire, "T0000000180000000001000000\r", 1);
    let heard = bus.receive(0, 0);
    assert_eq!((heard.foreign, heard.damaged, heard.zeros_lost), (3, 0, false));
    assert_eq!(bus.receive(0, 0).foreign, 0);
}

/// 13200 bytes are more than three times 4096 bytes, and less than four times.
#[test]
fn a_tick_reads_everything_that_has_arrived_and_reads_a_silent_line_once() {
    let wire = ScriptedLine::default();
    let mut bus = bus(&wire);
    arrives(&wire, FOREIGN, 600);
    assert_eq!((bus.receive(0, 0).foreign, wire.end().reads), (600, 4));
    assert_eq!((bus.receive(0, 1).foreign, wire.end().reads), (0, 5));
}

/// Runs 401 ticks and returns each question with its tick. If `answered` is true, every question is
/// answered before the next tick.
fn questions(answered: bool) -> Vec<(u32, String)> {
    let wire = ScriptedLine::default();
    let mut bus = bus(&wire);
    let mut asked = Vec::new();
    for tick in 0..=400 {
        bus.receive(u64::from(tick) * 1_000_000, tick);
        let command = BusCommand { tick, enable: false, watchdog_ms: 20, torque: [0.0; MAX_JOINTS] };
        assert!(bus.command(u64::from(tick) * 1_000_000, &command));
        let written = String::from_utf8(std::mem::take(&mut wire.end().written)).expect("text");
        for line in written.split('\r').filter(|line| line.starts_with('r')) {
            asked.push((tick, line.to_owned()));
            if answered {
                arrives(&wire, &format!("t{}0000000000000000\r", &line[1..]), 1);
            }
        }
    }
    asked
}

/// Temperatures are message 0x15, currents 0x14.
#[test]
fn every_50_ms_one_axis_is_asked_for_one_value() {
    let first = ["r0158", "r0358", "r0558", "r0758"].map(|line| (0, line));
    let later = ["r0348", "r0548", "r0748", "r0148", "r0358", "r0558", "r0758", "r0158"];
    let right: Vec<_> = first.into_iter().chain((50..).step_by(50).zip(later)).collect();
    let right: Vec<_> = right.into_iter().map(|(tick, line)| (tick, line.to_owned())).collect();
    assert_eq!(questions(true), right);
}

/// Until an axis has answered, the age of its positions is unknown.
#[test]
fn axes_that_do_not_answer_are_asked_every_5_ms_in_turn() {
    let asked = questions(false);
    let ticks: Vec<u32> = asked[4..].iter().map(|(tick, _)| *tick).collect();
    assert_eq!(ticks, (5..=400).step_by(5).collect::<Vec<u32>>());
    let axes: Vec<&str> = asked.iter().map(|(_, line)| &line[..3]).collect();
    for four in axes[4..].chunks_exact(4) {
        let mut four = four.to_vec();
        four.sort_unstable();
        assert_eq!(four, ["r01", "r03", "r05", "r07"]);
    }
}

/// An axis that proves its watchdog has not been told to be idle. A line that takes no more bytes
/// is left to its helper process.
#[test]
fn the_line_learns_that_its_motors_are_off_for_good_when_every_axis_is_told_to_be_idle() {
    for (room, released) in [(None, 1), (Some(20), 0)] {
        let wire = ScriptedLine::default();
        let mut bus = bus(&wire);
        wire.end().room = room;
        bus.release();
        assert_eq!(wire.end().released, released);
        let right = Odrive.off_bytes(&expected());
        assert!(right.starts_with(&wire.end().written), "{:?}", wire.end().written);
    }
}

/// The loop would take them for answers, and old positions for new ones.
#[test]
fn an_axis_that_sends_its_current_or_temperature_unasked_is_named_and_one_that_answers_late_is_not() {
    let remedies = |text: &'static str| {
        let [beats, positions] = reports(state::IDLE, error::WATCHDOG_TIMER_EXPIRED, [0x4040_0000; 4]);
        let versions: String = (0..4).map(|id| format!("t{:03X}80203040500060A00\r", id << 5)).collect();
        let mut line = Canned { bytes: (beats + &positions + &versions + text).into_bytes(), reads: 0 };
        let found = Odrive.scan(&mut line, &expected()).expect("they are there");
        found[0].remedies.iter().map(|remedy| remedy.command.clone()).collect::<Vec<_>>().concat()
    };
    assert!(!remedies("").contains("_msg_rate_ms = 0"));
    assert!(remedies("t01480000000000000000\r").contains("can.iq_msg_rate_ms = 0"));
    assert!(remedies("t01580000C8410000C841\r").contains("can.temperature_msg_rate_ms = 0"));
}

/// A carriage return ends a half line. Message 7 with state 1 switches an axis off.
#[test]
fn the_last_word_ends_a_half_line_and_makes_every_axis_idle() {
    let right =
        "\rt00780100000000000000\rt02780100000000000000\rt04780100000000000000\rt06780100000000000000\r";
    assert_eq!(String::from_utf8(Odrive.off_bytes(&expected())).expect("text"), right);
}

/// A frame takes 22 bytes, 111 to 135 us, and an answer of the adapter of at most 2 bytes. `n` axes
/// get `n + 1` frames and send `2 n + 1` in a tick. In ten ticks, each axis causes 21 frames.
#[test]
fn the_traffic_of_a_tick_is_that_of_its_frames() {
    let traffic = |commands, feedback, least_ns, most_ns| Traffic {
        commands,
        feedback,
        turnaround_us: 0,
        bus: Some(BusTraffic { name: "CAN at 1 Mbit/s", least_ns, most_ns }),
    };
    assert_eq!(Odrive.traffic(2), traffic(67, 116, 466_200, 567_000));
    assert_eq!(Odrive.traffic(4), traffic(111, 208, 932_400, 1_134_000));
}

#[test]
fn a_request_a_long_id_or_another_length_is_no_message() {
    let heartbeat = Frame::new(0x021, &[0; 8]);
    assert!(decode(&heartbeat).is_some());
    assert_eq!(decode(&Frame::request(0x021)), None);
    assert_eq!(decode(&Frame { extended: true, ..heartbeat }), None);
    assert_eq!(decode(&Frame::new(0x021, &[0; 7])), None);
    assert_eq!(decode(&Frame { remote: true, ..Frame::new(0x021, &[]) }), None);
}

#[test]
fn an_axis_is_there_after_any_message() {
    assert!(!Met::default().is_there());
    for heartbeats in [0, 2] {
        for estimates in [0, 2] {
            for answered in [0, 2] {
                let met = Met { heartbeats, estimates, answered, ..Met::default() };
                assert_eq!(met.is_there(), heartbeats + estimates + answered > 0, "{met:?}");
            }
        }
    }
}

/// 200 heartbeats are 4400 bytes, more than eight reads.
#[test]
fn bring_up_reads_everything_that_has_arrived_within_a_millisecond() {
    let (mut wire, expected) = (ScriptedLine::default(), expected());
    arrives(&wire, HEARTBEAT, 200);
    let reads = wire.clone();
    let mut talk = Talk::open(&mut wire, &expected).expect("the line is there");
    talk.listen(1).expect("the line is there");
    assert_eq!((talk.of(0).heartbeats, talk.now_ms, reads.end().reads), (200, 1, 9));
}

/// Switches the motors off on a line on which every millisecond brings `bytes`. Returns whether an
/// axis may have restarted, or the error, and how many milliseconds it took.
fn switched_off(bytes: &str) -> (Result<bool, String>, usize) {
    let mut line = Canned { bytes: bytes.as_bytes().to_vec(), reads: 0 };
    let off = Odrive.switch_off(&mut line, &expected()).map_err(|error| error.to_string());
    (off, line.reads)
}

/// Returns a heartbeat and a position of each of the four axes. `positions` are bits of an `f32`.
fn reports(state: u8, error: u32, positions: [u32; 4]) -> [String; 2] {
    let frame = |id: usize, message: usize, low: u32, high: u32| {
        format!("t{:03X}8{:08X}{:08X}\r", id << 5 | message, low.swap_bytes(), high.swap_bytes())
    };
    let heartbeats = (0..4).map(|id| frame(id, 1, error, u32::from(state))).collect();
    [heartbeats, (0..4).map(|id| frame(id, 9, positions[id], 0)).collect()]
}

/// Motors count as off only if every axis has reported that it is not in closed loop. Its position
/// tells whether it may have restarted.
#[test]
fn motors_count_as_off_only_if_each_axis_has_reported_it() {
    const MARKED: [u32; 4] = [0x4040_0000, 0x4208_0000, 0x4040_0000, 0x4208_0000];
    let silent = "no answer from the motor controllers on test";
    let [off, positions] = reports(state::IDLE, 0, MARKED);
    let [on, _] = reports(state::CLOSED_LOOP, 0, MARKED);
    // The last axis is still on.
    let one_on = off[..66].to_owned() + &on[66..];
    for (bytes, what) in [
        (positions.clone(), "no heartbeats"),
        (off.clone(), "no positions"),
        (on + &positions, "motors are on"),
        (one_on + &positions, "one motor is on"),
        (String::new(), "nothing"),
    ] {
        let (off, ms) = switched_off(&bytes);
        assert!(off.as_ref().is_err_and(|error| error.contains(silent)), "{what}: {off:?}");
        assert_eq!(ms, 1000, "{what}");
    }
    assert_eq!(switched_off(&(off + &positions)), (Ok(false), 1));
    // A position of 0.5 turns, and a firmware that has not started.
    let [off, positions] = reports(state::IDLE, 0, [0x4040_0000, 0x3f00_0000, 0x4040_0000, 0x4208_0000]);
    assert_eq!(switched_off(&(off + &positions)), (Ok(true), 1));
    let starting = reports(state::IDLE, error::INITIALIZING, MARKED).concat();
    assert_eq!(switched_off(&starting), (Ok(true), 1));
}

/// With twelve axes, the last word would exceed 255 bytes.
#[test]
fn twelve_odrives_on_one_line_are_refused_and_eleven_are_not() {
    let rig = RigConfig::prototype().rig;
    for joints in [10, 11, 12, 13] {
        let expected = Expected::new("test", &rig, &Layout::single(0..joints), 0);
        let said =
            Odrive.meet(&mut ScriptedLine::default(), &expected).expect_err("nobody is there").to_string();
        let refused = said.contains("ODrives are too many for one line: at most 11");
        assert_eq!((refused, Odrive.off_bytes(&expected).len() > 255), (joints > 11, joints > 11), "{said}");
    }
}
