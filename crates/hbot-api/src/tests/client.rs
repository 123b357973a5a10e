//! Tests of the client against a small server in the test.

use super::{encoded, samples};
use crate::*;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::{self, JoinHandle};
use std::time::Duration;

const SOON: Duration = Duration::from_secs(5);

/// The server's side of one connection, which the test controls.
pub(super) struct Peer {
    stream: TcpStream,
    splitter: Splitter,
}

impl Peer {
    pub(super) fn request(&mut self) -> Option<Request> {
        let encoding = self.splitter.encoding();
        loop {
            if let Some(message) = self.splitter.next_message() {
                return Some(Request::read(encoding, message.unwrap()).unwrap());
            }
            let mut piece = [0; 100];
            match self.stream.read(&mut piece) {
                Ok(0) | Err(_) => return None,
                Ok(length) => self.splitter.push(&piece[..length]),
            }
        }
    }

    pub(super) fn send(&mut self, message: &impl serde::Serialize) {
        self.stream.write_all(&encoded(self.splitter.encoding(), message)).unwrap();
    }

    /// Answers the client's first message (`hello`), and changes to the encoding that it asks for.
    pub(super) fn welcome(&mut self) -> Hello {
        let Some(Request { id, op: Op::Hello(hello) }) = self.request() else { panic!("hello comes first") };
        let body =
            HelloOk { server: "test 1".into(), version: 1, rig: "none".into(), rate_hz: 1000.0, session: 3 };
        self.send(&Response::ok(id, body));
        self.splitter.set_encoding(hello.encoding);
        hello
    }
}

/// Starts a server that serves one connection with the function `serve`. Returns its address and
/// the handle of its thread.
pub(super) fn serve<T: Send + 'static>(
    serve: impl FnOnce(Peer) -> T + Send + 'static,
) -> (String, JoinHandle<T>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let thread = thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        serve(Peer { stream, splitter: Splitter::new(Encoding::Json) })
    });
    (address, thread)
}

fn options(encoding: Encoding, timeout: Duration) -> ConnectOptions {
    ConnectOptions { encoding, timeout, ..ConnectOptions::new("tester") }
}

/// Returns the body of a valid answer to any op.
fn body(op: &Op) -> Value {
    match op {
        Op::Subscribe { every } => json!({"every": every}),
        Op::LoadScene { .. } => json!({"effects": [{"id": "a", "kind": "b", "cost_ns": 1}], "ignored": []}),
        // An older server can send fewer fields, and a later one more.
        Op::Controllers => json!({"controllers": [{"joint": 0, "id": 3, "moons": 4}]}),
        Op::Align(_) | Op::AlignDirection(_) => json!({"angle": 0.25}),
        Op::Enable | Op::Disable | Op::Reset | Op::Estop => json!({"mode": "idle"}),
        Op::Advance { ticks } => {
            serde_json::to_value(crate::StateEvent { tick: *ticks, ..Default::default() }).unwrap()
        }
        Op::Ping { data } => json!({"data": data, "tick": 5, "t": 0.005}),
        _ => json!({}),
    }
}

#[test]
fn every_helper_asks_its_op_in_both_encodings() {
    for encoding in Encoding::ALL {
        let (address, server) = serve(|mut peer| {
            let hello = peer.welcome();
            let mut seen = Vec::new();
            while let Some(request) = peer.request() {
                // An event precedes each answer. The client keeps it.
                peer.send(&Event::State(samples::state()));
                if request.id.is_some() {
                    peer.send(&Response::ok(request.id, body(&request.op)));
                }
                seen.push(request.op.name());
            }
            (hello, seen)
        });
        let mut client = Client::connect_with(&address, &options(encoding, SOON)).unwrap();
        assert_eq!((client.hello().session, client.encoding()), (3, encoding));
        client.info().unwrap();
        assert_eq!(client.subscribe(7).unwrap().every, 7);
        client.unsubscribe().unwrap();
        client.stats().unwrap();
        assert_eq!(client.controllers().unwrap()[0].id, Some(3));
        client.acquire(true).unwrap();
        client.release().unwrap();
        assert_eq!(client.load_scene(json!({})).unwrap().effects[0].kind, "b");
        client.set("a", json!({"gain": 1}).as_object().unwrap().clone()).unwrap();
        let (torque, q) = ([0.0; 3], [1.0, 0.0, 0.0, 0.0]);
        client.torque(TorqueCommand { torque, valid_ms: 1, tick: None, seq: None }).unwrap();
        let effect = "a".into();
        client
            .reference(ReferenceCommand { effect, q, omega: None, valid_ms: 1, tick: None, seq: None })
            .unwrap();
        client.model(ModelCommand { valid_ms: 1, ..ModelCommand::default() }).unwrap();
        assert_eq!(client.align(Align { q, weight: 0.0, sigma: None, t: None }).unwrap(), 0.25);
        let (body, world) = ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]);
        let direction = AlignDirection { body, world, sigma: 0.1, t: None };
        let answer = client.align_direction(direction).unwrap();
        assert!(answer.used && answer.angle == 0.25, "an older server uses all that it answers");
        client.hand(HandCommand::RELEASE).unwrap();
        assert_eq!(client.enable().unwrap(), Mode::Idle);
        client.disable().unwrap();
        client.reset().unwrap();
        client.estop().unwrap();
        assert_eq!(client.advance(7).unwrap().tick, 7);
        assert_eq!(client.ping(json!([1, "x"])).unwrap().data, json!([1, "x"]));
        for _ in 0..21 {
            assert_eq!(client.next_event(SOON).unwrap(), Some(Event::State(samples::state())));
        }
        assert_eq!(client.next_event(Duration::ZERO).unwrap(), None);
        drop(client);
        let (hello, seen) = server.join().unwrap();
        assert_eq!((hello.name.as_str(), hello.encoding), ("tester", encoding));
        assert!(seen.len() >= 21 && seen.is_sorted(), "in the order of the list: {seen:?}");
    }
}

