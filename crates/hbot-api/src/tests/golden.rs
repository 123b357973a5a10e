//! Every message is encoded to the bytes that an independent encoder made of it.

use super::samples::golden;
use super::{encoded, samples, unframed};
use crate::*;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::str::FromStr;

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn assert_golden<T: serde::Serialize>(message: &T, (line, frame): &(&str, Vec<u8>)) {
    let json = encoded(Encoding::Json, message);
    assert_eq!(String::from_utf8(json).unwrap(), format!("{line}\n"));
    assert_eq!(to_hex(&encoded(Encoding::Msgpack, message)), to_hex(frame), "{line}");
}

#[test]
fn every_op_is_on_the_wire_as_documented() {
    for (request, golden) in samples::requests().iter().zip(golden()) {
        assert_golden(request, &golden);
        assert_eq!(Request::read(Encoding::Json, golden.0.as_bytes()).as_ref(), Ok(request));
        let map = unframed(Encoding::Msgpack, &golden.1);
        assert_eq!(Request::read(Encoding::Msgpack, &map).as_ref(), Ok(request));
    }
}

#[test]
fn every_answer_and_event_is_on_the_wire_as_documented() {
    let messages: Vec<ServerMessage> = samples::answers().into_iter().chain(samples::events()).collect();
    let golden = golden().split_off(samples::requests().len());
    assert_eq!(messages.len(), golden.len());
    for (message, golden) in messages.iter().zip(golden) {
        match message {
            ServerMessage::Response(response) => assert_golden(response, &golden),
            ServerMessage::Event(event) => assert_golden(event, &golden),
        }
        assert_eq!(ServerMessage::read(Encoding::Json, golden.0.as_bytes()).as_ref(), Ok(message));
        let map = unframed(Encoding::Msgpack, &golden.1);
        assert_eq!(ServerMessage::read(Encoding::Msgpack, &map).as_ref(), Ok(message));
    }
}

#[test]
fn the_samples_leave_out_no_op() {
    let sampled: BTreeSet<OpName> = samples::requests().iter().map(|request| request.op.name()).collect();
    assert_eq!(sampled, OpName::ALL.into());
    for request in samples::requests() {
        let line = String::from_utf8(encoded(Encoding::Json, &request)).unwrap();
        assert!(line.contains(&format!("\"op\":\"{}\"", request.op.name())), "{line}");
    }
}

#[test]
fn names_in_text_are_those_on_the_wire() {
    fn check<N: Name + DeserializeOwned + FromStr + Debug>() {
        for name in N::NAMES {
            let value = serde_json::to_value(name).unwrap();
            assert_eq!(value, name.as_str());
            assert_eq!(serde_json::from_value::<N>(value).unwrap(), *name);
            assert_eq!(name.as_str().parse().ok(), Some(*name));
        }
    }
    check::<Mode>();
    check::<Fault>();
    check::<ErrorCode>();
    check::<LeaseCause>();
    check::<Encoding>();
    check::<ClientLostPolicy>();
    check::<OpName>();
    check::<EventName>();
    check::<Stop>();
    check::<ControllerFlag>();
}

#[test]
fn the_name_of_an_event_is_that_on_the_wire() {
    let mut sampled = BTreeSet::new();
    for message in samples::events() {
        let ServerMessage::Event(event) = message else { panic!("event") };
        let name = event.name().expect("a known event");
        assert_eq!(serde_json::to_value(&event).unwrap()["event"], name.as_str());
        sampled.insert(name);
    }
    assert_eq!(sampled, EventName::ALL.into());
}

#[test]
fn the_answer_of_an_older_or_later_server_is_read() {
    let older: StatsOk = serde_json::from_str(r#"{"ticks": 7, "faults": {"slip": 2}}"#).unwrap();
    assert_eq!((older.ticks, older.late_ticks, older.faults.of(Fault::Slip)), (7, 0, 2));
    assert_eq!(older.refused, CountsByName::default());
    let later: StatsOk =
        serde_json::from_str(r#"{"faults": {"eclipse": 1, "slip": 1}, "moons": 4}"#).unwrap();
    assert_eq!(later.faults.total(), 1, "a cause that is not known is passed over");
    let older: InfoOk = serde_json::from_str(r#"{"rig": {"rate_hz": 1000}, "render": null}"#).unwrap();
    assert_eq!((older.rig.rate_hz, older.clock, older.lease), (1000, None, None));
    assert_eq!((older.render, older.capability), (None, None));
}

#[test]
fn every_count_is_told_in_the_order_of_the_documentation() {
    let mut counts = CountsByName::<LeaseCause>::default();
    counts.add(LeaseCause::Stolen);
    counts.add(LeaseCause::Stolen);
    let json = serde_json::to_string(&counts).unwrap();
    assert_eq!(json, r#"{"acquired":0,"released":0,"stolen":2,"disconnected":0}"#);
    assert_eq!((counts.of(LeaseCause::Stolen), counts.total()), (2, 2));
    assert_eq!(serde_json::from_str::<CountsByName<LeaseCause>>(&json).unwrap(), counts);
}

#[test]
fn a_later_server_may_say_more() {
    let line = br#"{"event":"eclipse","depth":1}"#;
    assert_eq!(ServerMessage::read(Encoding::Json, line), Ok(ServerMessage::Event(Event::Unknown)));
    let line = br#"{"event":"dropped","count":1,"total":2,"since":3}"#;
    assert!(matches!(ServerMessage::read(Encoding::Json, line), Ok(ServerMessage::Event(Event::Dropped(_)))));
}

#[test]
fn nothing_that_is_not_finite_is_ever_sent() {
    type Spoil = fn(&mut StateEvent, f64);
    let spoils: [Spoil; 18] = [
        |s, x| s.t = x,
        |s, x| s.q[3] = x,
        |s, x| s.omega[1] = x,
        |s, x| s.reference = Some([1.0, x, 0.0, 0.0]),
        |s, x| s.torque[2] = x,
        |s, x| s.joints[1].angle = x,
        |s, x| s.joints[1].rate = x,
        |s, x| s.joints[3].torque = x,
        |s, x| s.slip = x,
        |s, x| s.scale = x,
        |s, x| s.traction = x,
        |s, x| s.energy = x,
        |s, x| s.timing.lateness_us = x,
        |s, x| s.timing.compute_us = x,
        |s, x| s.timing.link_us = x,
        |s, x| s.timing.age_us = x,
        |s, x| s.timing.lead_us = x,
        |s, x| s.orientation_sigma = Some([0.0, x, 0.0]),
    ];
    for (i, spoil) in spoils.iter().enumerate() {
        for (encoding, value) in Encoding::ALL.into_iter().zip([f64::NAN, f64::NEG_INFINITY]) {
            let mut state = samples::state();
            spoil(&mut state, value);
            let mut out = b"before".to_vec();
            assert!(encoding.encode(&Event::State(state), &mut out).is_err(), "spoil {i}");
            assert_eq!(out, b"before", "spoil {i}");
        }
    }
    for encoding in Encoding::ALL {
        let answer = Response::ok(None, crate::AlignOk { angle: f64::NAN, used: true });
        assert!(encoding.encode(&answer, &mut Vec::new()).is_err(), "{encoding}");
    }
}

#[test]
fn a_token_is_kept_out_of_debug_output() {
    let debug = format!("{:?}", samples::requests());
    assert!(debug.contains("Token(..)") && !debug.contains("s3cret"));
}
