//! Tests of the web port: the page, and the API over WebSocket, with the clients that a browser or
//! an attacker can be.

use std::io::{Read, Write};

use hbot_api::Encoding;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use tokio_tungstenite::tungstenite::client::{IntoClientRequest as _, client};
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{Error, Message, WebSocket};

use super::tls::Made;
use super::*;

struct Browser<S = TcpStream>(WebSocket<S>);

impl Browser {
    /// Asks for a WebSocket with these headers. Returns the HTTP status if it is refused.
    fn asking(bench: &TestService, headers: &[(&'static str, &str)]) -> Result<Self, u16> {
        let mut request = format!("ws://{}/ws", bench.web).into_client_request().unwrap();
        for (name, value) in headers {
            request.headers_mut().insert(*name, value.parse().unwrap());
        }
        let stream = TcpStream::connect(bench.web).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        match client(request, stream) {
            Ok((socket, answer)) => {
                assert!(!answer.headers().contains_key("sec-websocket-extensions"), "no compression");
                Ok(Self(socket))
            }
            Err(error) => match error {
                tokio_tungstenite::tungstenite::HandshakeError::Failure(Error::Http(answer)) => {
                    Err(answer.status().as_u16())
                }
                // Closed without an answer, as a server with no place left does.
                _ => Err(0),
            },
        }
    }

    fn opened(bench: &TestService) -> Self {
        Self::asking(bench, &[("origin", &format!("http://{}", bench.web))]).unwrap()
    }

    fn greeted(bench: &TestService) -> Self {
        let mut browser = Self::opened(bench);
        let hello = browser.ask(&json!({"id": 0, "op": "hello", "version": 1, "name": "page"}));
        assert!(hello["ok"]["session"].is_u64(), "{hello}");
        browser
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.0.get_mut().write_all(bytes).unwrap();
    }
}

impl<S: Read + Write> Browser<S> {
    fn send(&mut self, message: &Value) {
        self.0.send(Message::text(message.to_string())).unwrap();
    }

    /// Returns the next message. On a busy machine, pings come before it.
    fn next(&mut self) -> Value {
        let message = std::iter::repeat_with(|| self.0.read().unwrap()).find(|message| !message.is_ping());
        serde_json::from_str(message.unwrap().to_text().unwrap()).unwrap()
    }

    fn ask(&mut self, message: &Value) -> Value {
        self.send(message);
        loop {
            let answer = self.next();
            if answer.get("event").is_none() {
                return answer;
            }
        }
    }

    /// Returns why the server has closed the WebSocket, after all messages before. Pings come as
    /// long as it is open.
    fn closed(&mut self) -> Option<CloseCode> {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            match self.0.read() {
                Ok(Message::Close(why)) => return why.map(|why| why.code),
                Ok(_) => {}
                Err(_) => return None,
            }
        }
        panic!("the server has not closed the WebSocket");
    }
}

/// Returns an encrypted connection to the web port of a server with this certificate, which the
/// client trusts.
fn encrypted(bench: &TestService, made: &Made) -> StreamOwned<ClientConnection, TcpStream> {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_slice(made.certificate.as_bytes()).unwrap()).unwrap();
    let config = ClientConfig::builder().with_root_certificates(roots).with_no_client_auth();
    let name = ServerName::from(bench.web.ip());
    let stream = TcpStream::connect(bench.web).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    StreamOwned::new(ClientConnection::new(Arc::new(config), name).unwrap(), stream)
}

/// Sends a plain HTTP request to the web port. Returns the whole answer.
fn http(bench: &TestService, request: &str) -> String {
    let mut raw = JsonLines::connect(bench.web);
    raw.bytes(request.as_bytes());
    raw.rest()
}

/// A masked text frame of a client.
fn text(first: u8, payload: &[u8]) -> Vec<u8> {
    assert!(payload.len() < 126);
    [&[first, 0x80 | payload.len() as u8, 0, 0, 0, 0][..], payload].concat()
}

