//! `hbot study` as a command: exit codes, and what Ctrl-C leaves.

use std::process::Stdio;
use std::time::{Duration, Instant};

use predicates::str::contains;
use rustix::process::{Pid, Signal, kill_process};

use crate::process::hbot;

#[test]
fn a_study_ends_well_and_says_where_its_report_is() {
    let folder = tempfile::tempdir().expect("a folder");
    assert_cmd::Command::from_std(hbot())
        .args(["study", "accuracy", "--quick", "--out"])
        .arg(folder.path())
        .timeout(Duration::from_secs(120))
        .assert()
        .success()
        .stdout(contains("report.html"));
    let summary = std::fs::read_to_string(folder.path().join("summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["study"], "accuracy");
}

#[test]
fn ctrl_c_ends_a_study_at_once_with_nothing_half_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let mut child = hbot()
        .args(["study", "stability", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    // Long enough for it to be at work; the whole takes more than ten times as long.
    std::thread::sleep(Duration::from_secs(1));
    let pid = Pid::from_child(&child);
    kill_process(pid, Signal::INT).expect("a signal");
    let asked = Instant::now();
    let status = child.wait().expect("it ends");
    assert_eq!(status.code(), Some(130));
    // It looks between two steps of a second at most, on a busy machine.
    assert!(asked.elapsed() < Duration::from_secs(20));
    assert!(!out.exists());
}