#[test]
fn every_op_has_a_helper() {
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/src/ops")).unwrap();
    let files: String = folder.map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap()).collect();
    for op in &OpName::ALL[1..] {
        assert!(files.contains(&format!("pub fn {op}(&mut self")), "{op}");
    }
}

#[test]
fn a_refusal_is_told_with_its_code() {
    let (address, server) = serve(|mut peer| {
        peer.welcome();
        let id = peer.request().unwrap().id;
        let busy =
            ErrorBody { holder: Some("ann".into()), ..ErrorBody::new(ErrorCode::Busy, "ann commands") };
        peer.send(&Response::error(id, busy));
        let _ = peer.request();
        peer.send(&Response::error(None, ErrorBody::new(ErrorCode::TooLarge, "too long")));
    });
    let mut client = Client::connect(&address, "tester").unwrap();
    let error = client.acquire(false).unwrap_err();
    assert_eq!(error.to_string(), "ann commands (busy)");
    assert!(matches!(&error, ClientError::Server(body) if body.holder.as_deref() == Some("ann")));
    assert_eq!(client.info().unwrap_err().code(), Some(ErrorCode::TooLarge), "an answer without id");
    server.join().unwrap();
}

#[test]
fn a_late_answer_is_passed_over() {
    let (address, server) = serve(|mut peer| {
        peer.welcome();
        let late = peer.request().unwrap().id;
        let second = peer.request().unwrap();
        peer.send(&Response::ok(late, json!({"mode": "fault"})));
        peer.send(&Response::ok(second.id, json!({"mode": "idle"})));
    });
    let short = Duration::from_millis(50);
    let mut client = Client::connect(&address, "tester").unwrap();
    client.set_timeout(short);
    let error = client.enable().unwrap_err();
    assert_eq!(error.to_string(), "no answer to enable within 0.05 s");
    client.set_timeout(SOON);
    assert_eq!(client.disable().unwrap(), Mode::Idle);
    server.join().unwrap();
}

#[test]
fn events_are_kept_to_a_bound() {
    let (address, server) = serve(|mut peer| {
        peer.welcome();
        let request = peer.request().unwrap();
        for total in 1..=5000 {
            peer.send(&Event::Dropped(DroppedEvent { count: 1, total }));
        }
        peer.send(&Response::done(request.id));
    });
    let mut client = Client::connect(&address, "tester").unwrap();
    client.unsubscribe().unwrap();
    server.join().unwrap();
    let mut totals = Vec::new();
    let end = loop {
        match client.next_event(SOON) {
            Ok(Some(Event::Dropped(event))) => totals.push(event.total),
            other => break other,
        }
    };
    assert!(matches!(end, Err(ClientError::Closed)), "{end:?}");
    assert_eq!(client.events_lost(), 904);
    assert_eq!(totals, (905..=5000).collect::<Vec<_>>(), "the newest are kept, in order");
}

#[test]
fn a_flood_of_events_does_not_put_off_a_timeout() {
    let (address, server) = serve(|mut peer| {
        peer.welcome();
        peer.request();
        let event = encoded(Encoding::Json, &Event::State(samples::state())).repeat(50);
        while peer.stream.write_all(&event).is_ok() {}
    });
    let short = Duration::from_millis(50);
    let mut client = Client::connect(&address, "tester").unwrap();
    client.set_timeout(short);
    assert!(matches!(client.stats(), Err(ClientError::Timeout { what: "stats", .. })));
    drop(client);
    server.join().unwrap();
}

