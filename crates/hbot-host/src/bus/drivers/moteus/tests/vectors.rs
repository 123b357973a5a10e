//! Compares the codec with vectors that the vendor's own software has made.

use serde_json::Value;

use super::super::codec::{self, Turn};
use super::super::text::{self, Dialect, Said};
use super::said;

/// Returns the test vectors called `name`. The script tests/vendor/make_moteus_vectors.py has
/// written them with the vendor's Python library.
fn vectors(name: &str) -> Vec<Value> {
    let text = include_str!("../../../../../../../tests/vendor/moteus.json");
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

/// Returns the query that a vector's command contains.
fn turn(vector: &Value) -> Turn {
    match vector["turn"].as_str().expect("a turn") {
        "home" => Turn::Home,
        "uptime" => Turn::Uptime,
        "current" => Turn::Current,
        other => panic!("{other}"),
    }
}

#[test]
fn torque_commands_are_those_of_the_vendor_s_encoder() {
    for vector in vectors("torque") {
        let id = vector["id"].as_u64().expect("an id") as u8;
        let [torque, most, watchdog] = ["torque", "most", "watchdog"].map(|key| single(&vector[key]));
        let mut frame = codec::torque_frame(id, torque, most, watchdog, &codec::torque_format());
        codec::state_query(turn(&vector)).serialize(&mut frame);
        assert_eq!(lines(&frame).as_slice(), strings(&vector["lines"]), "{vector}");
    }
}

#[test]
fn stops_are_those_of_the_vendor_s_encoder() {
    for vector in vectors("stop") {
        let id = vector["id"].as_u64().expect("an id") as u8;
        let mut frame = codec::stop_frame(id, single(&vector["watchdog"]));
        if vector["rezero"] == true {
            codec::write_nearest(&mut frame, 0.0);
        }
        codec::state_query(turn(&vector)).serialize(&mut frame);
        assert_eq!(lines(&frame).as_slice(), strings(&vector["lines"]), "{vector}");
    }
}

fn strings(value: &Value) -> Vec<String> {
    value.as_array().expect("a list").iter().map(|line| line.as_str().expect("text").to_owned()).collect()
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
        let words = [state.position, state.velocity, state.torque, state.current];
        let words = words.map(|it| it.map(i64::from));
        assert_eq!(words, ["0x001", "0x002", "0x003", "0x004"].map(raw), "{line}");
        let words = [state.uptime_ms, state.model, state.register_map].map(|it| it.map(i64::from));
        assert_eq!(words, ["0x070", "0x100", "0x102"].map(raw), "{line}");
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
