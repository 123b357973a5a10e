//! The program `hbot-study`: its exit codes, and the files left after Ctrl-C.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use hbot_testing::patience::eventually;
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;
use rustix::process::{Pid, Signal, kill_process};

use crate::design::study;

/// Returns a command that runs the program under test, `hbot-study`.
fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_hbot-study"))
}

/// The program's figures, report and rig files are those of the run in this process, to the last
/// digit.
#[test]
fn a_study_ends_well_says_where_its_report_is_and_gives_the_same_figures_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (first, before) = study();
    let plot = first.chief_plot();
    assert_cmd::Command::from_std(program())
        .args(["design", "--quick", "--out"])
        .arg(folder.path())
        .timeout(Duration::from_secs(600))
        .assert()
        .success()
        .stdout(contains("In short\n- ").and(contains(first.verdict())))
        .stdout(contains("report.html").and(contains(plot)));
    let read = |folder: &Path, name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
    let [again, first] = [folder.path(), before.path()].map(|folder| {
        serde_json::from_str::<serde_json::Value>(&read(folder, "summary.json")).expect("JSON")
    });
    for part in ["study", "in_short", "results", "checks"] {
        assert!(first[part] != serde_json::Value::Null, "{part}");
        assert_eq!(again[part], first[part], "{part}");
    }
    let mut files = 0;
    for entry in std::fs::read_dir(before.path()).expect("a folder") {
        let name = entry.expect("an entry").file_name();
        let name = name.to_str().expect("UTF-8");
        if name.ends_with(".toml") || name.ends_with(".svg") {
            assert_eq!(read(folder.path(), name), read(before.path(), name), "{name}");
            files += 1;
        }
    }
    assert!(files > 15, "{files}");
}

/// The study would take minutes. It does not begin.
#[test]
fn a_study_that_cannot_write_says_so_at_its_start() {
    let file = tempfile::NamedTempFile::new().expect("a file");
    assert_cmd::Command::from_std(program())
        .args(["stability", "--out"])
        .arg(file.path())
        .timeout(Duration::from_secs(60))
        .assert()
        .failure()
        .stdout("")
        .stderr(contains("is a file, not a folder").and(contains("the linear border").not()));
}

#[test]
fn ctrl_c_ends_a_study_at_once_with_nothing_half_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let mut child = program()
        .args(["stability", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        // Nobody reads the progress lines, which must not hinder the study.
        .stderr(std::io::pipe().expect("a pipe").1)
        .spawn()
        .expect("it starts");
    let pid = Pid::from_child(&child);
    eventually("it hears the signal", || catches_interrupt(child.id()));
    // The whole takes more than ten times as long.
    eventually("it is at work", || processor_time(child.id()) > 1.0);
    kill_process(pid, Signal::INT).expect("a signal");
    let asked = Instant::now();
    let status = child.wait().expect("it ends");
    assert_eq!(status.code(), Some(130));
    // The bound allows for a busy machine.
    assert!(asked.elapsed() < Duration::from_secs(20));
    assert!(!out.exists());
}

/// Returns the processor time that all threads of a process have used, s. It reads this from /proc.
fn processor_time(process: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("it runs");
    // After the name in parentheses, from the state on; Linux counts in hundredths for all
    // programs.
    let fields = stat.rsplit_once(')').expect("a name").1.split_whitespace();
    let [user, system] = [11, 12].map(|n| fields.clone().nth(n).and_then(|ticks| ticks.parse::<f64>().ok()));
    0.01 * (user.expect("a number") + system.expect("a number"))
}

/// Returns whether a process handles the signal SIGINT. It reads the signal mask in /proc.
fn catches_interrupt(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).expect("it runs");
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).expect("a mask of signals");
    let mask = u64::from_str_radix(caught.trim(), 16).expect("hexadecimal");
    mask & (1 << (Signal::INT.as_raw() - 1)) != 0
}
