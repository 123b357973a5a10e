//! The rig files that the design study writes are accepted by `hbot rig check` and by a server.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::process::*;

fn rigs(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").path());
    let mut all: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    all.sort();
    all
}

/// Asserts that `hbot rig check` accepts the rig without a warning, and that a server runs it for 1
/// s of virtual time without a fault.
fn assert_is_a_rig(rig: &Path, wheels: &str, state: &Path) {
    let path = rig.to_str().expect("UTF-8");
    assert_cmd::Command::from_std(hbot())
        .args(["rig", "check", path])
        .timeout(Duration::from_secs(120))
        .assert()
        .success()
        .stdout(contains("a legal design").and(contains("warning").not()));
    let server = Process::start(&["--rig", path, "--time", "virtual", "--duration", "1"], state);
    assert!(server.banner.contains(wheels), "{path}: {}", server.banner);
    let (said, status) = server.end();
    assert!(status.success(), "{path}: {status}: {said}");
    assert!(said.contains("after 1000 ticks"), "{path}: {said}");
    // A fault would have left a flight log of its last second.
    let logs = std::fs::read_dir(state.join("hbot/flight")).expect("the folder of flight logs").count();
    assert_eq!(logs, 0, "{path}: {said}");
}

/// Those of `docs/design`. A test of hbot-study shows that a run writes the designs that it has
/// measured.
#[test]
fn every_rig_file_of_the_design_study_is_checked_and_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let rigs = rigs(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/design"));
    assert_eq!(rigs.len(), 15);
    for rig in &rigs {
        let name = rig.file_name().expect("a name").to_string_lossy().into_owned();
        let wheels = format!("{} wheels", &name["design_".len()..="design_".len()]);
        assert_is_a_rig(rig, &wheels, folder.path());
    }
}

/// The rig files of this repository are accepted too.
#[test]
fn the_rigs_of_the_shelf_are_checked_and_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let shelf = Path::new(env!("CARGO_MANIFEST_DIR")).join("rigs");
    for rig in rigs(&shelf) {
        assert_is_a_rig(&rig, "wheels", folder.path());
    }
}
