//! A client that sends handwritten JSON to a server in virtual time.

use hbot_testing::lines::{JsonLines, norm};
use serde_json::Value;

use crate::process::Process;

fn server() -> (Process, tempfile::TempDir) {
    let state = tempfile::tempdir().expect("a folder");
    (Process::start(&["--time", "virtual"], state.path()), state)
}

#[test]
fn hello_acquire_set_subscribe_and_the_torque_changes() {
    let (server, _state) = server();
    let mut client = JsonLines::greeted(&server.address);
    assert_eq!(client.ask(r#"{"id": 1, "op": "acquire"}"#)["ok"], serde_json::json!({}));
    // The hand holds the sphere still at its start, away from the reference, so that the torque
    // depends only on the stiffness.
    let scene = r#"{"id": 2, "op": "load_scene", "scene": {"name": "still", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": 0.2, "damping": 0.01, "reference": [0.9950041652780258, 0.09983341664682815, 0, 0]}],
        "simulate": {"hand": {"stiffness": 50, "damping": 1, "amplitude": 0}}}}"#
        .replace('\n', " ");
    let loaded = client.ask(&scene);
    assert_eq!(loaded["ok"]["effects"][0]["id"], "spring", "{loaded}");
    client.ask(r#"{"id": 3, "op": "subscribe", "every": 100}"#);
    let settled = |client: &mut JsonLines| {
        let from = client.state(|s| s["mode"] == "active")["t"].as_f64().expect("a time");
        client.state(|s| s["t"].as_f64().is_some_and(|t| t > from + 5.0))
    };
    let soft = norm(&settled(&mut client)["torque"]);
    assert_eq!(
        client.ask(r#"{"id": 4, "op": "set", "effect": "spring", "stiffness": 0.4}"#)["ok"],
        serde_json::json!({"warnings": []})
    );
    let stiff = norm(&settled(&mut client)["torque"]);
    // The torque doubles, except that the hand (50 N m/rad) yields by another 0.4 % to the stiffer
    // spring.
    assert!((stiff / soft - 2.0).abs() < 0.02, "{soft} to {stiff}");
}

#[test]
fn bad_lines_are_answered_and_nothing_is_lost() {
    let (server, _state) = server();
    let mut client = JsonLines::greeted(&server.address);
    let bad = [
        ("not json", Value::Null),
        (r#"{"id": 1, "op": "fly"}"#, 1.into()),
        (r#"{"id": 2, "op": "subscribe", "every": "10"}"#, 2.into()),
        (r#"{"id": 3, "op": "torque", "torque": [NaN, 0, 0], "valid_ms": 5}"#, Value::Null),
        (r#"{"id": 4, "op": "torque", "torque": ["0", 0, 0], "valid_ms": 5}"#, 4.into()),
        (r#"{"id": 5, "op": "torque", "torque": [1e999, 0, 0], "valid_ms": 5}"#, Value::Null),
    ];
    for (line, id) in bad {
        let answer = client.ask(line);
        assert_eq!(answer["error"]["code"], "bad_request", "{line}: {answer}");
        assert_eq!(answer["id"], id, "{line}: {answer}");
    }
    // A line that arrives in two halves counts as one line.
    client.bytes(br#"{"id": 6, "op": "pi"#);
    // The half has come to the server before this connection, so the other half is read apart from
    // it.
    JsonLines::greeted(&server.address).ask(r#"{"id": 1, "op": "ping"}"#);
    let answer = client.ask(r#"ng", "data": "still here"}"#);
    assert_eq!(answer["ok"]["data"], "still here");
    // Half a line counts as none. Another client finds the state unchanged.
    client.bytes(br#"{"id": 7, "op": "est"#);
    drop(client);
    let mut other = JsonLines::greeted(&server.address);
    other.ask(r#"{"id": 1, "op": "subscribe", "every": 1000}"#);
    assert_ne!(other.state(|_| true)["mode"], "estop");
}

#[test]
fn a_line_too_long_is_told_so() {
    let (server, _state) = server();
    let mut client = JsonLines::greeted(&server.address);
    let answer = client.ask(&format!(r#"{{"id": 1, "op": "ping", "data": "{}"}}"#, "x".repeat(70_000)));
    assert_eq!(answer["error"]["code"], "too_large", "{answer}");
}

#[test]
fn before_hello_the_first_bad_line_ends_the_connection() {
    let (server, _state) = server();
    for line in ["POST / HTTP/1.1\r", r#"{"id": 1, "op": "estop"}"#] {
        let mut client = JsonLines::connect(&server.address);
        let answer = client.ask(line);
        assert!(answer["error"]["code"].is_string(), "{answer}");
        assert_eq!(client.next_line(), None, "closed after {line}");
    }
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 1000}"#);
    assert_ne!(client.state(|_| true)["mode"], "estop", "a stranger has stopped it");
}
