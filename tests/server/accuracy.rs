//! What the server says of its methods at start, and methods by the error that they may make.

use crate::process::Process;

/// The line of the methods.
fn methods(args: &[&str]) -> String {
    let state = tempfile::tempdir().expect("a folder");
    let server = Process::start(&[&["--time", "virtual"], args].concat(), state.path());
    let line = server.banner.lines().find(|line| line.trim_start().starts_with("methods"));
    line.unwrap_or_else(|| panic!("no methods in:\n{}", server.banner)).to_owned()
}

#[test]
fn it_says_what_its_methods_cost_and_err() {
    let line = methods(&[]);
    for words in ["midpoint, straight", "us a tick here", "rad in 10 s of brisk motion"] {
        assert!(line.contains(words), "{words} in: {line}");
    }
    assert!(methods(&["--accuracy", "exact"]).contains("magnus4, cubic"));
    // A quick loop is not followed for longer than a slow one: it would hold up the start.
    assert!(methods(&["--rate", "20000"]).contains("rad in 1 s of brisk motion"));
}

#[test]
fn a_target_picks_methods_that_are_as_cheap_as_it_allows() {
    // Euler errs by 7e-3 rad, and the best methods take half as long again.
    let line = methods(&["--accuracy-target", "1e-2"]);
    assert!(line.contains("euler") || line.contains("midpoint"), "{line}");
    // The counts' own error is 1e-4 rad: no better method is called for.
    let line = methods(&["--accuracy-target", "3e-4"]);
    assert!(line.contains("midpoint"), "{line}");
}
