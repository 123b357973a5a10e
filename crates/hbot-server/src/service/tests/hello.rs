//! Tests of the hello and of everything that can come in its place.

use hbot_api::{ErrorCode, Token};
use std::time::Duration;

use super::*;

#[test]
fn hello_tells_who_is_there() {
    let bench = bench();
    let (a, b) = (bench.client("a"), bench.client("b"));
    let hello = a.hello();
    assert!(hello.server.starts_with("hbot "));
    assert_eq!((hello.version, hello.rig.as_str(), hello.rate_hz), (1, "Hbot prototype", 1000.0));
    assert_ne!(hello.session, b.hello().session);
    bench.wait_until("two clients", |status| status.clients == 2);
    drop((a, b));
    bench.wait_until("no clients", |status| status.clients == 0);
}

#[test]
fn a_web_page_that_posts_gets_nothing() {
    let bench = bench();
    let mut raw = bench.raw();
    raw.bytes(
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1:4268\r\nContent-Length: 200\r\n\r\n{\"id\":1,\"op\":\"hello\",\"version\":1,\"name\":\"page\"}\n\
          {\"id\":2,\"op\":\"estop\"}\n{\"id\":3,\"op\":\"info\"}\n",
    );
    let answer = raw.line();
    assert_eq!(answer["error"]["code"], "bad_request");
    assert_eq!(answer["id"], Value::Null);
    assert_eq!(raw.rest(), "", "one line, and nothing of what follows");
    assert!(!answer.to_string().contains("prototype"), "{answer}");
    bench.wait_ticks(20);
    assert_eq!(bench.finish().estops, 0);
}

#[test]
fn the_first_bad_line_is_answered_and_ends_the_connection() {
    let bench = bench();
    let long = format!("{{\"id\": 1, \"op\": \"hello\", \"name\": \"{}\"}}", "x".repeat(70_000));
    for (line, id, code) in [
        (r#"{"id": 7, "op": "ping"}"#, json!(7), "bad_request"),
        (r#"{"id": "a", "op": "estop"}"#, json!("a"), "bad_request"),
        (r#"{"id": 1, "op": "hello", "version": 2, "name": "later"}"#, json!(1), "unsupported_version"),
        (r#"{"id": 1, "op": "hello", "version": 1}"#, json!(1), "bad_request"),
        ("\u{1}\u{2}", Value::Null, "bad_request"),
        (&long, Value::Null, "too_large"),
    ] {
        let mut raw = bench.raw();
        raw.send(line);
        raw.send(r#"{"id": 99, "op": "hello", "version": 1, "name": "second try"}"#);
        let answer = raw.line();
        assert_eq!((&answer["id"], &answer["error"]["code"]), (&id, &json!(code)), "{line:.80}");
        assert_eq!(raw.rest(), "", "{line:.80}");
    }
    assert_eq!(bench.finish().estops, 0);
}

#[test]
fn silence_is_not_waited_for() {
    let bounds = Bounds { hello: Duration::from_millis(50), ..Bounds::default() };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    let mut raw = bench.raw();
    // Half a line is not a hello.
    raw.bytes(b"{\"id\": 1, \"op\": \"hel");
    assert_eq!(raw.line()["error"]["code"], "bad_request");
    assert_eq!(raw.rest(), "");
}

#[test]
fn a_token_is_asked_for_and_compared() {
    let bench =
        TestService::start(TestOptions { token: Some("open sesame".to_owned()), ..TestOptions::default() });
    let connect = |token: Option<&str>| {
        let token = token.map(|token| Token::from(token.to_owned()));
        let options = ConnectOptions { token, ..ConnectOptions::new("t") };
        hbot_api::Client::connect_with(&bench.address.to_string(), &options)
    };
    for wrong in [None, Some(""), Some("open sesamE"), Some("open sesame "), Some("open")] {
        let error = connect(wrong).unwrap_err();
        assert_eq!(error.code(), Some(ErrorCode::Unauthorized), "{wrong:?}");
        assert!(!error.to_string().contains("sesame"), "{error}");
    }
    connect(Some("open sesame")).unwrap();
}

#[test]
fn hello_comes_once() {
    let bench = bench();
    let mut raw = greeted(&bench);
    let answer = raw.ask(r#"{"id": 1, "op": "hello", "version": 1, "name": "again"}"#);
    assert_eq!(answer["error"]["code"], "bad_request");
    assert_eq!(raw.ask(r#"{"id": 2, "op": "ping"}"#)["id"], 2);
}

#[test]
fn too_many_connections_are_turned_away() {
    let bounds = Bounds { connections: 3, ..TestOptions::default().bounds };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    let mut clients: Vec<_> = ["a", "b", "c"].into_iter().map(|name| bench.client(name)).collect();
    let mut raw = bench.raw();
    assert_eq!(raw.line()["error"]["code"], "busy");
    assert_eq!(raw.rest(), "");
    for client in &mut clients {
        client.call(Op::Ping { data: Value::Null }).unwrap();
    }
    // A place that becomes free is given to the next client.
    clients.pop();
    eventually("a free place", || match Client::connect(&bench.address.to_string(), "d") {
        Ok(_) => true,
        Err(ClientError::Server(error)) => {
            assert_eq!(error.code, ErrorCode::Busy);
            false
        }
        // The connection was turned away before the hello was read.
        Err(_) => false,
    });
    assert!(bench.finish().connections_turned_away >= 1);
}
