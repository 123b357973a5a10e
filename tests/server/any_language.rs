//! The program of docs/any-language.md runs.

use std::process::Command;

use crate::process::*;

#[test]
fn the_program_for_a_language_without_a_client_streams_torques() {
    let page = std::fs::read_to_string("docs/any-language.md").expect("the page");
    let (_, program) = page.split_once("```javascript\n").expect("a program");
    let (program, _) = program.split_once("```").expect("its end");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("damper.js");
    std::fs::write(&path, program).expect("written");
    let server = Process::start(&["--rig", &patient_rig(folder.path())], folder.path());
    let Ok(output) = Command::new("node").arg(&path).arg(&server.address).output() else {
        assert!(std::env::var_os("CI").is_none(), "node is missing");
        eprintln!("node is missing: the program of docs/any-language.md is not tried");
        return;
    };
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let torques = said.lines().find_map(|line| line.strip_suffix(" torques")).expect("a count");
    // A busy machine lets it answer only some of the 2000 states.
    assert!(torques.parse::<u32>().is_ok_and(|count| count > 10), "{said}");
}
