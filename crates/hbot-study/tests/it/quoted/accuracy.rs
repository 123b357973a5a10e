//! The figures quoted in docs/accuracy.md are those of its report, docs/accuracy/report.md.

use super::{filled, left_over, numbers};

const PAGE: &str = include_str!("../../../../../docs/accuracy.md");
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

/// Returns the sentences about odometry that the page must contain, filled with the figures of the
/// report.
fn orientation() -> Vec<String> {
    let method = |row: &[&str], rate: &str| cell("Odometry: the method's error", row, rate);
    let motion = |motion: &str, method: &str, path: &str, column: &str| {
        cell("Odometry: smooth motions", &[motion, method, path], column)
    };
    let (both, all) = ("method and path", "all three");
    let mut said = vec![
        filled(
            "{} rad in 0.6 s for Euler at 1 kHz, {} for midpoint, {} for magnus4",
            &["euler", "midpoint", "magnus4"].map(|name| method(&[name, "f64"], "1000 Hz")),
        ),
        filled(
            "the product leaves {} rad at 500 Hz, {} at 4 kHz and {} at 8 kHz",
            &["500 Hz", "4000 Hz", "8000 Hz"].map(|rate| method(&["product", "f32"], rate)),
        ),
        filled(
            "With the same turns, this leaves {} rad at 500 Hz and {} at 8 kHz",
            &["500 Hz", "8000 Hz"].map(|rate| method(&["change", "f32"], rate)),
        ),
        filled(
            "magnus4 errs by {} rad at 500 Hz and {} at 8 kHz",
            &["500 Hz", "8000 Hz"].map(|rate| method(&["magnus4", "f32"], rate)),
        ),
        filled(
            "the product leaves {} rad at 8 kHz and the change {}",
            &["product", "change"].map(|way| method(&[way, "f64"], "8000 Hz")),
        ),
        filled(
            "magnus4 gains nothing: for brisk motion at 1 kHz it errs by {} rad, and midpoint by {}",
            &["magnus4", "midpoint"].map(|method| motion("brisk", method, "straight", both)),
        ),
        filled(
            "On a quadratic path magnus4 errs by {} (order 3), on a cubic path by {} (order 4)",
            &["quadratic", "cubic"].map(|path| motion("brisk", "magnus4", path, both)),
        ),
        filled("keeps its own error, {}", &[motion("brisk", "midpoint", "cubic", "method's")]),
        filled(
            "where it reduces the error from {} to {} rad, and in violent motion that reverses from {} to {} rad",
            &[
                motion("violent", "midpoint", "straight", all),
                motion("violent", "magnus4", "cubic", all),
                motion("violent_reversing", "midpoint", "straight", all),
                motion("violent_reversing", "magnus4", "cubic", all),
            ],
        ),
    ];
    for name in
        ["gentle", "brisk", "violent"].iter().flat_map(|n| [(*n).to_owned(), format!("{n}_reversing")])
    {
        let of = |method: &str, path: &str, column: &str| motion(&name, method, path, column);
        let row = [
            of("euler", "straight", "method's"),
            of("midpoint", "straight", "method's"),
            of("magnus4", "straight", "method's"),
            of("midpoint", "straight", "path's"),
            of("midpoint", "quadratic", "path's"),
            of("midpoint", "cubic", "path's"),
            of("midpoint", "straight", "counts'"),
            of("midpoint", "straight", all),
            of("magnus4", "cubic", all),
        ];
        said.push(format!("| {} | {} |", name.replace('_', ", "), row.join(" | ")));
    }
    said
}

/// Returns all other sentences with figures that the page must contain, filled with the figures of
/// the report.
fn the_rest() -> Vec<String> {
    let plant = |step: &str| cell("The plant", &["rk4", step], "error, rad");
    let slips = |step: &str| cell("The plant that slips", &[step], "error, rad");
    let allocation = |row: &[&str; 4], column: &str| cell("Allocation", row, column);
    let near = |width: &str| cell("Kinematics near singular designs", &["gap_10mdeg", width], "error");
    let tick = |preset: &str, column: &str| cell("The whole tick", &[preset], column);
    let growth = cell("Checks", &["a heading error grows by exp(cot a) a radian, to 0.1 %"], "found");
    let clipped =
        ["2", "4"].map(|wheels| percent(&allocation(&["clipped", "f64", wheels, "150"], "shortfall")));
    let turned = allocation(&["cut", "f64", "2", "150"], "direction, rad");
    vec![
        filled("measured as {} after one radian", &[growth]),
        filled(
            "from {} rad (a step of 10 ms) down to {} (50 microseconds), with {} rad at the 1 ms of virtual time",
            &["10000", "50", "1000"].map(plant),
        ),
        filled(
            "{} rad at the 250 microseconds that the simulated rig takes then, {} at 25",
            &["250", "25"].map(slips),
        ),
        filled(
            "loses, at the median, {} % of what two wheels could make and {} % of what four could",
            &clipped,
        ),
        filled(
            "but turned by {} rad and more",
            &[format!("{:.1}", turned.parse::<f64>().expect("a number"))],
        ),
        filled("f64 errs by {} of the sphere's rate and f32 by {}", &["f64", "f32"].map(near)),
        filled(
            "`fast` errs by {} rad, `balanced` by {} and `exact` by {}",
            &["fast", "balanced", "exact"].map(|preset| tick(preset, "error, rad in 10 s")),
        ),
        filled(
            "With exact readings `balanced` would err by {} and `exact` by {}",
            &["balanced", "exact"].map(|preset| tick(preset, "method and path")),
        ),
        filled("The counts err by {} in all three", &[tick("balanced", "of the counts")]),
        filled(
            "The path contributes {} in `balanced` and {} in `exact`",
            &["balanced", "exact"].map(|preset| tick(preset, "of the path")),
        ),
    ]
}

/// Sentences on the page whose rounded numbers are not figures of the report, so that they are not
/// compared.
const ROUND: [&str; 3] =
    ["errors of 1e-3 rad will do", "an error of 1e-6 rad would take", "1e-4 rad at 4 N m/rad is 0.4 mN m"];

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
    let left = left_over("docs/accuracy.md", PAGE, orientation().into_iter().chain(the_rest()).chain(others));
    let left: Vec<&str> = numbers(&left).into_iter().filter(|number| number.contains("e-")).collect();
    assert!(left.is_empty(), "docs/accuracy.md quotes what this test does not look up: {left:?}");
}
