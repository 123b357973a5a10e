//! A client that sends handwritten JSON to a server in virtual time.

use hbot_testing::lines::{JsonLines, norm};

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
