//! What hostile visitors of the web port cost the loop.

use std::io::Write as _;
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use hbot_testing::lines::JsonLines;

use crate::process::{Process, patient_rig};

/// Number of hostile connections at a time.
const VISITORS: usize = 300;
/// Number of states of each of the four parts of the measurement, which take turns.
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

/// Keeps [`VISITORS`] connections open while `on` is true, each replaced when it is closed. Counts
/// the connections.
fn visit(at: SocketAddr, on: &AtomicBool, done: &AtomicBool, count: &AtomicU64) {
    let mut visitors: Vec<Option<TcpStream>> = (0..VISITORS).map(|_| None).collect();
    while !done.load(Ordering::Relaxed) {
        for (k, place) in visitors.iter_mut().enumerate() {
            if !on.load(Ordering::Relaxed) {
                *place = None;
                continue;
            }
            let open = place.as_ref().is_some_and(|stream| {
                let mut byte = [0];
                // Nothing to read yet is an error of its own kind; an end is Ok(0).
                match stream.peek(&mut byte) {
                    Ok(n) => n > 0,
                    Err(error) => error.kind() == std::io::ErrorKind::WouldBlock,
                }
            });
            if !open && let Ok(mut stream) = TcpStream::connect(at) {
                count.fetch_add(1, Ordering::Relaxed);
                let _ = stream.write_all(&greeting(k, at));
                if stream.set_nonblocking(true).is_ok() {
                    *place = Some(stream);
                }
            }
        }
        // The visitors share the processor with the loop. A pause keeps them from being measured
        // in its place.
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

/// Returns the memory of a process, kB.
fn memory(process: &Process) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.pid())).expect("a process");
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).expect("its memory");
    line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("a number")
}

/// Returns the value below which the part `share` of the values is.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

/// The lateness is printed and not asserted: it is that of the machine on which the test runs.
#[test]
fn three_hundred_hostile_visitors_command_nothing_and_fill_no_memory() {
    let state = tempfile::tempdir().expect("a folder");
    let server = Process::start(&["--rig", &patient_rig(state.path()), "--web", "127.0.0.1:0"], state.path());
    let (_, web) = server.banner.split_once("web      http://").expect("the address of the page");
    let web: SocketAddr = web.lines().next().and_then(|line| line.trim().parse().ok()).expect("an address");
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
    let (on, done, count) =
        (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let visitors = {
        let (on, done, count) = (Arc::clone(&on), Arc::clone(&done), Arc::clone(&count));
        std::thread::spawn(move || visit(web, &on, &done, &count))
    };
    let mut lateness = [Vec::new(), Vec::new()];
    let mut kb = [0; 2];
    for part in 0..4 {
        let attacked = part % 2 == 1;
        on.store(attacked, Ordering::Relaxed);
        for k in 0..STATES {
            let state = client.state(|_| true);
            assert_ne!(state["mode"], "estop", "no visitor may stop the rig before its hello");
            // The first states are those of the change.
            if k > STATES / 10 {
                let us = state["timing"]["lateness_us"].as_f64().expect("a number");
                lateness[usize::from(attacked)].push(us);
            }
        }
        kb[usize::from(attacked)] = memory(&server);
    }
    let stats = client.ask(r#"{"id": 2, "op": "stats"}"#);
    done.store(true, Ordering::Relaxed);
    visitors.join().expect("no panic");
    let connections = count.load(Ordering::Relaxed);
    let [calm, attacked] = lateness.map(|mut us| [0.5, 0.99].map(|share| quantile(&mut us, share)));
    println!(
        "lateness of the loop, us, median and 99 %: {calm:.1?} without visitors, {attacked:.1?} with {VISITORS} hostile \
         ones, ratio of the medians {:.2}; {connections} connections; memory {} kB before and {} kB after",
        attacked[0] / calm[0],
        kb[0],
        kb[1]
    );
    assert!(connections >= VISITORS as u64, "{connections}");
    assert_eq!(stats["ok"]["estops"], 0, "{stats}");
    // The buffers of the 64 connections that are served at a time, and what the allocator keeps.
    assert!(kb[1] < kb[0] + 16_000, "{kb:?} kB");
}
