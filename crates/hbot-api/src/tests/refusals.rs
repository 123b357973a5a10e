//! Tests of what is refused, and of the error messages.

use super::samples;
use crate::{Encoding, ErrorCode, Id, Op, OpName, Request};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

fn refused(line: &str) -> String {
    let refusal = Request::read(Encoding::Json, line.as_bytes()).expect_err(line);
    assert_eq!(refusal.error.code, ErrorCode::BadRequest, "{line}");
    refusal.error.message
}

fn wrong(op: &str, fields: &str) -> String {
    refused(&format!("{{\"op\":\"{op}\",{fields}}}"))
}

#[test]
fn messages_name_field_and_what_is_legal() {
    let cases = [
        ("subscribe", r#""every":0"#, r#"field "every" is 0; legal: a whole number from 1 to 1000000"#),
        ("subscribe", r#""every":1.5"#, r#"field "every" is 1.5; legal: a whole number"#),
        ("subscribe", r#""every":-1"#, r#"field "every" is -1; legal"#),
        ("subscribe", r#""every":null"#, r#"field "every" is null; legal"#),
        ("subscribe", r#""every":"10""#, r#"field "every" is the text "10"; legal: a whole number"#),
        ("subscribe", r#""evry":1"#, r#"unknown field "evry" of op subscribe; legal: id, op, every"#),
        ("enable", r#""now":true"#, r#"unknown field "now" of op enable; legal: id, op"#),
        ("acquire", r#""steal":1"#, r#"field "steal" is 1; legal: true or false"#),
        ("load_scene", r#""id":1"#, r#"field "scene" is missing; legal: a map"#),
        ("load_scene", r#""scene":7"#, r#"field "scene" is 7; legal: a map"#),
        ("set", r#""stiffness":1"#, r#"field "effect" is missing; legal: text of 1 to 128 bytes"#),
        ("set", r#""effect":"a""#, "op set names no parameter"),
        ("set", r#""effect":"a","kind":"wall""#, r#"field "kind" cannot be set"#),
        (
            "torque",
            r#""torque":[1,2],"valid_ms":1"#,
            r#"field "torque" is a list of 2; legal: a list of 3 numbers"#,
        ),
        (
            "torque",
            r#""torque":[1,"2",3],"valid_ms":1"#,
            r#"field "torque[1]" is the text "2"; legal: a number"#,
        ),
        (
            "torque",
            r#""torque":[1,2,1e7],"valid_ms":1"#,
            r#"field "torque[2]" is 10000000.0; legal: a number from -"#,
        ),
        (
            "torque",
            r#""torque":[1,2,3]"#,
            r#"field "valid_ms" is missing; legal: a whole number from 1 to 1000"#,
        ),
        ("torque", r#""torque": [1,2,NaN],"valid_ms":1"#, r#" in field "torque"; legal: a finite number"#),
        ("set", r#""effect":"a","stiffness":-Infinity"#, r#" in field "stiffness"; legal: a finite number"#),
        ("torque", r#""torque":[1,2,3],"valid_ms":1001"#, r#"field "valid_ms" is 1001; legal"#),
        ("torque", r#""torque":[1,2,3],"valid_ms":0"#, r#"field "valid_ms" is 0; legal"#),
        (
            "torque",
            r#""torque":[1,2,3],"valid_ms":1,"tick":-1"#,
            r#"field "tick" is -1; legal: a whole number from 0"#,
        ),
        (
            "reference",
            r#""effect":"a","q":[0,0,0,0]"#,
            r#"field "q" has norm 0; legal: a list of 4 numbers [w, x, y, z]"#,
        ),
        ("reference", r#""effect":"a","q":[1,0,0]"#, r#"field "q" is a list of 3; legal"#),
        (
            "reference",
            r#""effect":"a","q":[1,0,0,0],"omega":[{},0,0]"#,
            r#"field "omega[0]" is a map; legal"#,
        ),
        ("model", r#""valid_ms":0"#, r#"field "valid_ms" is 0; legal"#),
        ("model", r#""stiffness":-1,"valid_ms":1"#, r#"field "stiffness" is -1; legal: a number from 0"#),
        (
            "model",
            r#""stiffness":[1,2],"valid_ms":1"#,
            r#"field "stiffness" is a list of 2; legal: a number"#,
        ),
        (
            "model",
            r#""damping":"a","valid_ms":1"#,
            r#"field "damping" is the text "a"; legal: a number from 0"#,
        ),
        (
            "model",
            r#""stiffness":[[1,0.5,0],[0.4,1,0],[0,0,1]],"valid_ms":1"#,
            r#"field "stiffness[0][1]" is 0.5, and "stiffness[1][0]" is 0.4; legal: a symmetric matrix"#,
        ),
        (
            "model",
            r#""stiffness":[[1,0,0],[0,-1,0],[0,0,1]],"valid_ms":1"#,
            r#"field "stiffness[1]" is -1; legal: a number from 0"#,
        ),
        ("model", r#""stiffness":[[1,0,0],1,2],"valid_ms":1"#, r#"field "stiffness[1]" is 1; legal: a list"#),
        (
            "model",
            r#""stiffness":1e7,"valid_ms":1"#,
            r#"field "stiffness" is 10000000.0; legal: a number from 0"#,
        ),
        (
            "model",
            r#""planes":[{"normal":[0,0,0],"stiffness":1}],"valid_ms":1"#,
            r#"field "planes[0].normal" has norm 0; legal: a list of 3 numbers whose norm is at least 0.001"#,
        ),
        (
            "model",
            r#""planes":[{"normal":[1,0,0],"stiffnes":1}],"valid_ms":1"#,
            r#"unknown field "planes[0].stiffnes"; legal: normal, offset, stiffness, damping"#,
        ),
        (
            "model",
            r#""planes":[{"normal":[1,0,0]}],"valid_ms":1"#,
            r#"field "planes[0].stiffness" is missing; legal"#,
        ),
        ("model", r#""planes":[1],"valid_ms":1"#, r#"field "planes[0]" is 1; legal: a map"#),
        (
            "model",
            r#""planes":[{},{},{},{},{},{},{},{},{}],"valid_ms":1"#,
            r#"field "planes" is a list of 9; legal: a list of at most 8 maps"#,
        ),
        ("model", r#""pose":[0,0,0,0],"valid_ms":1"#, r#"field "pose" has norm 0"#),
        ("model", r#""blend_ms":201,"valid_ms":1"#, r#"field "blend_ms" is 201; legal"#),
        ("align", r#""q":[1,0,0,0],"weight":-0.1"#, r#"field "weight" is -0.1; legal: a number from 0 to 1"#),
        ("align", r#""q":[1,0,0,0],"weight":1.1"#, r#"field "weight" is 1.1; legal"#),
        ("align", r#""q":[1,0,0,0],"weight":1,"t":-1"#, r#"field "t" is -1; legal: a number from 0"#),
        (
            "align",
            r#""q":[1,0,0,0],"sigma":[0.1,3.2,0.1]"#,
            r#"field "sigma[1]" is 3.2; legal: a number from 0.00001 to 3.14"#,
        ),
        (
            "align",
            r#""q":[1,0,0,0],"sigma":[0.1,0.1,-1]"#,
            r#"field "sigma[2]" is -1; legal: a number from 0.00001 to 3.14"#,
        ),
        ("hello", r#""version":1,"name":"""#, r#"field "name" is the text ""; legal: text of 1 to 64 bytes"#),
        ("hello", r#""version":1,"name":"a\nb""#, r#"field "name" is the text "a\nb"; legal"#),
        ("hello", r#""version":"1","name":"a""#, r#"field "version" is the text "1"; legal: the number 1"#),
        (
            "hello",
            r#""version":1,"name":"a","encoding":"xml""#,
            r#"is the text "xml"; legal: "json" or "msgpack""#,
        ),
        ("hello", r#""version":1,"name":"a","token":12345"#, r#"field "token" is not legal"#),
        ("dance", r#""id":1"#, r#"unknown op "dance"; legal: hello, info, subscribe, unsubscribe, stats"#),
        ("ping", r#""op":"info""#, r#"field "op" is given twice; legal: once"#),
        ("ping", r#""data":1,"data":2"#, r#"field "data" is given twice; legal: once"#),
        ("set", r#""effect":"a","m":{"x":[{"y":1,"y":1}]}"#, r#"field "m.x[0].y" is given twice"#),
    ];
    for (op, fields, message) in cases {
        let found = wrong(op, fields);
        assert!(found.contains(message), "{op} {fields}:\n found {found}\nwanted {message}");
    }
}

#[test]
fn what_is_no_request_is_refused() {
    assert!(refused("{").starts_with("not a JSON object: EOF"));
    assert!(refused("{").ends_with("; a message is one JSON object on one line"));
    assert!(refused("{} {}").starts_with("not a JSON object: trailing"));
    assert!(refused("GET / HTTP/1.1").contains("the port after `web`") && !refused("hello").contains("HTTP"));
    assert!(refused("[1]").starts_with("the message is a list of 1; legal: a map"));
    assert!(refused("{}").starts_with("field \"op\" is missing; legal: hello, info"));
    assert!(refused(r#"{"op":7}"#).starts_with("field \"op\" is 7; legal: hello, info"));
    assert!(refused(r#"{"op":"ping","id":[]}"#).starts_with("field \"id\" is a list of 0; legal: a whole"));
    assert!(refused(r#"{"op":"ping","id":1.5}"#).starts_with("field \"id\" is 1.5"));
    assert!(refused(&format!(r#"{{"op":"ping","id":"{}"}}"#, "x".repeat(129))).starts_with("field \"id\""));
    assert!(refused(r#"{"op":"ping","data":1e999}"#).contains("number out of range"));
}

#[test]
fn a_refusal_carries_the_id_and_stays_short() {
    let long = "y".repeat(60_000);
    for line in [
        r#"{"op":"subscribe","every":0,"id":"mine"}"#.to_owned(),
        format!(r#"{{"op":"{long}","id":"mine"}}"#),
        format!(r#"{{"op":"enable","{long}":1,"id":"mine"}}"#),
        format!(r#"{{"op":"acquire","steal":"{long}","id":"mine"}}"#),
        format!(r#"{{"op":"ping","data":{{"{long}":1,"{long}":1}},"id":"mine"}}"#),
    ] {
        let refusal = Request::read(Encoding::Json, line.as_bytes()).unwrap_err();
        assert_eq!(refusal.id, Some(Id::Text("mine".into())));
        assert!(refusal.error.message.len() < 300, "{}", refusal.error.message);
    }
}

#[test]
fn another_version_is_told_before_its_fields() {
    let line = br#"{"id":1,"op":"hello","version":2,"name":"a","colour":"red"}"#;
    let refusal = Request::read(Encoding::Json, line).unwrap_err();
    assert_eq!(refusal.error.code, ErrorCode::UnsupportedVersion);
    assert_eq!(refusal.error.message, "field \"version\" is 2; this server speaks 1");
}

#[test]
fn an_emergency_stop_is_never_refused_for_its_fields() {
    let line = br#"{"id":3,"op":"estop","why":1,"why":"smoke"}"#;
    assert_eq!(Request::read(Encoding::Json, line), Ok(Request { id: Some(3.into()), op: Op::Estop }));
}

#[test]
fn quaternions_are_brought_to_unit_norm() {
    let line = br#"{"op":"align","q":[0,3e5,0,4e5],"weight":0}"#;
    let Op::Align(align) = Request::read(Encoding::Json, line).unwrap().op else { panic!("align") };
    assert_eq!(align.q, [0.0, 0.6, 0.0, 0.8]);
}

/// A value that MessagePack can encode. Unlike JSON values, its numbers can be NaN or infinite.
#[derive(Serialize)]
#[serde(untagged)]
enum Raw {
    Number(f64),
    Legal(Value),
    List(Vec<Raw>),
    Map(BTreeMap<String, Raw>),
}

/// Returns `value` with the number `bad` in place of its number `at`, and sets `found` to the path
/// of this number.
fn spoilt(value: &Value, path: &str, at: &mut usize, bad: f64, found: &mut Option<String>) -> Raw {
    match value {
        Value::Number(_) => {
            *at = at.wrapping_sub(1);
            if *at != usize::MAX {
                return Raw::Legal(value.clone());
            }
            *found = Some(path.to_owned());
            Raw::Number(bad)
        }
        Value::Array(list) => {
            let items = list.iter().enumerate();
            Raw::List(items.map(|(i, item)| spoilt(item, &format!("{path}[{i}]"), at, bad, found)).collect())
        }
        Value::Object(map) => {
            let dot = if path.is_empty() { "" } else { "." };
            let items = map.iter().map(|(name, item)| {
                (name.clone(), spoilt(item, &format!("{path}{dot}{name}"), at, bad, found))
            });
            Raw::Map(items.collect())
        }
        _ => Raw::Legal(value.clone()),
    }
}

#[test]
fn nan_and_infinity_are_refused_at_every_number() {
    let mut ops = BTreeSet::new();
    for request in samples::requests() {
        let mut op = serde_json::to_value(&request.op).unwrap();
        op["id"] = 5.into();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for number in 0.. {
                let mut path = None;
                let raw = spoilt(&op, "", &mut number.clone(), bad, &mut path);
                let Some(path) = path else { break };
                if path == "id" {
                    continue;
                }
                let refusal =
                    Request::read(Encoding::Msgpack, &rmp_serde::to_vec_named(&raw).unwrap()).unwrap_err();
                let what = if bad.is_nan() { "is NaN" } else { "is infinite" };
                let message = format!("field {path:?} {what}; legal: a finite number");
                assert_eq!((refusal.error.message, refusal.id), (message, Some(Id::Integer(5))), "{op}");
                ops.insert(request.op.name());
            }
        }
    }
    let numbers = [
        OpName::Hello,
        OpName::Subscribe,
        OpName::LoadScene,
        OpName::Set,
        OpName::Torque,
        OpName::Reference,
        OpName::Model,
        OpName::Align,
        OpName::AlignDirection,
        OpName::Hand,
        OpName::Advance,
        OpName::Ping,
    ];
    assert!(ops.is_superset(&numbers.into()), "{ops:?}");
}

#[test]
fn what_json_has_not_is_refused_in_msgpack() {
    let refused = |bytes: &[u8]| Request::read(Encoding::Msgpack, bytes).unwrap_err().error.message;
    // The request {"op": "ping", "data": ...}
    let ping = |data: &[u8]| [b"\x82\xa2op\xa4ping\xa4data", data].concat();
    assert!(Request::read(Encoding::Msgpack, &ping(b"\xc3")).is_ok());
    assert!(refused(&ping(b"\xc4\x01\x00")).contains("invalid type: byte array"), "binary");
    assert!(refused(&ping(b"\xd4\x01\x00")).starts_with("not a MessagePack map"), "extension");
    assert!(refused(&ping(b"\x81\x01\x02")).contains("invalid type: integer `1`"), "a key that is no text");
    assert!(refused(&ping(b"\xa1\xff")).starts_with("not a MessagePack map"), "text that is not UTF-8");
    assert!(refused(&ping(b"\xc3\xc3")).starts_with("1 bytes are left over"));
    assert!(refused(&ping(b"\xdd\xff\xff\xff\xff")).starts_with("not a MessagePack map"), "a list cut off");
    assert!(refused(&ping(b"")).starts_with("not a MessagePack map"));
    assert!(refused(b"\xc1").starts_with("not a MessagePack map"), "a marker that is none");
}

#[test]
fn depth_is_bounded_in_both_encodings() {
    let json = |depth: usize| {
        format!(r#"{{"op":"ping","data":{}{}}}"#, "[".repeat(depth), "]".repeat(depth)).into_bytes()
    };
    let packed =
        |depth: usize| [b"\x82\xa2op\xa4ping\xa4data".to_vec(), vec![0x91; depth - 1], vec![0x90]].concat();
    let deepest = crate::MAX_DEPTH - 1;
    for (encoding, legal, deeper, bomb) in [
        (Encoding::Json, json(deepest), json(deepest + 1), json(30_000)),
        (Encoding::Msgpack, packed(deepest), packed(deepest + 1), packed(60_000)),
    ] {
        let request = Request::read(encoding, &legal).expect("legal");
        for bytes in [deeper, bomb] {
            let refusal = Request::read(encoding, &bytes).unwrap_err();
            assert!(refusal.error.message.contains("nested too deep"), "{encoding}: {refusal}");
        }
        // Every legal request can be answered, although the answer is nested more deeply.
        let Op::Ping { data } = request.op else { panic!("ping") };
        let answer = crate::Response::ok(None, crate::PingOk { data, tick: 0, t: 0.0 });
        let bytes = super::unframed(encoding, &super::encoded(encoding, &answer));
        assert!(crate::ServerMessage::read(encoding, &bytes).is_ok());
    }
}
