//! The figures quoted in docs/accuracy.md are those of its report, docs/accuracy/report.md.

use super::{filled, left_over, numbers};

const PAGE: &str = include_str!("../../../../../docs/accuracy.md");
const README: &str = include_str!("../../../../../README.md");
const PHYSICS: &str = include_str!("../../../../../docs/internals/physics.md");
/// The report that a full run of `hbot-study accuracy` has written, without `--quick`.
pub(crate) const REPORT: &str = include_str!("../../../../../docs/accuracy/report.md");

fn cell(section: &str, row: &[&str], column: &str) -> String {
    super::cell(REPORT, section, row, column)
}

/// Converts a share, such as 0.25, to a whole number of per cent.
fn percent(share: &str) -> String {
    format!("{:.0}", 100.0 * share.parse::<f64>().expect("a number"))
}

/// Returns the sentences with figures that the page must contain, filled with the figures of the
/// report.
fn said() -> Vec<String> {
    let motion = |motion: &str, method: &str, path: &str| {
        cell("Odometry: smooth motions", &[motion, method, path], "all three")
    };
    let allocation = |row: &[&str; 4], column: &str| cell("Allocation", row, column);
    let growth = cell("Checks", &["a heading error grows by exp(cot a) a radian, to 0.1 %"], "found");
    let clipped =
        ["2", "4"].map(|wheels| percent(&allocation(&["clipped", "f64", wheels, "150"], "shortfall")));
    let mut said = presets().to_vec();
    said.extend([
        filled(
            "where it reduces the error from {} to {} rad, and in violent motion that reverses from {} to {} rad",
            &[
                motion("violent", "midpoint", "straight"),
                motion("violent", "magnus4", "cubic"),
                motion("violent_reversing", "midpoint", "straight"),
                motion("violent_reversing", "magnus4", "cubic"),
            ],
        ),
        filled("{} after one radian", &[growth]),
        filled("rk4 errs by {} rad at 1 ms", &[cell("The plant", &["rk4", "1000"], "error, rad")]),
        filled(
            "loses, at the median, {} % of what two wheels could make and {} % of what four could",
            &clipped,
        ),
        filled(
            "With exact readings `balanced` would err by {} and `exact` by {}",
            &["balanced", "exact"].map(|preset| tick(preset, "method and path")),
        ),
        filled("The counts err by {} in all three", &[tick("balanced", "of the counts")]),
    ]);
    said
}

fn tick(preset: &str, column: &str) -> String {
    cell("The whole tick", &[preset], column)
}

/// Returns the sentence about the presets, which README quotes too.
fn presets() -> [String; 1] {
    [filled(
        "`fast` errs by {} rad, `balanced` by {} and `exact` by {}",
        &["fast", "balanced", "exact"].map(|preset| tick(preset, "error, rad in 10 s")),
    )]
}

/// Sentences on the page whose rounded numbers are not figures of the report, so that they are not
/// compared.
const ROUND: [&str; 1] = ["1e-4 rad at 4 N m/rad is 0.4 mN m"];

/// Sentences on the page about what the server prints when it starts. The test
/// tests/server/accuracy.rs checks them.
const OF_THE_SERVER: [&str; 3] = [
    "errs by 7.4e-5 rad in 10 s of brisk motion",
    "`hbot server --accuracy-target 1e-3`",
    "Euler down to 7e-3 rad, midpoint down to 7.4e-5, and nothing below",
];

#[test]
fn the_drift_of_each_method_in_the_physics_notes_is_the_reports() {
    let row = |label: &str| PHYSICS.lines().find(|line| line.starts_with(label)).expect("a row").to_owned();
    for (label, method) in [("| Euler |", "euler"), ("| midpoint |", "midpoint"), ("| Magnus 4 |", "magnus4")]
    {
        let drift = cell("Odometry: the method's error", &[method, "f64"], "1000 Hz");
        let last = row(label).trim_end_matches(" |").rsplit("| ").next().expect("a cell").to_owned();
        assert_eq!(last.trim_end_matches(" rad"), drift, "docs/internals/physics.md, section 4: {label}");
    }
}

/// Every number with an exponent in docs/accuracy.md agrees with the report. Times have no exponent
/// on that page. They depend on the computer and are not compared.
#[test]
fn every_figure_of_the_page_is_the_reports() {
    let others = ROUND.into_iter().chain(OF_THE_SERVER).map(str::to_owned);
    let left = left_over("docs/accuracy.md", PAGE, said().into_iter().chain(others));
    let left: Vec<&str> = numbers(&left).into_iter().filter(|number| number.contains("e-")).collect();
    assert!(left.is_empty(), "docs/accuracy.md quotes what this test does not look up: {left:?}");
}

#[test]
fn the_figures_of_the_readme_are_the_reports() {
    let counts = filled("of which the counts of the encoders make {}", &[tick("balanced", "of the counts")]);
    left_over("README.md", README, presets().into_iter().chain([counts]));
}
