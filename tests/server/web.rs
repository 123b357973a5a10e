//! What hostile visitors of the web port can do.

use std::io::Write as _;
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::process::*;

/// Number of hostile connections at a time.
const VISITORS: usize = 300;
/// Number of states that are seen before the visitors come. With them, it is twice that.
const STATES: usize = 2500;

/// What a visitor sends. Each is refused or waited for, and none may command.
fn greeting(k: usize, host: SocketAddr) -> Vec<u8> {
    let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let ask = |host: &str, origin: &str| {
        format!("GET /ws HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\n{upgrade}\r\n").into_bytes()
    };
    let own = ask(&host.to_string(), &format!("http://{host}"));
    match k % 7 {
        0 => ask(&host.to_string(), "http://evil.example"),
        1 => ask("evil.example:4269", "http://evil.example:4269"),
        2 => b"GET /ws HTTP/1.1\r\nHost: ".to_vec(),
        3 => vec![0x16, 3, 1, 2, 0, 1, 0, 1],
        // A frame of a megabyte, a compressed one, and requests without a hello.
        4 => [own, vec![0x81, 0xff, 0, 0, 0, 0, 0, 0x10, 0, 0, 1, 2, 3, 4]].concat(),
        5 => [own, vec![0xc1, 0x81, 0, 0, 0, 0, b'x']].concat(),
        _ => [own, [vec![0x81, 0x8e, 0, 0, 0, 0], b"{\"op\":\"estop\"}".to_vec()].concat().repeat(100)]
            .concat(),
    }
}

/// Keeps [`VISITORS`] connections open until `done`, each replaced when it is closed. Returns the
/// number of all connections.
fn visit(at: SocketAddr, done: &AtomicBool) -> usize {
    let mut count = 0;
    let mut visitors: Vec<Option<TcpStream>> = (0..VISITORS).map(|_| None).collect();
    while !done.load(Ordering::Relaxed) {
        for (k, place) in visitors.iter_mut().enumerate() {
            let open = place.as_ref().is_some_and(|stream| {
                let mut byte = [0];
                // Nothing to read yet is an error of its own kind; an end is Ok(0).
                match stream.peek(&mut byte) {
                    Ok(n) => n > 0,
                    Err(error) => error.kind() == std::io::ErrorKind::WouldBlock,
                }
            });
            if !open && let Ok(mut stream) = TcpStream::connect(at) {
                count += 1;
                let _ = stream.write_all(&greeting(k, at));
                if stream.set_nonblocking(true).is_ok() {
                    *place = Some(stream);
                }
            }
        }
        // The visitors share the processor with the loop, which goes on in the pauses.
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    count
}

fn memory(process: &Process) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.pid())).expect("a process");
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).expect("its memory");
    line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("a number")
}

#[test]
fn three_hundred_hostile_visitors_command_nothing_and_fill_no_memory() {
    let server = Process::patient(&["--web", "127.0.0.1:0"]);
    let (_, web) = server.banner.split_once("web      http://").expect("the address of the page");
    let web: SocketAddr = web.lines().next().and_then(|line| line.trim().parse().ok()).expect("an address");
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
    let mut states = |count: usize| {
        for _ in 0..count {
            let state = client.state(|_| true);
            assert_ne!(state["mode"], "estop", "no visitor may stop the rig before its hello");
        }
    };
    states(STATES);
    let before = memory(&server);
    let done = Arc::new(AtomicBool::new(false));
    let visitors = std::thread::spawn({
        let done = Arc::clone(&done);
        move || visit(web, &done)
    });
    states(2 * STATES);
    let after = memory(&server);
    let stats = client.ask(r#"{"id": 2, "op": "stats"}"#);
    done.store(true, Ordering::Relaxed);
    let connections = visitors.join().expect("no panic");
    assert!(connections >= VISITORS, "{connections}");
    assert_eq!(stats["ok"]["estops"], 0, "{stats}");
    // The buffers of the 64 connections that are served at a time, and what the allocator keeps.
    assert!(after < before + 16_000, "{before} kB, {after} kB");
}
