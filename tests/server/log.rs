//! Whoever reads what a server says on standard error, or does not, the server goes on.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Stdio};
use std::time::Instant;

use crate::process::{Lines, PATIENCE, hbot};

/// A server that is killed at the end of a test that has not stopped it.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        // It has ended already where the test went well.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server that tells everything to a pipe.
fn start(state: &std::path::Path) -> (Server, String) {
    let mut child = hbot()
        .args(["server", "--listen", "127.0.0.1:0", "--time", "virtual"])
        .env("XDG_STATE_HOME", state)
        .env("HBOT_LOG", "debug")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    let mut out = BufReader::new(child.stdout.take().expect("piped"));
    let mut banner = String::new();
    while !banner.contains("listen") {
        assert!(out.read_line(&mut banner).expect("readable") > 0, "the server ended at start:\n{banner}");
    }
    // Nobody reads on what it says there either.
    drop(out);
    let address = banner.split_whitespace().last().expect("an address").to_owned();
    (Server(child), address)
}

/// It stops the rig, far more often than a pipe has room for lines, and ends when it is told to.
fn goes_on(mut server: Server, address: &str) {
    let mut client = Lines::greeted(address);
    for _ in 0..20 {
        client.send(&"{\"id\": 1, \"op\": \"estop\"}\n".repeat(100));
        for _ in 0..100 {
            let answer = client.until(|value| value.get("id").is_some());
            assert_eq!(answer["ok"]["mode"], "estop", "{answer}");
        }
    }
    let pid = rustix::process::Pid::from_child(&server.0);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("the server is there");
    let start = Instant::now();
    let status = loop {
        if let Some(status) = server.0.try_wait().expect("a child") {
            break status;
        }
        assert!(start.elapsed() < PATIENCE, "it does not end");
        std::thread::sleep(std::time::Duration::from_millis(5));
    };
    assert_eq!(status.code(), Some(0));
}

#[test]
fn a_log_that_nobody_reads_holds_nobody_up() {
    let state = tempfile::tempdir().expect("a folder");
    let (mut server, address) = start(state.path());
    // Open, and never read: a terminal that is held.
    let _log = server.0.stderr.take();
    goes_on(server, &address);
}

#[test]
fn a_log_whose_reader_is_gone_ends_nothing() {
    let state = tempfile::tempdir().expect("a folder");
    let (mut server, address) = start(state.path());
    drop(server.0.stderr.take());
    goes_on(server, &address);
}

#[test]
fn a_log_that_is_read_has_what_happened() {
    let state = tempfile::tempdir().expect("a folder");
    let (mut server, address) = start(state.path());
    let log = BufReader::new(server.0.stderr.take().expect("piped"));
    let reading = std::thread::spawn(move || log.lines().map_while(Result::ok).collect::<Vec<_>>());
    goes_on(server, &address);
    let lines = reading.join().expect("no panic");
    let told = |what: &str| lines.iter().filter(|line| line.contains(what)).count();
    // A machine that lets the one that writes them wait has some of them left out, and says how many.
    let left_out: usize =
        lines.iter().filter_map(|line| line.split_once(" lines are lost")?.0.parse::<usize>().ok()).sum();
    assert!(told("estop") + left_out >= 2000, "{} of {}, {left_out} left out", told("estop"), lines.len());
}
