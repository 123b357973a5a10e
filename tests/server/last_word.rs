//! A server that is killed or aborts while motors make torque: a helper process switches the motors
//! off in its place.

use hbot_testing::far::Far;
use std::path::Path;

use hbot_config::RigConfig;
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_testing::prototype::simulated_as;
use rustix::process::getpgid;

use crate::process::*;

/// Watchdog time in the helper's commands, ms.
const HELPERS: u16 = 1;
/// Watchdog time in the server's own commands, ms, as in the patient rig file.
const SERVERS: u16 = 1000;

/// Starts a server that outputs torque, with its motor controllers.
fn pushing(folder: &Path) -> (Process, Far) {
    let (rig, scene) = (patient_rig(folder), push_scene(folder));
    let far = Far::start(&RigConfig::from_path(Path::new(&rig)).expect("a rig"));
    let server = Process::start(&["--rig", &rig, "--port", &far.path, "--scene", &scene], folder);
    push(&mut server.holder(), || far.pushed());
    (server, far)
}

/// Returns the processes that `server` has started.
fn helpers(server: &Process) -> Vec<Pid> {
    let parent = server.pid().to_string();
    let processes = std::fs::read_dir("/proc").expect("a list").flatten();
    let of_server = processes.filter_map(|entry| {
        let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
        // The fields after the name in parentheses: the state, then the parent.
        let its_parent = stat.rsplit_once(')')?.1.split_whitespace().nth(1)?;
        Pid::from_raw(entry.file_name().to_str()?.parse().ok()?).filter(|_| its_parent == parent)
    });
    of_server.collect()
}

fn is_there(process: Pid) -> bool {
    Path::new("/proc").join(process.as_raw_nonzero().to_string()).exists()
}

/// Returns whether the process is still running. An orphaned process stays a zombie if process 1
/// does not collect it, as in some containers.
fn runs(process: Pid) -> bool {
    let stat = format!("/proc/{}/stat", process.as_raw_nonzero());
    std::fs::read_to_string(stat).is_ok_and(|stat| !stat.contains(") Z "))
}

#[test]
fn a_server_that_is_killed_or_aborts_leaves_zero_torque_on_the_line() {
    for signal in [Signal::KILL, Signal::ABORT] {
        let folder = tempfile::tempdir().expect("a folder");
        let (server, far) = pushing(folder.path());
        let [helper] = helpers(&server)[..] else { panic!("one helper a line") };
        server.signal(signal);
        let (_, status) = server.end();
        assert_eq!(std::os::unix::process::ExitStatusExt::signal(&status), Some(signal.as_raw()));
        assert_eq!(far.ends_still().watchdog_ms, HELPERS, "{signal:?}");
        eventually("the helper ends", || !runs(helper));
    }
}

#[test]
fn a_server_that_ends_as_asked_says_the_last_word_itself_and_leaves_no_helper() {
    let folder = tempfile::tempdir().expect("a folder");
    let (server, far) = pushing(folder.path());
    let [helper] = helpers(&server)[..] else { panic!("one helper a line") };
    server.signal(Signal::TERM);
    assert_eq!(server.end().1.code(), Some(0));
    assert!(!is_there(helper), "it is waited for");
    assert!(!far.any_after(0, |command| command.watchdog_ms == HELPERS), "the helper has said something");
    assert_eq!(far.ends_still().watchdog_ms, SERVERS);
}

#[test]
fn signals_of_a_terminal_or_a_service_manager_do_not_reach_the_helper() {
    let folder = tempfile::tempdir().expect("a folder");
    let (server, far) = pushing(folder.path());
    let [helper] = helpers(&server)[..] else { panic!("one helper a line") };
    assert_eq!(getpgid(Some(helper)).expect("it is there"), helper, "it leads a process group");
    for signal in STOPPING {
        kill_process(helper, signal).expect("it is there");
    }
    server.signal(Signal::KILL);
    server.end();
    assert_eq!(far.ends_still().watchdog_ms, HELPERS);
}

#[test]
fn a_line_that_is_opened_anew_has_a_helper_of_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let (rig, scene) = (patient_rig(folder.path()), push_scene(folder.path()));
    // These motor controllers still know their zeros after a loss of power.
    let text = std::fs::read_to_string(&rig).expect("readable");
    std::fs::write(&rig, text.replace("zero = \"assume\"", "zero = \"absolute\"")).expect("written");
    let config = RigConfig::from_path(Path::new(&rig)).expect("a rig");
    // A `Far` would not do: the server would inherit its near end and keep it open.
    let pty = spawn_pty(simulated_as(&config, |_| ()), PtyOptions::default()).expect("a pseudo-terminal");
    let link = folder.path().join("hbot");
    std::os::unix::fs::symlink(pty.path(), &link).expect("a link");
    let port = link.to_str().expect("UTF-8");
    let server = Process::start(&["--rig", &rig, "--port", port, "--scene", &scene], folder.path());
    let [first] = helpers(&server)[..] else { panic!("one helper a line") };

    let other = Far::start(&config);
    std::fs::remove_file(&link).expect("it was there");
    std::os::unix::fs::symlink(&other.path, &link).expect("a link");
    drop(pty);
    eventually("the line is back", || other.count() > 50);
    eventually("the first helper is gone, not even a zombie", || !is_there(first));
    push(&mut server.holder(), || other.pushed());
    let [second] = helpers(&server)[..] else { panic!("one helper a line") };
    server.signal(Signal::KILL);
    server.end();
    assert_eq!(other.ends_still().watchdog_ms, HELPERS);
    eventually("the second helper ends", || !runs(second));
}
