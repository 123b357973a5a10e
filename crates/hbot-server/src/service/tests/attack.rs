//! Hostile and careless clients: the service keeps working, no sample of the loop is lost, and
//! every refusal is counted.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::super::reader::READ_AHEAD;
use super::*;

fn still_served(client: &mut Client) {
    for _ in 0..20 {
        client.call(Op::Ping { data: Value::Null }).unwrap();
    }
}

#[test]
fn a_thousand_connections_are_turned_away_and_the_first_are_served() {
    // Both ends of every connection are in this process, so it needs many descriptors.
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit }).unwrap();
    let room = limit.maximum.is_none_or(|most| most >= 2500);
    let many = if room { 1000 } else { 300 };
    // The hello time of these bounds is long, so no accepted connection gives its place up during
    // the test.
    let bench = bench();
    let mut watcher = bench.client("watcher");
    let mut held = Vec::new();
    for _ in 0..many {
        // A connection that the operating system refuses counts as turned away as well.
        held.extend(TcpStream::connect(bench.address));
    }
    still_served(&mut watcher);
    drop(held);
    eventually("a place", || Client::connect(&bench.address.to_string(), "later").is_ok());
    let summary = bench.finish();
    let (taken, away) = (summary.connections, summary.connections_turned_away);
    assert!(away >= many - Bounds::default().connections as u64, "{taken} taken, {away} turned away");
    assert_eq!(summary.dropped_samples, 0);
}

