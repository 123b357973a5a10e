//! What the server reports about its methods at start, and the choice of methods by a largest
//! allowed error.

use crate::process::Process;

/// Starts a server with `args` and returns the line about its methods.
fn methods(args: &[&str]) -> String {
    let server = Process::with(&[&["--time", "virtual"], args].concat());
    let line = server.banner.lines().find(|line| line.trim_start().starts_with("methods"));
    line.unwrap_or_else(|| panic!("no methods in:\n{}", server.banner)).to_owned()
}

#[test]
fn it_says_what_its_methods_cost_and_err() {
    let line = methods(&[]);
    for words in ["midpoint, straight", "us a tick here", "rad in 10 s of a test motion"] {
        assert!(line.contains(words), "{words} in: {line}");
    }
    assert!(methods(&["--accuracy", "exact"]).contains("magnus4, cubic"));
    // A fast loop is evaluated over a shorter time than a slow one, so that the start does not take
    // longer.
    assert!(methods(&["--rate", "20000"]).contains("rad in 1 s of a test motion"));
}

#[test]
fn a_target_picks_methods_that_are_as_cheap_as_it_allows() {
    // The server measures the costs at its start, and a busy machine can disturb that.
    let picks = |target: &str, names: &[&str]| {
        let mut lines = (0..5).map(|_| methods(&["--accuracy-target", target]));
        let picked = lines.any(|line| names.iter().any(|name| line.contains(name)));
        assert!(picked, "none of five starts picks {names:?} for {target}");
    };
    // Euler has an error of 7e-3 rad, and the best methods take half as long again.
    picks("1e-2", &["euler", "midpoint"]);
    // The counts alone have an error of 1e-4 rad, so no better method is needed.
    picks("3e-4", &["midpoint"]);
}