#[test]
fn nobody_there_says_how_to_start_a_server() {
    // A port that was free a moment ago.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let message = Client::connect(&address, "tester").unwrap_err().to_string();
    assert!(message.contains("connection refused") && message.contains("`hbot server`"), "{message}");
    assert!(message.contains(&address), "{message}");
}

#[test]
fn a_server_that_says_nothing_or_nonsense_is_told_apart() {
    let (address, server) = serve(|mut peer| {
        peer.request();
        // Keeps the connection open until the client has given up.
        peer.request()
    });
    let error =
        Client::connect_with(&address, &options(Encoding::Json, Duration::from_millis(50))).unwrap_err();
    assert!(matches!(error, ClientError::Timeout { what: "hello", .. }), "{error}");
    server.join().unwrap();

    let (address, server) = serve(|mut peer| peer.stream.write_all(b"SSH-2.0-OpenSSH\r\n").unwrap());
    let error = Client::connect(&address, "tester").unwrap_err();
    // The operating system can report the reset before the data that was sent.
    assert!(matches!(error, ClientError::Protocol(_) | ClientError::Closed), "{error}");
    server.join().unwrap();

    let (address, server) = serve(|mut peer| {
        let id = peer.request().unwrap().id;
        peer.send(&Response::error(id, ErrorBody::new(ErrorCode::Unauthorized, "token")));
    });
    assert_eq!(Client::connect(&address, "tester").unwrap_err().code(), Some(ErrorCode::Unauthorized));
    server.join().unwrap();

    for (address, why) in [
        ("127.0.0.1:seven", "\"seven\" is no port, which is a number up to 65535. Legal: HOST or HOST:PORT"),
        ("127.0.0.1:99999", "\"99999\" is no port"),
        ("rig.local:", "\"\" is no port"),
        ("[::1]:nine", "\"nine\" is no port"),
        ("", "it has no host. Legal: HOST or HOST:PORT, as 127.0.0.1:4268"),
        (":4268", "\":4268\" is no address of a server: it has no host. Legal: HOST or HOST:PORT"),
        ("no such host", "\"no such host\" is no address of a server: "),
    ] {
        let error = Client::connect(address, "tester").unwrap_err();
        assert!(matches!(error, ClientError::Address { .. }), "{address}: {error}");
        assert!(error.to_string().contains(why), "{address}: {error}");
    }
    for address in ["no-such-host.invalid", "no-such-host.invalid:4268"] {
        let told = Client::connect(address, "tester").unwrap_err().to_string();
        assert!(told.starts_with("no machine is known by the name \"no-such-host.invalid\" ("), "{told}");
    }
}

#[test]
fn a_stop_does_not_wait_for_the_answer_to_hello() {
    let (address, server) = serve(|mut peer| [peer.request(), peer.request()]);
    let silent = Client::estop_at(&address, &options(Encoding::Msgpack, Duration::from_millis(50)));
    let [hello, stop] = server.join().unwrap().map(|request| request.unwrap().op);
    assert!(matches!(hello, Op::Hello(Hello { encoding: Encoding::Json, .. })), "{hello:?}");
    assert!(matches!(stop, Op::Estop), "{stop:?}");
    // The server closes the connection when it has read both, perhaps before the time is up.
    assert!(matches!(silent, Err(ClientError::Timeout { what: "hello", .. } | ClientError::NoHello { .. })));

    let (address, server) = serve(|mut peer| {
        peer.welcome();
        let id = peer.request().unwrap().id;
        peer.send(&Event::State(samples::state()));
        peer.send(&Response::ok(id, json!({"mode": "estop"})));
    });
    assert_eq!(Client::estop_at(&address, &options(Encoding::Json, SOON)).unwrap(), Mode::Estop);
    server.join().unwrap();

    let (address, server) = serve(|mut peer| {
        peer.welcome();
        // Keeps the connection open until the client has given up.
        [peer.request(), peer.request()]
    });
    let error = Client::estop_at(&address, &options(Encoding::Json, Duration::from_secs(1))).unwrap_err();
    assert!(matches!(error, ClientError::Timeout { what: "estop", .. }), "{error}");
    server.join().unwrap();
}

#[test]
fn what_is_not_finite_is_not_sent() {
    let (address, server) = serve(|mut peer| {
        peer.welcome();
        peer.request()
    });
    let mut client = Client::connect(&address, "tester").unwrap();
    let torque = TorqueCommand { torque: [0.0, f64::NAN, 0.0], valid_ms: 1, tick: None, seq: None };
    let error = client.torque(torque).unwrap_err();
    assert_eq!(error.to_string(), "message not sent: a number to be sent is not finite");
    drop(client);
    assert_eq!(server.join().unwrap(), None, "nothing came");
}
