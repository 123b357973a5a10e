//! Tests of the studies through their public interface: ids of figures, checks, and written files.

mod accuracy;
mod allocation_page;
mod design;
mod effects;
mod files;
mod paper;
mod paper_rig;
mod program;
mod quoted;
mod stability;

use std::collections::HashSet;

use hbot_study::{Interrupt, Options, Report, Study};

/// Returns the options of a quick run that counts no instructions.
fn options() -> Options {
    Options { out: None, quick: true, counter: None }
}

fn measure(study: Study) -> Report {
    hbot_study::measure(study, &options(), &Interrupt::default()).expect("nobody stops it")
}

/// Asserts that every figure has a unique id in lower_snake_case, a finite value, and a family that
/// explains it in the report.
fn assert_documented(report: &Report) {
    let mut seen = HashSet::new();
    for figure in report.figures() {
        let id = &figure.id;
        assert!(seen.insert(id.clone()), "{id} is there twice");
        let snake = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
        assert!(id.as_bytes()[0].is_ascii_lowercase() && id.bytes().all(snake), "{id}");
        assert!(figure.value.is_finite(), "{id} is {}", figure.value);
        assert!(!figure.unit.is_empty(), "{id} is of no family that the report documents");
    }
}

fn assert_holds(report: &Report) {
    for check in report.checks() {
        assert!(check.holds, "{}: {}", check.what, check.found);
    }
    assert!(!report.checks().is_empty());
}

/// Returns the value of the figure `id`.
fn value(report: &Report, id: &str) -> f64 {
    let figure = report.figures().iter().find(|figure| figure.id == id);
    figure.unwrap_or_else(|| panic!("no figure {id}")).value
}
