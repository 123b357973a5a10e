//! Tests of the studies through their public interface: ids of figures, checks, and written files.

mod accuracy;
mod allocation_page;
mod design;
mod effects;
mod feel;
mod files;
mod paper;
mod paper_rig;
mod program;
mod stability;
mod tables;

use std::collections::HashSet;

use hbot_study::{Report, Study, StudyOptions};

/// Returns the options of a quick run of a study that counts no instructions.
fn options() -> StudyOptions {
    StudyOptions { out: None, quick: true, counter: None }
}

fn measure(study: Study) -> Report {
    hbot_study::measure(study, &options())
}

/// Asserts that every figure of a report has a unique id in lower_snake_case, a finite value, and
/// an explanation in the report.
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
    assert_concludes(report);
}

/// Asserts that a report begins with three to five sentences, all of whose figures are numbers, and
/// that its chief plot follows.
fn assert_concludes(report: &Report) {
    let said = report.conclusions();
    assert!((3..=5).contains(&said.len()), "{said:?}");
    for sentence in said {
        let words: Vec<&str> = sentence.split(|c: char| !c.is_alphanumeric()).collect();
        assert!(sentence.ends_with('.') && words.len() > 5, "{sentence}");
        assert!(!words.iter().any(|word| ["NaN", "inf"].contains(word)), "{sentence}");
    }
    // One sentence may say in words alone that something was not counted, or that nothing is
    // better.
    let figures = said.iter().filter(|sentence| sentence.contains(|c: char| c.is_ascii_digit())).count();
    assert!(figures + 1 >= said.len(), "{said:?}");
    let text = report.markdown();
    let plot = text.find(&format!("]({})", report.chief_plot())).expect("the plot that matters");
    assert!(plot < text.find("## This run").expect("a description of the run"), "the plot comes first");
}

fn assert_holds(report: &Report) {
    for check in report.checks() {
        assert!(check.holds, "{}: {}", check.what, check.found);
    }
    assert!(!report.checks().is_empty());
}

/// Returns the value of the figure with the given id. Panics if the report has no such figure.
fn value(report: &Report, id: &str) -> f64 {
    let figure = report.figures().iter().find(|figure| figure.id == id);
    figure.unwrap_or_else(|| panic!("no figure {id}")).value
}
