//! `hbot rig check --drawing` draws any rig file, and the page of the device shows the prototype.

use std::path::Path;

use crate::process::*;

/// Draws a rig file. Returns the picture.
fn drawn(rig: &Path) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("rig.svg");
    let mut command = assert_cmd::Command::from_std(hbot());
    let check = command.args(["rig", "check"]).arg(rig).arg("--drawing").arg(&out);
    let assert = check.timeout(std::time::Duration::from_secs(120)).assert();
    assert.stdout(contains(format!("drawing {}", out.display())));
    std::fs::read_to_string(out).expect("a picture")
}

#[test]
fn the_drawing_of_the_page_is_that_of_the_prototype() {
    let page = Path::new("docs/build-one.svg");
    let now = drawn(Path::new("rigs/prototype.toml"));
    if std::env::var_os("HBOT_BLESS").is_some() {
        std::fs::write(page, &now).expect("written");
    }
    let have = std::fs::read_to_string(page).expect("the picture of the page");
    assert!(have == now, "docs/build-one.svg is not what the command draws (HBOT_BLESS=1 draws it)");
}

#[test]
fn every_rig_file_can_be_drawn() {
    for rig in ["three_wheels", "four_wheels", "prototype-moteus", "prototype-odrive"] {
        let picture = drawn(Path::new(&format!("rigs/{rig}.toml")));
        assert!(picture.contains("cone"), "{rig}");
    }
}
