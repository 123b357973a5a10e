//! Tests that clients without a hello use few resources.

use super::*;

fn with_token() -> TestService {
    TestService::start(TestOptions { token: Some("open sesame".to_owned()), ..TestOptions::default() })
}

#[test]
fn a_first_message_is_short_and_flat() {
    let bench = bench();
    let hello = |more: &str| format!(r#"{{"id": 1, "op": "hello", "version": 1, "name": "a"{more}}}"#);
    let long = hello(&format!(r#", "x": "{}""#, "x".repeat(2048)));
    let deep = hello(r#", "x": [1]"#);
    for (line, code, words) in [(long, "too_large", "2048"), (deep, "bad_request", "nested too deep")] {
        let mut raw = bench.raw();
        raw.send(&line);
        let answer = raw.line();
        assert_eq!(answer["error"]["code"], code, "{answer}");
        assert!(answer["error"]["message"].as_str().unwrap().contains(words), "{answer}");
        assert_eq!(raw.rest(), "");
    }
}

#[test]
fn an_unauthenticated_client_stops_nothing_however_the_bytes_come() {
    let bench = with_token();
    let mut raw = bench.raw();
    raw.bytes(b"{\"op\":\"hello\",\"version\":1,\"name\":\"a\",\"token\":\"guess\"}\n{\"op\":\"estop\"}\n");
    assert_eq!(raw.line()["error"]["code"], "unauthorized");
    let mut raw = bench.raw();
    raw.bytes(b"\x81\xa2op\xa5estop\n{\"op\":\"estop\"}\n");
    assert_eq!(raw.line()["error"]["code"], "bad_request");
    bench.wait_ticks(50);
    assert_eq!(bench.finish().estops, 0);
}

#[test]
fn those_who_say_no_hello_leave_places_to_those_who_do() {
    let bounds = Bounds { unauthenticated: 3, ..TestOptions::default().bounds };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    let clients: Vec<_> = (0..5).map(|k| bench.client(&format!("c{k}"))).collect();
    let silent: Vec<_> = (0..3).map(|_| bench.raw()).collect();
    eventually("one too many", || {
        let mut one_more = bench.raw();
        one_more.send(r#"{"op": "hello", "version": 1, "name": "late"}"#);
        one_more.line()["error"]["code"] == "busy"
    });
    drop(silent);
    eventually("a place", || Client::connect(&bench.address.to_string(), "later").is_ok());
    drop(clients);
}

#[test]
fn who_shows_a_wrong_token_waits_for_the_answer_and_nobody_else_does() {
    let bench = with_token();
    let start = Instant::now();
    let guess = r#"{"id": 1, "op": "hello", "version": 1, "name": "guess", "token": "open says me"}"#;
    let mut guesses: Vec<_> = (0..5)
        .map(|_| {
            let mut raw = bench.raw();
            raw.send(guess);
            raw
        })
        .collect();
    let options =
        ConnectOptions { token: Some("open sesame".to_owned().into()), ..ConnectOptions::new("right") };
    Client::connect_with(&bench.address.to_string(), &options).unwrap();
    for raw in &mut guesses {
        let answer = raw.line();
        assert_eq!((&answer["id"], &answer["error"]["code"]), (&json!(1), &json!("unauthorized")));
        assert!(start.elapsed() >= Duration::from_millis(500), "{:?}", start.elapsed());
        assert_eq!(raw.rest(), "");
    }
}

#[test]
fn those_who_guess_tokens_take_no_place_from_those_who_know_one() {
    // The delay is longer than the test, so none of the wrong tokens is answered during it.
    let bounds =
        Bounds { unauthenticated: 3, wrong_token: Duration::from_secs(600), ..TestOptions::default().bounds };
    let token = Some("open sesame".to_owned());
    let bench = TestService::start(TestOptions { bounds, token: token.clone(), ..TestOptions::default() });
    let guess = r#"{"op": "hello", "version": 1, "name": "guess", "token": "open says me"}"#;
    let options = ConnectOptions { token: token.map(Into::into), ..ConnectOptions::new("right") };
    let mut guesses = Vec::new();
    for _ in 0..5 {
        for _ in 0..3 {
            let mut raw = bench.raw();
            raw.send(guess);
            guesses.push(raw);
        }
        // This waits until all wrong tokens have been read. A connection that has not been read yet
        // keeps its place.
        eventually("the right one", || Client::connect_with(&bench.address.to_string(), &options).is_ok());
    }
    drop(guesses);
}