#[test]
fn messages_are_those_of_tcp_in_both_encodings() {
    // More messages may wait than are counted here, so a busy machine loses none.
    let bounds = Bounds { outgoing: 1000, ..TestOptions::default().bounds };
    let breath = Duration::from_millis(1);
    let bench = TestService::start(TestOptions { bounds, breath, ..TestOptions::default() });
    let mut browser = Browser::greeted(&bench);
    let data = json!([1, {"a": "\n"}, "x".repeat(1500)]);
    let answer = browser.ask(&json!({"id": "p", "op": "ping", "data": data}));
    assert_eq!((&answer["id"], &answer["ok"]["data"]), (&json!("p"), &data));
    assert!(browser.ask(&json!({"id": 2, "op": "info"})).to_string().len() > 20_000, "a long answer");
    browser.send(&json!({"id": 3, "op": "subscribe", "every": 1}));
    let mut states = (0..500).map(|_| browser.next()).filter(|state| state["event"] == "state");
    let first = states.next().unwrap()["tick"].as_u64().unwrap();
    assert_eq!(
        states.map(|state| state["tick"].as_u64().unwrap()).last().unwrap(),
        first + 498,
        "one is the answer"
    );

    let mut binary = Browser::opened(&bench);
    let hello = json!({"id": 0, "op": "hello", "version": 1, "name": "b", "encoding": "msgpack"});
    assert_eq!(binary.ask(&hello)["id"], 0, "the answer to the hello is text");
    let mut ping = Vec::new();
    Encoding::Msgpack.encode(&json!({"id": 7, "op": "ping", "data": "x".repeat(300)}), &mut ping).unwrap();
    binary.0.send(Message::binary(ping[4..].to_vec())).unwrap();
    let Message::Binary(answer) = binary.0.read().unwrap() else { panic!("not binary") };
    let hbot_api::ServerMessage::Response(answer) =
        hbot_api::ServerMessage::read(Encoding::Msgpack, &answer).unwrap()
    else {
        panic!("no answer")
    };
    assert_eq!(answer.result.unwrap()["data"], "x".repeat(300));
    assert_eq!(bench.finish().refused.total(), 0);
}

#[test]
fn a_client_over_web_has_the_same_rights_as_one_over_tcp() {
    let bench = bench();
    let mut browser = Browser::greeted(&bench);
    assert_eq!(browser.ask(&json!({"id": 1, "op": "enable"}))["error"]["code"], "not_holder");
    assert!(browser.ask(&json!({"id": 2, "op": "acquire"}))["ok"].is_object());
    let mut other = bench.client("other");
    assert_eq!(refused(other.call(Op::Acquire { steal: false })).holder.as_deref(), Some("page"));
    // The end of the WebSocket frees the lease.
    browser.0.close(None).unwrap();
    assert_eq!(browser.closed(), Some(CloseCode::Normal));
    eventually("the lease", || other.call(Op::Acquire { steal: false }).is_ok());
    // Over TCP, the first bad message ends the connection. So it does here.
    let mut stranger = Browser::opened(&bench);
    assert_eq!(stranger.ask(&json!({"id": 1, "op": "estop"}))["error"]["code"], "bad_request");
    assert_eq!(stranger.closed(), Some(CloseCode::Normal));
    assert_eq!(bench.finish().estops, 0);
}

