//! `hbot explain` tells what happened before a fault, from a recording and from a flight log.

use std::path::Path;

use predicates::str::starts_with;
use serde_json::Value;

use crate::process::*;

fn explain(args: &[&str]) -> assert_cmd::assert::Assert {
    run(&[&["explain"], args].concat())
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A constant torque spins a sphere that nobody holds, until it is too fast.
#[test]
fn an_overspeed_is_told_in_ten_lines_and_drawn() {
    let state = tempfile::tempdir().expect("a folder");
    let [scene, run, plot] = ["push.toml", "run.mcap", "fault.svg"].map(|name| state.path().join(name));
    let push =
        "name = \"Push\"\n[[effect]]\nid = \"push\"\nkind = \"constant\"\ntorque = [0, 0.4, 0]\n[simulate]\n";
    std::fs::write(&scene, push).expect("written");
    let args = ["--time", "virtual", "--duration", "4", "--scene", text(&scene), "--record", text(&run)];
    assert!(Process::start(&args, state.path()).end().1.success());
    let said = explain(&[text(&run), "--plot", text(&plot)]).success();
    let said = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    assert!(said.starts_with("overspeed at "), "{said}");
    for words in ["cause ", "up to 30.", "(limit 30 rad/s)", "torque     up to 0.4", "scene      Push, since"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(said.lines().count() <= 12, "{said}");
    let picture = std::fs::read_to_string(plot).expect("a picture");
    assert!(picture.contains("\nBefore overspeed\n") && picture.contains("rate of the sphere, rad/s"));
    // The flight log tells the same, named as the server names it.
    let logs = std::fs::read_dir(state.path().join("hbot/flight")).expect("flight logs");
    let log = logs
        .map(|entry| entry.expect("a file").path())
        .find(|path| path.extension().is_some_and(|e| e == "csv"));
    let log = log.expect("a flight log");
    let copy = state.path().join("copy.csv");
    std::fs::copy(&log, &copy).expect("copied");
    explain(&[text(&copy)])
        .failure()
        .stderr(contains("a flight log is two files").and(contains("copy.mcap")));
    explain(&[text(&log)])
        .success()
        .stdout(contains("overspeed at ").and(contains("cause ")).and(contains("Push")));
    let other = state.path().join("other.toml");
    std::fs::write(&other, include_str!("../../rigs/three_wheels.toml")).expect("written");
    explain(&[text(&run), "--rig", text(&other)])
        .failure()
        .stderr(contains("the recording is of another rig: it has 4 joints"));
    explain(&[text(&run), "--number", "2"]).failure().stderr(contains("fault 2 is not in it; legal: 1 to 1"));
    // Without a file, the newest flight log is explained.
    let mut newest = hbot();
    newest.arg("explain").env("XDG_STATE_HOME", state.path());
    assert_cmd::Command::from_std(newest).assert().success().stdout(contains("overspeed at "));
}

/// Of several faults the last is explained: that for which a flight log was written.
#[test]
fn the_last_of_several_faults_is_explained() {
    let state = tempfile::tempdir().expect("a folder");
    let run = state.path().join("run.mcap");
    let server = Process::start(&["--time", "virtual", "--record", text(&run)], state.path());
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "acquire"}"#);
    client.ask(r#"{"id": 2, "op": "advance", "ticks": 700}"#);
    for (op, ticks) in [("estop", 10), ("reset", 10), ("enable", 700)] {
        client.ask(&format!(r#"{{"id": 3, "op": "{op}"}}"#));
        client.ask(&format!(r#"{{"id": 4, "op": "advance", "ticks": {ticks}}}"#));
    }
    client.ask(r#"{"id": 5, "op": "load_scene", "scene": {"simulate": {"link": {"loss": 1.0}}}}"#);
    client.ask(r#"{"id": 6, "op": "advance", "ticks": 200}"#);
    server.signal(Signal::INT);
    assert!(server.end().1.success());
    let second = contains("fault or stop 2 of 2 in the recording; --number N explains another one");
    explain(&[text(&run)]).success().stdout(starts_with("link_lost at ")).stderr(second);
    explain(&[text(&run), "--number", "1"]).success().stdout(starts_with("estop at "));
}

/// The log of a fault of a stopped rig does not show what stopped it. The one before does.
#[test]
fn the_newest_log_that_begins_before_its_stop_is_explained() {
    let state = tempfile::tempdir().expect("a folder");
    let server = Process::start(&["--time", "virtual"], state.path());
    let mut client = JsonLines::greeted(&server.address);
    let mut ask = |line: &str| {
        let answer = client.ask(line);
        assert!(answer["ok"].is_object(), "{line}: {answer}");
        answer["ok"].clone()
    };
    ask(r#"{"id": 1, "op": "acquire"}"#);
    ask(r#"{"id": 2, "op": "advance", "ticks": 700}"#);
    ask(r#"{"id": 3, "op": "estop"}"#);
    let until = |ask: &mut dyn FnMut(&str) -> Value, mode: &str| loop {
        ask(r#"{"id": 4, "op": "advance", "ticks": 10}"#);
        let told = ask(r#"{"id": 5, "op": "info"}"#);
        if told["mode"] == mode {
            break told;
        }
    };
    until(&mut ask, "estop");
    // The recording of a log begins at a stored state of the law. In virtual time, 9,000 ticks can
    // lie between two of them.
    ask(r#"{"id": 6, "op": "advance", "ticks": 12000}"#);
    ask(r#"{"id": 7, "op": "load_scene", "scene": {"simulate": {"link": {"loss": 1.0}}}}"#);
    let told = until(&mut ask, "fault");
    ask(r#"{"id": 8, "op": "advance", "ticks": 200}"#);
    server.signal(Signal::INT);
    assert!(server.end().1.success());
    let logs = std::fs::read_dir(state.path().join("hbot/flight")).expect("flight logs");
    let mut logs: Vec<_> = logs.map(|entry| entry.expect("a file").path()).collect();
    logs.sort();
    let [first, recording, late, _] = &logs[..] else { panic!("{logs:?}") };
    assert_eq!(told["incident"]["flight_log"], text(first));
    let mut newest = hbot();
    newest.arg("explain").env("XDG_STATE_HOME", state.path());
    assert_cmd::Command::from_std(newest)
        .assert()
        .success()
        .stdout(starts_with("estop at "))
        .stderr(contains(text(first)));
    explain(&[text(late)])
        .code(1)
        .stderr(contains("stopped from the first state on").and(contains(text(first))));
    // A recording that is still being written is waited for.
    let aside = state.path().join("aside");
    std::fs::rename(recording, &aside).expect("renamed");
    let log = std::fs::File::options().append(true).open(first).expect("a log");
    log.set_modified(std::time::SystemTime::now()).expect("its time");
    std::thread::scope(|threads| {
        threads.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(500));
            std::fs::rename(&aside, recording).expect("renamed");
        });
        explain(&[text(first)]).success().stdout(starts_with("estop at "));
    });
}

#[test]
fn a_recording_without_a_fault_says_that_nothing_went_wrong() {
    let state = tempfile::tempdir().expect("a folder");
    let run = state.path().join("run.mcap");
    let args = ["--time", "virtual", "--duration", "1", "--record", text(&run)];
    assert!(Process::start(&args, state.path()).end().1.success());
    let said = contains("nothing went wrong: no fault and no emergency stop in ");
    explain(&[text(&run)]).success().stdout(said.and(contains("(limit 30 rad/s)")));
    explain(&[text(&run), "--number", "2"]).failure().stderr(contains("it has none"));
    // Where nothing can be replayed, no empty recording is left.
    let [out, scene] = ["other.mcap", "other.toml"].map(|name| state.path().join(name));
    std::fs::write(&scene, "name = \"Nothing\"\n").expect("written");
    let args = ["replay", text(&run), "--from", "50", "--scene", text(&scene), "--out", text(&out)];
    let replay = || crate::process::run(&args);
    replay().failure().stderr(contains("no exact inputs in the wanted part"));
    assert!(!out.exists());
    // Nor on a disk that takes the head of the file and not its end.
    let limit = "trap '' XFSZ; ulimit -f 64; exec \"$0\" \"$@\"";
    let mut full = assert_cmd::Command::new("sh");
    full.args(["-c", limit])
        .arg(hbot().get_program())
        .args(args.iter().filter(|arg| !arg.contains("50") && **arg != "--from"));
    full.assert().code(1).stderr(contains("other.mcap"));
    assert!(!out.exists());
    // A server that was killed leaves a recording without its end.
    let bytes = std::fs::read(&run).expect("the recording");
    std::fs::write(&run, &bytes[..bytes.len() * 2 / 3]).expect("written");
    replay().failure().stderr(contains("cut"));
    assert!(!out.exists());
    explain(&[text(&run)]).code(1).stdout(
        contains(", because the recording was cut off: what happened in them is not known\n")
            .and(contains("nothing went wrong in what can be read: no fault")),
    );
}

/// A client does not have the rig file, but what `info` says of the rig.
#[test]
fn a_recording_of_a_client_is_told_with_the_limits_of_its_rig() {
    let server = Process::altered("speed = 30 ", "speed = 25 ");
    let file = server.folder().join("run.mcap");
    let record = ["record", text(&file), "--server", &server.address, "--every", "10", "--duration", "1"];
    crate::process::run(&record).success();
    let said = contains("(limit 25 rad/s)").and(contains(" states)"));
    explain(&[text(&file)]).success().stdout(said);
}
