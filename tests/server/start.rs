//! A server on external motor controllers, before anybody enables it, and motor controllers that it
//! refuses.

use hbot_testing::far::Far;
use std::path::Path;

use hbot_config::RigConfig;
use hbot_link::Command;

use crate::process::*;

fn a_while(client: &mut JsonLines) -> serde_json::Value {
    let from = client.state(|_| true)["tick"].as_u64().expect("a tick");
    client.state(|state| state["tick"].as_u64().is_some_and(|tick| tick > from + 1000))
}

fn watched(server: &Process) -> JsonLines {
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "subscribe", "every": 20}"#);
    client
}

#[test]
fn a_server_that_is_started_or_started_again_gives_no_torque_until_somebody_enables_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = patient_rig(folder.path());
    let far = Far::start(&RigConfig::from_path(Path::new(&rig)).expect("a rig"));
    // The scene always outputs torque, so that only the mode prevents it.
    let args = ["--rig", &rig, "--port", &far.path, "--scene", &push_scene(folder.path())];
    let start = || Process::start(&args, folder.path());

    let server = start();
    let mut client = watched(&server);
    // A machine that stood still for 20 ms has caused a deadline fault, in which there is no torque
    // either.
    let state = a_while(&mut client);
    assert!(state["mode"] == "idle" || state["mode"] == "fault", "{state}");
    let enabled = |command: &Command| command.enable;
    assert!(!far.any_after(0, enabled), "motors on that nobody asked for");
    client.ask(r#"{"id": 2, "op": "acquire"}"#);
    push(&mut client, || far.pushed());
    // The PC loses power while the motors make torque. Then the server is started again.
    server.signal(Signal::KILL);
    server.end();
    // The line still holds commands of the first server. The last of them is the last word, from
    // its helper.
    eventually("motors off", || !far.any_after(far.count() - 1, enabled));
    let before = far.count();
    let server = start();
    let mut client = watched(&server);
    let state = a_while(&mut client);
    assert!(state["mode"] == "idle" || state["mode"] == "fault", "{state}");
    // There is one command per tick. A busy machine skips some, and the line can delay the last
    // ones.
    let stats = client.ask(r#"{"id": 5, "op": "stats"}"#);
    let skipped = stats["ok"]["skipped_ticks"].as_u64().expect("a count") as usize;
    let what =
        format!("{} commands and {skipped} skipped ticks after the first {before}", 1000 - skipped.min(1000));
    eventually(&what, || far.count() + skipped >= before + 1000);
    assert!(!far.any_after(before, enabled), "it goes on by itself");
}

/// The default address of the page can be taken, for example by another server.
#[test]
fn a_server_whose_default_web_port_is_taken_goes_on_without_it() {
    // Whether this succeeds or not, the port is taken.
    let _taken = std::net::TcpListener::bind(("127.0.0.1", 4269));
    let server = Process::with(&[]);
    assert!(!server.banner.contains("http://"), "{}", server.banner);
    a_while(&mut watched(&server));
    server.signal(Signal::TERM);
    let (told, _) = server.end();
    assert_eq!(told.matches("no page is served: 127.0.0.1:4269").count(), 1, "{told}");
    let off = Process::with(&["--web", "off"]);
    assert!(!off.banner.contains("http://"), "{}", off.banner);
    let own = Process::with(&["--web", "127.0.0.1:0"]);
    let (_, at) = own.banner.split_once("\n  web      http://").expect("the address of the page");
    let mut page = JsonLines::connect(at.lines().next().expect("an address").to_owned());
    let host = page.stream.peer_addr().expect("an address");
    page.bytes(format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes());
    assert!(page.rest().starts_with("HTTP/1.1 200 OK"), "the page");
}

#[test]
fn a_port_that_a_server_has_open_is_no_other_programs() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = patient_rig(folder.path());
    let far = Far::start(&RigConfig::from_path(Path::new(&rig)).expect("a rig"));
    let server = Process::start(&["--rig", &rig, "--port", &far.path], folder.path());
    for command in [
        &["server", "--listen", "127.0.0.1:0"][..],
        &["rig", "test", "--joint", "1", "--torque", "0.01"],
        &["rig", "calibrate", "--seconds", "5"],
    ] {
        let which = ["--rig", &rig, "--port", &far.path];
        run(&[command, &which].concat())
            .failure()
            .stderr(contains("another program has it open").and(contains(far.path.as_str())));
    }
    // The first server continues.
    a_while(&mut watched(&server));
    assert!(!far.any_after(0, |command| command.enable));
}

#[test]
fn controllers_of_another_rig_than_the_files_are_refused_before_any_motor_is_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let far = Far::start(&RigConfig::prototype());
    let counts = folder.path().join("counts.toml");
    let prototype = include_str!("../../rigs/prototype.toml");
    let other = prototype.replacen("counts_per_turn = 16384", "counts_per_turn = 4096", 1);
    assert_ne!(other, prototype, "the prototype's counts are written otherwise");
    std::fs::write(&counts, other).expect("written");
    for (rig, why) in [
        (
            counts.to_str().expect("UTF-8"),
            "joint 1: its controller counts 16384 a turn, the rig file says 4096",
        ),
        ("rigs/three_wheels.toml", "have 4 joints, the rig file 6 there"),
    ] {
        for command in [
            &["server", "--listen", "127.0.0.1:0"][..],
            &["rig", "test", "--joint", "1", "--torque", "0.01"],
            &["rig", "calibrate", "--seconds", "5"],
        ] {
            let which = ["--rig", rig, "--port", &far.path];
            run(&[command, &which].concat()).failure().stderr(contains(why).and(contains("correct")));
        }
    }
    assert!(!far.any_after(0, |command| command.enable));
}

#[test]
fn a_rig_file_that_is_edited_while_the_server_runs_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = patient_rig(folder.path());
    let server = Process::start(&["--rig", &rig, "--time", "virtual"], folder.path());
    let mut client = watched(&server);
    let limit =
        |client: &mut JsonLines| client.ask(r#"{"id": 5, "op": "info"}"#)["ok"]["limits"]["torque"].clone();
    assert_eq!(limit(&mut client), 0.9);
    let edited = std::fs::read_to_string(&rig).expect("readable").replace("torque = 0.9 ", "torque = 0.1 ");
    std::fs::write(&rig, edited).expect("written");
    a_while(&mut client);
    assert_eq!(limit(&mut client), 0.9);
    // SIGHUP, which other programs take as a request to read their files again, ends the server.
    server.signal(Signal::HUP);
    client.until(|event| event["event"] == "stopping");
    assert_eq!(server.end().1.code(), Some(0));
}
