//! Output that cannot be written: the reader has closed the pipe, the reader does not read, or the
//! device is full.

use std::fs::{File, OpenOptions};
use std::io::{PipeReader, PipeWriter, Write as _, pipe};
use std::process::{Output, Stdio};

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use crate::process::*;

const FULL: &str = "error: standard output cannot be written: No space left on device (os error 28)";

const ALONE: [&[&str]; 7] = [
    &["--help"],
    &["scene", "--help"],
    &["--version"],
    &["scene", "list"],
    &["scene", "list", "--json"],
    &["scene", "check", "scenes/notched-dial.toml"],
    &["rig", "check"],
];

fn full() -> File {
    OpenOptions::new().write(true).open("/dev/full").expect("Linux has it")
}

pub(crate) fn closed() -> PipeWriter {
    pipe().expect("a pipe").1
}

/// Returns a full pipe whose reading end is open but never read. It accepts no further byte.
pub(crate) fn stuck() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = pipe().expect("a pipe");
    let flags = fcntl_getfl(&writer).expect("flags");
    fcntl_setfl(&writer, flags | OFlags::NONBLOCK).expect("flags");
    while writer.write(&[b'.'; 512]).is_ok() {}
    // Writers that share the pipe block again.
    fcntl_setfl(&writer, flags).expect("flags");
    (reader, writer)
}

fn run(args: &[&str], out: impl Into<Stdio>) -> (Option<i32>, String) {
    let Output { status, stderr, .. } =
        hbot().args(args).stdout(out).stderr(Stdio::piped()).output().expect("it runs");
    (status.code(), String::from_utf8(stderr).expect("UTF-8"))
}

fn says_that_it_is_full(args: &[&str]) {
    assert_eq!(run(args, full()), (Some(1), format!("{FULL}\n")), "{args:?}");
}

#[test]
fn a_full_device_is_one_line_and_exit_code_1() {
    for args in ALONE {
        says_that_it_is_full(args);
    }
    says_that_it_is_full(&["doctor", "--seconds", "1"]);
}

#[test]
fn a_reader_who_has_gone_away_changes_nothing_but_what_is_said() {
    let state = tempfile::tempdir().expect("a folder");
    let slow = include_str!("../../rigs/prototype.toml").replace("\"sim\"", "\"/dev/ttyUSB0\"");
    let slow = slow.replace("baud = ", "baud = 9600 # ");
    let path = state.path().join("slow.toml");
    std::fs::write(&path, slow).expect("written");
    let slow = ["rig", "check", path.to_str().expect("UTF-8")];
    assert_eq!(run(&slow, Stdio::null()).0, Some(1), "a line that is too slow for its rig");
    for args in ALONE.into_iter().chain([&slow[..]]) {
        assert_eq!(run(args, closed()), run(args, Stdio::null()), "{args:?}");
    }
}

#[test]
fn a_wrong_command_line_is_2_though_nobody_reads_why() {
    let Output { status, .. } = hbot().arg("no-such-command").stderr(closed()).output().expect("it runs");
    assert_eq!(status.code(), Some(2));
    let Output { status, .. } =
        hbot().args(["scene", "check", "no-such-file"]).stderr(full()).output().expect("it runs");
    assert_eq!(status.code(), Some(1));
}

#[test]
fn clients_of_a_server_too() {
    let server = Process::with(&["--time", "virtual"]);
    let commands: [&[&str]; 6] = [
        &["estop"],
        &["reset"],
        &["disable"],
        &["scene", "load", "scenes/notched-dial.toml"],
        &["watch"],
        &["watch", "--json"],
    ];
    for args in commands {
        let args = [args, &["--server", &server.address]].concat();
        let (code, said) = run(&args, closed());
        // That the rig has no torque is told on standard error.
        let untold = said.is_empty() || args[0] == "scene" && said.starts_with("idle: ");
        assert!(code == Some(0) && untold, "{args:?}: {code:?}, {said}");
        if args[0] == "estop" {
            let said = FULL.replace("error: ", "error: the rig is stopped, but this cannot be told: ");
            let (code, told) = run(&args, full());
            // On a busy machine the wait for the confirmation is told before.
            assert!(code == Some(1) && told.ends_with(&format!("{said}\n")), "{code:?}, {told}");
        } else {
            says_that_it_is_full(&args);
        }
    }
    server.signal(Signal::TERM);
    assert!(server.end().1.success());
}

/// Asserts that the server keeps ticking, performs an emergency stop, and ends cleanly on request.
fn serves(mut server: Mute) {
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 10}"#);
    let first = client.state(|_| true)["tick"].as_u64().expect("a tick");
    client.state(|state| state["tick"].as_u64().is_some_and(|tick| tick > first + 1000));
    // Each of these requests writes a line to the log.
    for id in 2..12 {
        client.ask(&format!(r#"{{"id": {id}, "op": "estop"}}"#));
    }
    client.state(|state| state["mode"] == "estop");
    kill_process(Pid::from_child(&server.child.0), Signal::TERM).expect("it is there");
    assert_eq!(server.child.0.wait().expect("it ends").code(), Some(0));
}

#[test]
fn a_server_goes_on_where_its_output_is_full_and_says_so_once() {
    let state = tempfile::tempdir().expect("a folder");
    let log = state.path().join("log");
    let server = Mute::start(state.path(), |command| {
        command.stdout(full()).stderr(File::create(&log).expect("a file"));
    });
    serves(server);
    let log = std::fs::read_to_string(&log).expect("a log");
    // Messages were due at start and at the end.
    let said: Vec<&str> = log.lines().filter(|line| line.contains("standard output")).collect();
    assert_eq!(said.len(), 1, "{log}");
    assert!(said[0].contains("No space left on device"), "{log}");
    assert!(log.contains("estop"), "{log}");
}

/// A service that waited for the reader of its log would not receive an emergency stop.
#[test]
fn a_server_goes_on_where_its_output_and_log_are_full_closed_or_not_read() {
    let (_reader, writer) = stuck();
    let unread = || writer.try_clone().expect("a pipe");
    let outputs: [(&str, &dyn Fn() -> Stdio); 3] =
        [("full", &|| full().into()), ("closed", &|| closed().into()), ("not read", &|| unread().into())];
    for (name, output) in outputs {
        println!("{name}");
        let state = tempfile::tempdir().expect("a folder");
        serves(Mute::start(state.path(), |command| {
            command.stdout(output()).stderr(output());
        }));
    }
}
