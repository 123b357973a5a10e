//! `hbot recover`, and `hbot controllers`: commands that need no server.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;

use crate::process::{Process, hbot};

#[test]
fn a_recording_that_was_cut_off_becomes_a_whole_one() {
    let state = tempfile::tempdir().expect("a folder");
    let [run, cut, out, text] =
        ["run.mcap", "cut.mcap", "out.mcap", "text.mcap"].map(|name| state.path().join(name));
    let args = ["--time", "virtual", "--duration", "2", "--record"];
    let server = Process::start(&[&args[..], &[run.to_str().expect("UTF-8")]].concat(), state.path());
    assert!(server.end().1.success());
    let bytes = std::fs::read(&run).expect("a recording");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).expect("written");
    std::fs::write(&text, "no recording").expect("written");
    let command =
        |args: &[&std::path::Path]| assert_cmd::Command::from_std(hbot()).arg("recover").args(args).assert();
    command(&[&cut, &out]).success().stdout(contains("had no end").and(contains("which is whole")));
    command(&[&cut, &out]).failure().stderr(contains("exists already"));
    let replayed = assert_cmd::Command::from_std(hbot()).arg("replay").arg(&out).assert();
    replayed.success().stdout(contains("every bit agrees").and(contains("cut").not()));
    std::fs::remove_file(&out).expect("removed");
    command(&[&text, &out]).failure().stderr(contains("not an MCAP file"));
    assert!(!out.exists(), "nothing is left of a failure");
}

#[test]
fn simulated_controllers_answer_a_scan_until_their_input_ends() {
    for (protocol, rig) in [("moteus", "rigs/prototype-moteus.toml"), ("hbot", "rigs/prototype.toml")] {
        let mut command = hbot();
        command.args(["controllers", "--protocol", protocol]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut controllers = command.stderr(Stdio::null()).spawn().expect("it runs");
        let mut path = String::new();
        let mut out = BufReader::new(controllers.stdout.take().expect("piped"));
        out.read_line(&mut path).expect("a path");
        let mut scan = assert_cmd::Command::from_std(hbot());
        scan.args(["rig", "scan", "--rig", rig, "--port", path.trim()]).assert().stdout(contains("4 answer"));
        drop(controllers.stdin.take());
        assert!(controllers.wait().expect("it ends").success());
    }
}
