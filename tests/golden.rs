//! The golden vectors: figures that an independent program computed from the physics notes
//! (tests/golden/README.md).
//!
//! The test reads every file of the folder in the variable `HBOT_GOLDEN`, or of tests/golden/ if it
//! is not set. It checks every figure of every case, with the core in 64 and in 32 bits.

#![allow(unreachable_pub, reason = "a test has no outside")]

mod golden_support;

use golden_support::{Ledger, check_folder};
use std::path::{Path, PathBuf};

/// The top of this repository, where a relative path in `HBOT_GOLDEN` begins.
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Folder of the vectors in this repository.
const HERE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden");

fn failures(ledgers: &[Ledger]) -> Vec<&str> {
    ledgers.iter().flat_map(|ledger| &ledger.failures).map(String::as_str).collect()
}

#[test]
fn every_golden_vector_is_met() {
    let folder = std::env::var_os("HBOT_GOLDEN")
        .map_or_else(|| PathBuf::from(HERE), |folder| Path::new(ROOT).join(folder));
    let ledgers = check_folder(&folder).unwrap_or_else(|message| panic!("{message}"));
    assert!(ledgers.iter().all(|ledger| ledger.compared > 0), "nothing was compared");
    let failures = failures(&ledgers);
    assert!(failures.is_empty(), "{} golden figures missed:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn the_sources_bring_all_seven_files() {
    let mut files: Vec<String> = std::fs::read_dir(HERE)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".json"))
        .collect();
    files.sort();
    let known = ["allocation", "dynamics", "hopf", "impedance", "kinematics", "odometry", "trajectories"];
    assert_eq!(files, known.map(|name| format!("{name}.json")));
}

/// Creates an empty folder for one test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("golden-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Returns a file of this repository with the first occurrence of `what` replaced.
fn altered(file: &str, what: &str, by: &str) -> String {
    let text = std::fs::read_to_string(Path::new(HERE).join(file)).unwrap();
    assert!(text.contains(what), "{file} has no {what}");
    text.replacen(what, by, 1)
}

#[test]
fn a_folder_without_vectors_is_refused() {
    assert!(check_folder(Path::new("/nonexistent")).is_err_and(|e| e.contains("/nonexistent")));
    let empty = folder("empty");
    std::fs::write(empty.join("README.md"), "nothing here").unwrap();
    assert!(check_folder(&empty).is_err_and(|e| e.contains("empty")));
}

#[test]
fn files_fields_and_texts_that_nobody_knows_are_refused_by_name() {
    for (file, text, says) in [
        ("vibration.json", "{}".to_owned(), "vibration.json"),
        ("hopf.json", "{\"about\": \"\", \"cases\": []}".to_owned(), "no cases"),
        ("hopf.json", altered("hopf.json", "\"psi\"", "\"chi\""), "chi"),
        ("impedance.json", altered("impedance.json", "\"energy\"", "\"power\""), "power"),
        ("kinematics.json", altered("kinematics.json", "\"cone\"", "\"tilt\""), "tilt"),
        ("hopf.json", altered("hopf.json", "\"cases\"", "\"more\": 1, \"cases\""), "more"),
    ] {
        let folder = folder("unknown");
        std::fs::write(folder.join(file), text).unwrap();
        let error = check_folder(&folder).err().unwrap_or_else(|| panic!("{file} with {says} was taken"));
        assert!(error.contains(file) && error.contains(says), "{error}");
    }
}

#[test]
fn every_wrong_figure_is_named_with_its_file_case_and_field() {
    let folder = folder("wrong");
    // One figure is cut after its tenth place, and one is clearly wrong.
    let case = "{\"theta\": 1.0, \"phi\": 0.5, \"psi\": 2.0, \"q\": [W, 0.7384602626041288, 0.033913221008892595, 0.47822457120764106]}";
    let cases = ["0.4741598817790379", "0.4741598817", "0.48"].map(|w| case.replace('W', w)).join(", ");
    std::fs::write(folder.join("hopf.json"), format!("{{\"about\": \"\", \"cases\": [{cases}]}}")).unwrap();
    let ledgers = check_folder(&folder).unwrap_or_else(|message| panic!("{message}"));
    let failures = failures(&ledgers);
    // In 32 bits the cut is below rounding.
    assert_eq!(failures.len(), 3, "{failures:#?}");
    assert!(failures[0].starts_with("hopf.json (f64), case 1, q[0]: got 4.74"), "{}", failures[0]);
    assert!(failures[1].starts_with("hopf.json (f64), case 2, q[0]: got 4.74"), "{}", failures[1]);
    assert!(failures[2].starts_with("hopf.json (f32), case 2, q[0]: got 4.74"), "{}", failures[2]);
}