#[test]
fn a_page_from_elsewhere_and_a_rebound_name_get_no_websocket() {
    let bench = bench();
    let port = bench.web.port();
    let status = |headers: &[(&'static str, &str)]| Browser::asking(&bench, headers).map(drop);
    let own = format!("http://127.0.0.1:{port}");
    assert_eq!(status(&[("origin", &own)]), Ok(()));
    assert_eq!(
        status(&[("origin", &format!("http://localhost:{port}")), ("host", &format!("localhost:{port}"))]),
        Ok(())
    );
    for origin in ["http://evil.example", "https://evil.example", "null", "http://localhost", "file://"] {
        assert_eq!(status(&[("origin", origin)]), Err(403), "{origin}");
    }
    let rebound = format!("evil.example:{port}");
    assert_eq!(status(&[("origin", &format!("http://{rebound}")), ("host", &rebound)]), Err(403));
    assert_eq!(status(&[("origin", &own), ("host", &rebound)]), Err(403));
    assert_eq!(status(&[]), Err(403), "no Origin and no token");
    let summary = bench.finish();
    assert_eq!((summary.requests, summary.refused.total()), (0, 8), "refusals are counted");
}

#[test]
fn behind_tls_the_page_and_the_api_are_served_and_nothing_without_it() {
    let made = Made::by_itself();
    let bench = made.bench();
    let mut page = encrypted(&bench, &made);
    page.write_all(format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", bench.web).as_bytes()).unwrap();
    let mut answer = String::new();
    page.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");

    let open = |origin: &str| {
        let mut request = format!("wss://{}/ws", bench.web).into_client_request().unwrap();
        request.headers_mut().insert("origin", origin.parse().unwrap());
        client(request, encrypted(&bench, &made)).map_err(Box::new)
    };
    let (socket, _) = open(&format!("https://{}", bench.web)).unwrap();
    let mut browser = Browser(socket);
    let hello = browser.ask(&json!({"id": 0, "op": "hello", "version": 1, "name": "page"}));
    assert!(hello["ok"]["session"].is_u64(), "{hello}");
    // This answer is longer than a TLS record.
    assert!(browser.ask(&json!({"id": 1, "op": "info"})).to_string().len() > 16 * 1024);
    browser.send(&json!({"id": 2, "op": "subscribe", "every": 1}));
    // On a busy machine, a `dropped` comes between them.
    let states = std::iter::repeat_with(|| browser.next()).filter(|message| message["event"] == "state");
    assert_eq!(states.take(200).count(), 200);
    // The page of the same address without encryption is another origin.
    for origin in [format!("http://{}", bench.web), "https://evil.example".to_owned()] {
        assert!(open(&origin).is_err(), "{origin}");
    }
    // Who does not encrypt gets no answer, and commands nothing.
    let mut plain = TcpStream::connect(bench.web).unwrap();
    plain.set_read_timeout(Some(PATIENCE)).unwrap();
    plain.write_all(format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", bench.web).as_bytes()).unwrap();
    let mut rest = Vec::new();
    // The server may also cut the connection.
    let _ = plain.read_to_end(&mut rest);
    assert!(!rest.starts_with(b"HTTP"), "{rest:?}");
    let stop = browser.ask(&json!({"id": 3, "op": "estop"}));
    assert_eq!(stop["ok"]["mode"], "estop", "{stop}");
    let summary = bench.finish();
    assert_eq!((summary.estops, summary.handshakes_failed), (1, 1));
}

#[test]
fn a_program_without_an_origin_needs_the_token() {
    let token = Some("open sesame".to_owned());
    let bench = TestService::start(TestOptions { token, ..TestOptions::default() });
    let hello = |token: Value| json!({"id": 1, "op": "hello", "version": 1, "name": "unity", "token": token});
    let mut program = Browser::asking(&bench, &[]).unwrap();
    assert_eq!(program.ask(&hello(Value::Null))["error"]["code"], "unauthorized");
    assert_eq!(program.closed(), Some(CloseCode::Normal));
    let mut program = Browser::asking(&bench, &[]).unwrap();
    assert_eq!(program.ask(&hello(json!("open says me")))["error"]["code"], "unauthorized");
    let mut program = Browser::asking(&bench, &[]).unwrap();
    assert!(program.ask(&hello(json!("open sesame")))["ok"].is_object());
    // A token in the address is none.
    let foreign = Browser::asking(&bench, &[("origin", "http://evil.example")]);
    assert_eq!(foreign.map(drop), Err(403));
}

#[test]
fn the_page_is_served_with_headers_that_keep_other_pages_out() {
    let bench = bench();
    let get = |path: &str| http(&bench, &format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", bench.web));
    let page = get("/");
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
    let (head, body) = page.split_once("\r\n\r\n").unwrap();
    for header in [
        "content-type: text/html; charset=utf-8",
        "content-security-policy: default-src 'self'",
        "x-frame-options: DENY",
        "x-content-type-options: nosniff",
        "cache-control: no-store",
        "connection: close",
    ] {
        assert!(head.lines().any(|line| line == header), "{header} in {head}");
    }
    assert!(head.contains(&format!("content-length: {}", body.len())), "{head}");
    // The policy allows no script or style in the file itself, and nothing from elsewhere.
    assert!(!body.contains("<style") && !body.contains("://"), "{body}");
    for (at, _) in body.match_indices("<script") {
        let (tag, rest) = body[at..].split_once('>').unwrap();
        assert!(tag.contains(" src=\"") && rest.starts_with("</script>"), "{tag}");
    }
    assert!(get("/page.js").contains("\r\ncontent-type: text/javascript; charset=utf-8\r\n"));
    assert!(get("/page.css").contains("\r\ncontent-type: text/css; charset=utf-8\r\n"));
    assert!(get("/../token").starts_with("HTTP/1.1 404 "));
    let host = bench.web;
    for (request, status) in [
        (format!("POST / HTTP/1.1\r\nHost: {host}\r\n\r\n"), 405),
        (format!("GET / HTTP/1.1\r\nHost: evil.example:{}\r\n\r\n", host.port()), 403),
        ("GET / HTTP/1.1\r\n\r\n".to_owned(), 400),
        (format!("GET / HTTP/1.1\r\nHost: {host}\r\nHost: {host}\r\n\r\n"), 400),
        (format!("GET /ws HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n\r\n"), 426),
        (format!("GET / HTTP/1.1\r\nHost: {host}\r\nX: {}\r\n\r\n", "x".repeat(10_000)), 431),
        ("{\"op\":\"hello\",\"version\":1,\"name\":\"x\"}\n{\"op\":\"estop\"}\r\n\r\n".to_owned(), 400),
    ] {
        let answer = http(&bench, &request);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{request}: {answer}");
    }
    let summary = bench.finish();
    assert_eq!((summary.estops, summary.requests), (0, 0));
}

#[test]
fn frames_that_are_not_agreed_end_the_connection_and_command_nothing() {
    let bench = bench();
    let megabyte = [&[0x81, 0xff, 0, 0, 0, 0, 0, 0x10, 0, 0, 1, 2, 3, 4][..], &[b'x'; 100_000]].concat();
    let compressed = text(0xc1, b"{\"op\":\"estop\"}");
    let unmasked = [&[0x81, 14][..], b"{\"op\":\"estop\"}"].concat();
    let binary = text(0x82, b"\x81\xa2op\xa5estop");
    for (bytes, code) in [
        (megabyte, CloseCode::Size),
        (compressed, CloseCode::Protocol),
        (unmasked, CloseCode::Protocol),
        (binary, CloseCode::Unsupported),
    ] {
        let mut browser = Browser::greeted(&bench);
        browser.bytes(&bytes);
        assert_eq!(browser.closed(), Some(code));
    }
    // A frame within the limit of a frame and beyond that of a request is refused as over TCP.
    let mut browser = Browser::greeted(&bench);
    let long = browser.ask(&json!({"id": 1, "op": "ping", "data": "x".repeat(5000)}));
    assert_eq!(long["error"]["code"], "too_large", "{long}");
    assert_eq!(browser.ask(&json!({"id": 2, "op": "ping"}))["id"], 2);
    let mut stranger = Browser::opened(&bench);
    assert_eq!(stranger.ask(&json!({"x": "x".repeat(5000)}))["error"]["code"], "too_large");
    assert_eq!(bench.finish().estops, 0);
}

#[test]
fn a_stop_is_found_before_its_frame_has_ended() {
    let bench = bench();
    bench.wait_for(Mode::Idle);
    let mut browser = Browser::greeted(&bench);
    // The frame announces more than it brings.
    let stop = b"{\"id\":1,\"op\":\"estop\"";
    browser.bytes(&[&[0x81, 0x80 | 60, 0, 0, 0, 0][..], stop].concat());
    bench.wait_for(Mode::Estop);
    assert_eq!(bench.finish().estops, 1);
}

#[test]
fn a_stop_behind_requests_that_wait_is_found() {
    let bounds = Bounds { requests_per_s: 20, ..TestOptions::default().bounds };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    bench.wait_for(Mode::Idle);
    let mut browser = Browser::greeted(&bench);
    for id in 0..200 {
        browser.send(&json!({"id": id, "op": "ping"}));
    }
    browser.send(&json!({"id": "stop", "op": "estop"}));
    let begun = Instant::now();
    bench.wait_for(Mode::Estop);
    assert!(begun.elapsed() < Duration::from_secs(5), "the requests before it take ten seconds");
}

#[test]
fn who_says_no_hello_has_as_long_as_over_tcp() {
    let bounds = Bounds { hello: Duration::from_millis(300), ..Bounds::default() };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    let mut silent = Browser::opened(&bench);
    assert!(silent.next()["error"]["message"].as_str().unwrap().contains("no hello"));
    assert_eq!(silent.closed(), Some(CloseCode::Normal));
    // Neither half a request nor pings prolong it.
    let mut half = JsonLines::connect(bench.web);
    half.bytes(b"GET /ws HTTP/1.1\r\nHost: ");
    assert_eq!(half.rest(), "");
    let mut pinging = Browser::opened(&bench);
    let begun = Instant::now();
    while pinging.0.get_mut().write_all(&text(0x89, b"")).is_ok() && begun.elapsed() < PATIENCE {
        // The client that trickles is what is tested.
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(begun.elapsed() < PATIENCE);
}

#[test]
fn silent_clients_are_disconnected_and_those_that_answer_pings_stay() {
    let bounds = Bounds { silence: Duration::from_millis(600), ..TestOptions::default().bounds };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    let (mut silent, mut other) = (Browser::greeted(&bench), Browser::greeted(&bench));
    let begun = Instant::now();
    other.0.get_ref().set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    while begun.elapsed() < Duration::from_millis(1800) {
        // Reading answers pings.
        match other.0.read() {
            Ok(message) => assert!(message.is_ping(), "{message:?}"),
            Err(Error::Io(_)) => {}
            Err(error) => panic!("{error}"),
        }
    }
    other.0.get_ref().set_read_timeout(Some(PATIENCE)).unwrap();
    assert_eq!(other.ask(&json!({"id": 1, "op": "ping"}))["id"], 1);
    // The pings and the reason of the end wait for the client. They are read as bytes: the library
    // would answer a ping first, and find the connection closed.
    let mut rest = Vec::new();
    silent.0.get_mut().read_to_end(&mut rest).unwrap();
    let end = [&[0x88, 20, 3, 0xf0][..], b"no answer to pings"].concat();
    assert!(rest.starts_with(&[0x89, 0, 0x89, 0]) && rest.ends_with(&end), "{rest:?}");
    eventually("one client", || bench.status.borrow().clients == 1);
}

#[test]
fn hostile_visitors_take_no_place_from_clients_over_tcp() {
    // At the pace of a real loop, a busy machine has seconds before a sample is lost.
    let breath = Duration::from_millis(1);
    let bench = TestService::start(TestOptions { breath, ..TestOptions::default() });
    let mut watcher = bench.client("watcher");
    let held: Vec<TcpStream> = (0..300)
        .map(|k| {
            let mut stream = TcpStream::connect(bench.web).unwrap();
            // A visitor that is turned away at once cannot send.
            let _ = match k % 3 {
                0 => Ok(()),
                1 => stream.write_all(b"GET /ws HTTP/1.1\r\nHost: "),
                _ => stream.write_all(&[0x16, 3, 1, 2, 0, 1, 0, 1]),
            };
            stream
        })
        .collect();
    watcher.call(Op::Ping { data: Value::Null }).unwrap();
    let mut later = bench.client("later");
    later.call(Op::Estop).unwrap();
    eventually("those beyond the places are turned away", || {
        later.stats().unwrap().connections_turned_away >= 300 - 64
    });
    drop(held);
    eventually("a place", || {
        Browser::asking(&bench, &[("origin", &format!("http://{}", bench.web))]).is_ok()
    });
    let summary = bench.finish();
    assert_eq!((summary.estops, summary.dropped_samples), (1, 0));
}

#[test]
fn a_slow_reader_loses_states_and_one_that_does_not_read_is_cut() {
    let bounds = Bounds { outgoing: 32, stuck: Duration::from_millis(300), ..TestOptions::default().bounds };
    let bench = TestService::start(TestOptions { bounds, breath: Duration::ZERO, ..TestOptions::default() });
    let mut other = Browser::greeted(&bench);
    let mut slow = Browser::greeted(&bench);
    slow.send(&json!({"id": 1, "op": "subscribe", "every": 1}));
    eventually("an end", || {
        let stats = other.ask(&json!({"id": 1, "op": "stats"}));
        stats["ok"]["dropped_states"].as_u64() > Some(0) && stats["ok"]["connections_cut"] == 1
    });
    assert_eq!(other.ask(&json!({"id": 2, "op": "ping"}))["id"], 2);
}

#[test]
fn pings_are_answered_and_a_flood_of_them_delays_nobody() {
    let bench = bench();
    let mut browser = Browser::greeted(&bench);
    browser.bytes(&text(0x89, b"abc"));
    assert_eq!(browser.0.read().unwrap(), Message::Pong(b"abc"[..].into()));
    let mut other = Browser::greeted(&bench);
    let flood = text(0x89, b"").repeat(10_000);
    let flooding = std::thread::spawn(move || {
        for _ in 0..50 {
            if browser.0.get_mut().write_all(&flood).is_err() {
                break;
            }
        }
        browser
    });
    for id in 0..50 {
        assert_eq!(other.ask(&json!({"id": id, "op": "ping"}))["id"], id);
    }
    drop(flooding.join().unwrap());
    assert_eq!(bench.finish().refused.total(), 0);
}

#[test]
fn the_hand_of_the_simulated_rig_obeys_the_holder() {
    let bench = TestService::start(TestOptions { hand: true, ..TestOptions::default() });
    let mut client = Browser::greeted(&bench);
    let hold = json!({"id": 1, "op": "hand", "q": [1, 0, 0, 0], "over_ms": 0, "stiffness": 10});
    assert_eq!(client.ask(&hold)["error"]["code"], "not_holder");
    client.ask(&json!({"id": 2, "op": "acquire"}));
    client.send(&json!({"id": 3, "op": "subscribe", "every": 1}));
    let until = |client: &mut Browser, what: &str, ready: &dyn Fn(&Value) -> bool| {
        let begun = Instant::now();
        loop {
            let message = client.next();
            if message["event"] == "state" && ready(&message) {
                return message;
            }
            assert!(begun.elapsed() < PATIENCE, "{what}");
        }
    };
    let free = until(&mut client, "a free sphere", &|_| true);
    assert_eq!(free.get("hand"), None, "no hand");
    // A turn of 0.2 rad about n3. Nothing but the hand acts on the sphere.
    let (s, c) = 0.1_f64.sin_cos();
    let mut to = |s| {
        client.send(&json!({"op": "hand", "q": [c, 0, 0, s], "over_ms": 0, "stiffness": 10, "damping": 0.3}));
        // A push lasts a few ticks, whose states a client on a busy machine may not get.
        (0..500).map(|_| client.next()).find(|state| state["hand"][2].as_f64() > Some(0.5))
    };
    let pushed = (0..20).find_map(|_| to(s).or_else(|| to(-s))).expect("a push");
    assert!(pushed["hand"][2].as_f64() < Some(10.0 * 0.4), "{pushed}");
    client.send(&json!({"op": "hand", "q": [c, 0, 0, s], "over_ms": 0, "stiffness": 10, "damping": 0.3}));
    until(&mut client, "the turn", &|state| (state["q"][3].as_f64().unwrap().abs() - s).abs() < 1e-3);
    client.send(&json!({"op": "hand", "release": true}));
    until(&mut client, "no hand", &|state| state.get("hand").is_none());
    client.send(&json!({"op": "hand", "q": [c, 0, 0, s]}));
    until(&mut client, "a hand", &|state| state.get("hand").is_some());
    // When its client does not hold the lease any more, the hand moves as the scene says: here it
    // lets go.
    let mut other = bench.client("other");
    other.call(Op::Acquire { steal: true }).unwrap();
    until(&mut client, "no hand", &|state| state.get("hand").is_none());
}

#[test]
fn a_real_rig_has_no_hand() {
    let bench = bench();
    let mut holder = bench.holder();
    let error = refused(holder.call(Op::Hand(hbot_api::HandCommand::RELEASE)));
    assert_eq!(error.code, hbot_api::ErrorCode::OutOfRange);
    assert!(error.message.contains("this rig is real"), "{}", error.message);
}
