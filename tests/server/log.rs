//! The server keeps running whether or not anybody reads its messages on standard error.

use hbot_testing::patience::until;
use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use crate::output::{closed, stuck};
use crate::process::*;

/// Starts a server that logs everything to `log`.
fn start(state: &std::path::Path, log: impl Fn() -> Stdio) -> Mute {
    Mute::start(state, |command| {
        command.env("HBOT_LOG", "debug").stdout(closed()).stderr(log());
    })
}

/// Asserts that the server still works: it stops the rig far more often than a pipe has room for
/// lines, and ends on request.
fn goes_on(mut server: Mute) {
    let mut client = JsonLines::greeted(&server.address);
    for _ in 0..20 {
        client.bytes("{\"id\": 1, \"op\": \"estop\"}\n".repeat(100).as_bytes());
        for _ in 0..100 {
            let answer = client.until(|value| value.get("id").is_some());
            assert_eq!(answer["ok"]["mode"], "estop", "{answer}");
        }
    }
    let pid = rustix::process::Pid::from_child(&server.child.0);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("the server is there");
    let status = until("it ends", || server.child.0.try_wait().expect("a child"));
    assert_eq!(status.code(), Some(0));
}

#[test]
fn a_log_that_nobody_reads_holds_nobody_up() {
    let state = tempfile::tempdir().expect("a folder");
    // The pipe is open and never read, like a terminal that is held.
    let (_reader, writer) = stuck();
    goes_on(start(state.path(), || writer.try_clone().expect("a pipe").into()));
}

#[test]
fn a_wish_that_is_not_understood_is_told_and_the_log_is_as_without_it() {
    for wish in ["garbage", "warn,hbot_server=loud"] {
        let state = tempfile::tempdir().expect("a folder");
        let log = state.path().join("log");
        let server = Mute::start(state.path(), |command| {
            let log = std::fs::File::create(&log).expect("a file");
            command.env("HBOT_LOG", wish).stdout(closed()).stderr(log);
        });
        goes_on(server);
        let text = std::fs::read_to_string(&log).expect("a log");
        assert!(
            text.lines().next().is_some_and(
                |line| line.contains("HBOT_LOG") && line.contains(wish.rsplit(',').next().unwrap())
            ),
            "{text}"
        );
        assert!(text.contains("estop"), "warnings are logged: {text}");
    }
}

#[test]
fn a_folder_of_flight_logs_that_cannot_be_made_is_told_at_start() {
    let state = tempfile::tempdir().expect("a folder");
    std::fs::write(state.path().join("hbot"), "in the way").expect("written");
    let server = Process::start(&["--time", "virtual", "--duration", "1"], state.path());
    let (said, status) = server.end();
    assert_eq!(status.code(), Some(0));
    assert!(said.contains("no flight logs can be written to") && said.contains("hbot/flight"), "{said}");
}

#[test]
fn a_log_that_is_read_has_what_happened() {
    let state = tempfile::tempdir().expect("a folder");
    let mut server = start(state.path(), Stdio::piped);
    let log = BufReader::new(server.child.0.stderr.take().expect("piped"));
    let reading = std::thread::spawn(move || log.lines().map_while(Result::ok).collect::<Vec<_>>());
    goes_on(server);
    let lines = reading.join().expect("no panic");
    let told = |what: &str| lines.iter().filter(|line| line.contains(what)).count();
    // If the machine lets the writer of the log wait, some lines are lost, and the log says how
    // many.
    let left_out: usize =
        lines.iter().filter_map(|line| line.split_once(" lines are lost")?.0.parse::<usize>().ok()).sum();
    assert!(told("estop") + left_out >= 2000, "{} of {}, {left_out} left out", told("estop"), lines.len());
}