#[test]
fn one_that_sends_a_byte_now_and_then_has_no_longer_than_one_that_sends_none() {
    let bounds = Bounds { hello: Duration::from_millis(300), ..Bounds::default() };
    let bench = TestService::start(TestOptions { bounds, ..TestOptions::default() });
    let mut slow = bench.raw();
    let mut writer = slow.stream.try_clone().unwrap();
    let trickle = std::thread::spawn(move || {
        let line = b"{\"id\": 1, \"op\": \"hello\", \"version\": 1, \"name\": \"so slow that it never gets to its end\"}";
        // Sends bytes until the server has closed the connection.
        for byte in line.iter().cycle() {
            if writer.write_all(&[*byte]).is_err() {
                return;
            }
            // The client that trickles is what is tested.
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    let answer = slow.line();
    assert!(answer["error"]["message"].as_str().unwrap().contains("no hello"), "{answer}");
    slow.rest();
    trickle.join().unwrap();
    assert_eq!(bench.finish().refused.total(), 1);
}

#[test]
fn half_a_line_can_be_held_and_holds_nobody_up() {
    let bench = bench();
    let mut half: Vec<_> = (0..20).map(|_| greeted(&bench)).collect();
    for raw in &mut half {
        raw.bytes(b"{\"id\": 5, \"op\": \"pi");
    }
    still_served(&mut bench.client("other"));
    for raw in &mut half {
        raw.bytes(b"ng\"}\n");
        assert_eq!(raw.answer()["id"], 5);
    }
    assert_eq!(bench.finish().refused.total(), 0);
}

#[test]
fn garbage_is_answered_once_before_hello_and_counted_after_it() {
    let bench = bench();
    let mut watcher = bench.client("watcher");
    let garbage: Vec<u8> = (0..20_000_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let attackers: Vec<_> = (0..20)
        .map(|k| {
            let mut raw = if k % 2 == 0 { bench.raw() } else { greeted(&bench) };
            let garbage = garbage.clone();
            std::thread::spawn(move || {
                for _ in 0..20 {
                    if raw.stream.write_all(&garbage).is_err() {
                        break;
                    }
                }
                // A client that has said hello stays connected and gets an answer to each line.
                raw.stream.shutdown(std::net::Shutdown::Write).ok();
                let mut rest = Vec::new();
                let _ = raw.reader.read_to_end(&mut rest);
            })
        })
        .collect();
    still_served(&mut watcher);
    attackers.into_iter().for_each(|attacker| attacker.join().unwrap());
    still_served(&mut watcher);
    let summary = bench.finish();
    assert!(summary.refused.total() >= 20, "{:?}", summary);
    assert_eq!(summary.dropped_samples, 0);
}

#[test]
fn one_that_connects_again_and_again_is_served_and_counted_each_time() {
    let bench = bench();
    let mut watcher = bench.client("watcher");
    for k in 0..300 {
        let stream = TcpStream::connect(bench.address).unwrap();
        if k % 3 == 0 {
            // Connections end here in three ways: without a message, after a message, and by a
            // reset.
            drop(stream);
        } else {
            let mut stream = stream;
            let _ =
                stream.write_all(b"{\"id\": 1, \"op\": \"hello\", \"version\": 1, \"name\": \"again\"}\n");
        }
    }
    still_served(&mut watcher);
    bench.wait_until("the watcher alone", |status| status.clients == 1);
    let summary = bench.finish();
    assert_eq!(summary.connections + summary.connections_turned_away, 301, "{summary:?}");
}

#[test]
fn an_estop_is_never_refused_however_many_come() {
    // The loop is slowed down, so that the stops find no place in the ring.
    let bounds = Bounds { outgoing: 4096, ..TestOptions::default().bounds };
    let bench = TestService::start(TestOptions {
        bounds,
        breath: Duration::from_millis(5),
        ..TestOptions::default()
    });
    let mut raw = greeted(&bench);
    raw.bytes(&b"{\"id\": 1, \"op\": \"estop\"}\n".repeat(1000));
    for _ in 0..1000 {
        let answer = raw.answer();
        assert_eq!(answer["ok"]["mode"], "estop", "{answer}");
    }
    assert_eq!(bench.finish().refused.total(), 0);
}

#[test]
fn the_system_looks_whether_clients_are_still_there() {
    let bench = bench();
    let raw = greeted(&bench);
    let hex = |address: SocketAddr| match address {
        SocketAddr::V4(v4) => format!("{:08X}:{:04X}", u32::from_le_bytes(v4.ip().octets()), v4.port()),
        SocketAddr::V6(_) => panic!("bound to 127.0.0.1"),
    };
    let (server, client) = (hex(bench.address), hex(raw.stream.local_addr().unwrap()));
    // Columns of the table: sl, local, remote, state, queues, timer. A timer that starts with 02 is
    // the keepalive timer.
    eventually("a timer of keepalive", || {
        let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
        table.lines().any(|line| {
            let words: Vec<_> = line.split_whitespace().collect();
            words[1] == server && words[2] == client && words[5].starts_with("02:")
        })
    });
}

#[test]
fn the_page_has_the_bounds() {
    let page = include_str!("../../../../../docs/api.md");
    let Bounds {
        connections,
        local,
        unauthenticated,
        hello,
        wrong_token,
        silence,
        stuck,
        outgoing,
        requests_per_s,
    } = Bounds::default();
    for row in [
        format!(
            "| connections at a time | {connections}, of them {} from other machines |",
            connections - local
        ),
        format!(
            "without a hello at a time | {unauthenticated}, of them {} from other machines |",
            unauthenticated - local
        ),
        format!("handshake if the port is encrypted | {} s,", hello.as_secs()),
        format!("| messages that wait to be sent to a client | {outgoing} messages, 1 MiB |"),
        format!("| requests a second of one client | {},000; ", requests_per_s / 1000),
        format!("of one record) | {} s |", stuck.as_secs()),
        format!("reads up to {} KiB ahead |", READ_AHEAD / 1024),
        format!("| time until the answer to a wrong token | {} ms |", wrong_token.as_millis()),
        format!("from a WebSocket client, not even an answer to a ping | {} s |", silence.as_secs()),
        "2,048 bytes".to_owned(),
    ] {
        assert!(page.contains(&row), "{row}");
    }
    assert_eq!((hello, connections), (Duration::from_secs(2), 64));
    assert_eq!(hbot_api::MAX_SHORT_REQUEST_BYTES, 2048);
}
