//! Tests with messages split in any way, and with bytes that are no messages.

use super::*;

#[test]
fn messages_come_in_any_pieces() {
    let bench = bench();
    let mut raw = greeted(&bench);
    for byte in b"{\"id\": 1, \"op\": \"ping\", \"data\": \"\xc3\xa4\"}\r\n" {
        raw.bytes(&[*byte]);
    }
    assert_eq!(raw.answer()["ok"]["data"], "ä");
    raw.bytes(b"\n  \n{\"id\":2,\"op\":\"ping\"}\n{\"id\":3,\"op\":\"ping\"}\n{\"id\":4,\"op\":");
    assert_eq!((raw.answer()["id"].clone(), raw.answer()["id"].clone()), (json!(2), json!(3)));
    raw.bytes(b"\"ping\"}\n");
    assert_eq!(raw.answer()["id"], 4);
}

#[test]
fn bad_lines_are_answered_and_the_connection_goes_on() {
    let bench = bench();
    let mut raw = greeted(&bench);
    for (line, id) in [
        (&b"garbage"[..], Value::Null),
        (b"\xff\xfe", Value::Null),
        (b"[1, 2]", Value::Null),
        (b"{\"id\": 1}", json!(1)),
        (b"{\"id\": 2, \"op\": \"fly\"}", json!(2)),
        (b"{\"id\": \"three\", \"op\": \"subscribe\", \"every\": 0}", json!("three")),
        (b"{\"id\": [4], \"op\": \"ping\"}", Value::Null),
        (b"{\"id\": 5, \"op\": \"ping\", \"dta\": 1}", json!(5)),
        (b"{\"id\": 6, \"op\": \"ping\", \"data\": 1e999}", Value::Null),
    ] {
        raw.bytes(line);
        raw.bytes(b"\n");
        let answer = raw.answer();
        assert_eq!((&answer["id"], &answer["error"]["code"]), (&id, &json!("bad_request")), "{line:?}");
    }
    // A request without an id gets an answer without an id.
    assert_eq!(raw.ask(r#"{"op": "ping"}"#)["id"], Value::Null);
    assert_eq!(bench.finish().refused.total(), 9);
}

#[test]
fn a_line_too_long_is_refused_and_skipped() {
    let bench = bench();
    let mut raw = greeted(&bench);
    // The second one takes longer than the rate limit allows, and nothing comes after its ping.
    for bytes in [100_000, 300_000] {
        raw.send(&format!(r#"{{"id": 1, "op": "ping", "data": "{}"}}"#, "x".repeat(bytes)));
        raw.send(r#"{"id": 2, "op": "ping"}"#);
        let answer = raw.answer();
        assert_eq!((&answer["id"], &answer["error"]["code"]), (&Value::Null, &json!("too_large")));
        assert_eq!(raw.answer()["id"], 2, "what follows its newline is read");
    }
    // A message of the maximum length is accepted.
    let data = "x".repeat(hbot_api::MAX_SHORT_REQUEST_BYTES - r#"{"id":3,"op":"ping","data":""}"#.len() - 1);
    assert_eq!(raw.ask(&format!(r#"{{"id":3,"op":"ping","data":"{data}"}}"#))["ok"]["data"], data);
    let answer = raw.ask(&format!(r#"{{"id":4,"op":"ping","data":"{data}x"}}"#));
    assert_eq!((&answer["id"], &answer["error"]["code"]), (&Value::Null, &json!("too_large")));
    let message = answer["error"]["message"].as_str().unwrap();
    assert!(message.starts_with("message of 2049 bytes; at most 2048 are taken"), "{message}");
}

#[test]
fn scenes_and_parameters_of_the_holder_may_be_long() {
    let bench = bench();
    let mut raw = greeted(&bench);
    let effects: Vec<Value> = (0..32).map(|k| spring(&format!("a-rather-long-name-of-spring-{k}"))).collect();
    let load = json!({"id": 1, "op": "load_scene", "scene": {"effect": effects}}).to_string();
    assert!(load.len() > hbot_api::MAX_SHORT_REQUEST_BYTES);
    assert_eq!(raw.ask(&load)["error"]["code"], "not_holder");
    raw.ask(r#"{"id": 2, "op": "acquire"}"#);
    for _ in 0..3 {
        let answer = raw.ask(&load);
        assert_eq!(answer["ok"]["effects"].as_array().map(Vec::len), Some(32), "{answer}");
    }
    // A message after a long one is executed after it.
    raw.send(&load);
    raw.send(r#"{"id": 3, "op": "ping"}"#);
    let ids = [raw.answer()["id"].clone(), raw.answer()["id"].clone()];
    assert!(ids.contains(&json!(1)) && ids.contains(&json!(3)), "{ids:?}");
}

#[test]
fn json_after_asking_for_msgpack_is_told_and_ends_the_connection() {
    let bench = bench();
    let mut raw = bench.raw();
    raw.send(r#"{"id": 0, "op": "hello", "version": 1, "name": "m", "encoding": "msgpack"}"#);
    assert_eq!(raw.line()["ok"]["version"], 1);
    raw.send(r#"{"id": 1, "op": "ping"}"#);
    let mut answer = Vec::new();
    let _ = raw.reader.read_to_end(&mut answer);
    let text = String::from_utf8_lossy(&answer);
    assert!(text.contains("bad_request") && text.contains("MessagePack"), "{text}");
}

#[test]
fn a_msgpack_frame_too_long_is_refused_and_skipped() {
    let bench = bench();
    let mut raw = bench.raw();
    raw.send(r#"{"id": 0, "op": "hello", "version": 1, "name": "m", "encoding": "msgpack"}"#);
    assert_eq!(raw.line()["ok"]["version"], 1);
    let long = 70_000_u32;
    raw.bytes(&long.to_be_bytes());
    raw.bytes(&vec![0; long as usize]);
    let mut ping = Vec::new();
    hbot_api::Encoding::Msgpack.encode(&json!({"id": 9, "op": "ping"}), &mut ping).unwrap();
    raw.bytes(&ping);
    let mut answer = |n: &str| {
        let mut length = [0; 4];
        raw.reader.read_exact(&mut length).unwrap();
        let mut body = vec![0; u32::from_be_bytes(length) as usize];
        raw.reader.read_exact(&mut body).unwrap();
        let text = String::from_utf8_lossy(&body).into_owned();
        assert!(text.contains(n), "{text}");
    };
    answer("too_large");
    answer("tick");
}
