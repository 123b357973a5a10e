//! `hbot recover`, and `hbot controllers`: commands that need no server.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::Stdio;

use predicates::str::{ends_with, starts_with};

use crate::process::*;

#[test]
fn what_can_be_read_of_a_recording_is_recovered_and_what_is_lost_stays_known() {
    let state = tempfile::tempdir().expect("a folder");
    let [run, cut, out, text] =
        ["run.mcap", "cut.mcap", "out.mcap", "text.mcap"].map(|name| state.path().join(name));
    let args = ["--time", "virtual", "--duration", "2", "--record"];
    let server = Process::start(&[&args[..], &[run.to_str().expect("UTF-8")]].concat(), state.path());
    assert!(server.end().1.success());
    let bytes = std::fs::read(&run).expect("a recording");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).expect("written");
    std::fs::write(&text, "no recording").expect("written");
    let run = |command, files: &[&std::path::Path]| {
        assert_cmd::Command::from_std(hbot()).arg(command).args(files).assert()
    };
    run("recover", &[&cut, &out]).success().stdout(contains("had no end").and(contains("all ticks after ")));
    run("recover", &[&cut, &out]).failure().stderr(contains("exists already"));
    // What is left of a cut recording agrees, which is not all. Recovered it is not more.
    let missing = "the recording is not whole: the rest is missing (exit code 1)\n";
    for file in [&cut, &out] {
        run("replay", &[file])
            .code(1)
            .stdout(contains("every bit agrees").and(ends_with(missing)))
            .stderr(contains("note cut: "));
        run("explain", &[file]).code(1).stdout(
            starts_with("all ticks after ").and(contains("nothing went wrong in what can be read: ")),
        );
    }
    std::fs::remove_file(&out).expect("removed");
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2..][..16].fill(0xff);
    std::fs::write(&cut, &damaged).expect("written");
    run("recover", &[&cut, &out]).code(1).stdout(
        contains(" of 2000 ticks (").and(contains("whole").not()).and(contains("ticks are missing (")),
    );
    std::fs::remove_file(&out).expect("removed");
    // Bytes are missing, so that no record behind them is where the lengths say.
    damaged.drain(bytes.len() / 2..bytes.len() / 2 + 5000);
    std::fs::write(&cut, &damaged).expect("written");
    run("recover", &[&cut, &out]).code(1).stdout(
        contains(" of 2000 ticks (")
            .and(contains(" cannot be read\n"))
            .and(contains("damaged: damaged").not()),
    );
    for file in [&cut, &out] {
        let known =
            contains(" s): what happened in them is not known\n").and(contains("nothing went wrong in"));
        run("explain", &[file]).code(1).stdout(known);
        run("replay", &[file]).code(1).stdout(contains("differs").not()).stderr(contains("note damaged: "));
    }
    std::fs::remove_file(&out).expect("removed");
    // Its metadata, and nothing of its first part.
    let head = bytes.len().min(15_000);
    std::fs::write(&cut, &bytes[..head]).expect("written");
    run("recover", &[&cut, &out])
        .code(1)
        .stderr(contains("nothing can be recovered: it was cut off before its first"));
    assert!(!out.exists(), "no empty recording is left");
    run("replay", &[&cut])
        .code(1)
        .stderr(contains("nothing could be replayed: no tick is readable"))
        .stdout("");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).expect("written");
    let late = assert_cmd::Command::from_std(hbot()).arg("replay").arg(&cut).args(["--from", "9"]).assert();
    late.code(1).stderr(contains("nothing could be replayed: no tick of the wanted part is readable"));
    run("recover", &[&text, &out]).failure().stderr(contains("not an MCAP file"));
    assert!(!out.exists(), "nothing is left of a failure");
}

fn controllers(args: &[&str]) -> (std::process::Child, String) {
    let mut command = hbot();
    command.arg("controllers").args(args).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut controllers = command.stderr(Stdio::null()).spawn().expect("it runs");
    let mut path = String::new();
    let mut out = BufReader::new(controllers.stdout.take().expect("piped"));
    out.read_line(&mut path).expect("a path");
    (controllers, path.trim().to_owned())
}

#[test]
fn simulated_controllers_answer_a_scan_until_their_input_ends() {
    for (protocol, rig) in [("moteus", "rigs/prototype-moteus.toml"), ("hbot", "rigs/prototype.toml")] {
        let (mut controllers, path) = controllers(&["--protocol", protocol]);
        run(&["rig", "scan", "--rig", rig, "--port", &path]).stdout(contains("4 answer"));
        drop(controllers.stdin.take());
        assert!(controllers.wait().expect("it ends").success());
    }
}

/// The simulated joints come to rest, so that they are tested one after the other and again, and a
/// hand turns the sphere when it is asked to.
#[test]
fn a_rig_is_rehearsed_on_simulated_controllers() {
    let state = tempfile::tempdir().expect("a folder");
    let rig = patient_rig(state.path());
    // A zero that was measured stays as it is.
    let drawn = std::fs::read_to_string(&rig).expect("written");
    let measured = drawn.replacen("zero = \"assume\"", "zero_offset = 0.2\nzero = \"assume\"", 1);
    let other = state.path().join("drawn.toml");
    std::fs::write(&other, drawn).expect("written");
    std::fs::write(&rig, &measured).expect("written");
    let (mut controllers, path) = controllers(&["--rig", &rig]);
    let mut hands = controllers.stdin.take().expect("piped");
    let run_as = |rig: &str, command: &str, options: &[&str]| {
        let mut program = assert_cmd::Command::from_std(hbot());
        program.args(["rig", command, "--rig", rig, "--port", &path]).args(options);
        let output = program.output().expect("it runs");
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat()
    };
    let run = |command: &str, options: &[&str]| run_as(&rig, command, options);
    // A machine that stands still for long makes controllers fall silent, and words take effect in
    // another process.
    for joint in ["1", "2", "3", "4", "1"] {
        eventually("a test of a joint", || {
            let said = run("test", &["--joint", joint, "--torque", "auto"]);
            assert!(!said.contains("it turned before"), "{said}");
            said.contains("the torque rose to")
        });
    }
    writeln!(hands, "turn").expect("it reads");
    eventually("a calibration", || {
        run("calibrate", &["--seconds", "5", "--write", &rig]).contains("nothing to write into the rig file")
    });
    assert_eq!(std::fs::read_to_string(&rig).expect("written"), measured);
    eventually("another zero is found", || {
        let said = run_as(other.to_str().expect("UTF-8"), "calibrate", &["--seconds", "5"]);
        said.contains("wheel A (wheel[0]): steering zero off by +0.")
            && said.contains("wheel[0].steer.zero_offset = ")
            && !said.contains("wheel[1].steer.zero_offset")
    });
    writeln!(hands, "free\nunplug").expect("it reads");
    eventually("the line is cut", || run("scan", &[]).contains("no answer"));
    drop(hands);
    assert!(controllers.wait().expect("it ends").success());
}
