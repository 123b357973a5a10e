//! docs/stability.md and the row of docs/internals/hard-cases.md on a day of ticks, against
//! docs/stability/report.md.

use super::{agree, cell, check, filled, left_over, number, numbers, rounded, whole_cell};

const PAGE: &str = include_str!("../../../../../docs/stability.md");
const HARD_CASES: &str = include_str!("../../../../../docs/internals/hard-cases.md");
const REPORT: &str = include_str!("../../../../../docs/stability/report.md");
const LEAD: &str = include_str!("../../../../../docs/lead/report.md");

/// Returns the largest error that the report states for the check named `what`, in percent with one
/// decimal.
fn percent(what: &str) -> String {
    rounded(&check(REPORT, what), 100.0, 1)
}

fn borders() -> Vec<String> {
    let friction = |step: &str, column: &str| {
        cell(REPORT, "Friction and the encoder's step", &["0.001", "0.002", step], column)
    };
    let (fine, coarse) = ("6.7e-5", "0.0043");
    assert_eq!(friction(fine, "first buzz, N m/rad"), friction(coarse, "first buzz, N m/rad"), "at the same");
    vec![
        filled(
            "each of four rates, on one axis simulated exactly, meet it within {} %",
            &[percent("the linear border is (b + B)/(h (1/2 + D)) within 0.05")],
        ),
        filled(
            "meets it within {} %, and the eigenvalues of the sampled loop within {} %, so there is no delay",
            &[
                rounded(
                    &check(REPORT, "the whole loop swings up from B/(h (1/2 + D)), D = 1, within 0.1"),
                    100.0,
                    2,
                ),
                rounded(
                    &check(
                        REPORT,
                        "the whole loop swings up where its eigenvalues leave the unit circle, within 0.0002",
                    ),
                    100.0,
                    3,
                ),
            ],
        ),
        filled(
            "eigenvalues of the sampled loop and the whole loop agree with it within {} %.",
            &[percent("with a lag the border is B/(h (1/2 + D) + lag), D = 1, within 0.01")],
        ),
        filled(
            "for each N m/rad, within {} % of Colgate and Schenkel",
            &[percent("the passive border is that of Colgate and Schenkel within 0.1")],
        ),
        filled(
            "axis with b = 0.001 N m s/rad and 2 mN m of friction is let go at 0.05 rad. It first buzzes at {} N \
             m/rad, although only springs up to {} N m/rad are passive. With encoders of 256 counts a turn it first \
             buzzes at {} N m/rad too, although only springs up to {} N m/rad are passive.",
            &[
                rounded(&friction(fine, "first buzz, N m/rad"), 1.0, 1),
                friction(fine, "passive to"),
                rounded(&friction(coarse, "first buzz, N m/rad"), 1.0, 1),
                rounded(&friction(coarse, "passive to"), 1.0, 1),
            ],
        ),
    ]
}

fn stage() -> Vec<String> {
    let guard = "With and without the passivity stage";
    let searched = whole_cell(REPORT, guard, &["5", "3.33"], "on/border");
    let damped = |b: &str| number(&cell(REPORT, guard, &[b], "on, N m/rad"));
    let energy = |column: &str| cell(REPORT, "Energy given out", &["6"], column);
    let about = 0.5 * (damped("20") + damped("50"));
    vec![
        filled(
            "Without the stage it comes to rest up to the linear border, within {} %",
            &[percent("without the stage a tap comes to rest up to the linear border within 0.05")],
        ),
        filled("it comes to rest up to {} times that", &[searched.replace("more than ", "")]),
        filled(
            "(0.02 N m s/rad and more at 1 kHz) up to about {} N m/rad",
            &[format!("{:.0}", 10.0 * (about / 10.0).round())],
        ),
        filled(
            "the motors give out {} J to the swing without the stage, and {} mJ with the stage, of which 1 mJ",
            &[rounded(&energy("off, J"), 1.0, 1), rounded(&energy("on, J"), 1e3, 1)],
        ),
    ]
}

/// Returns two results from the report's checks of a simulated day: the largest deviation of |q|
/// from 1, and the largest growth of the energy.
fn day() -> [String; 2] {
    [
        check(REPORT, "a day: the quaternion is unit to 1e-12"),
        check(REPORT, "a day: the energy never grows by more than 1e-7"),
    ]
}

/// Texts in docs/stability.md with numbers that are not figures of the report: choices of the
/// study and of the judge, a result of `hbot rig check` for the prototype, the largest damping of
/// `hbot info`, which a test of the server holds against the page, and the guard's measurements.
const OTHERS: [&str; 16] = [
    "with a damping of 0.01 N m s/rad and a lag of 0.5 ms, in N m/rad",
    "The factor is 1.1: with the lag",
    "(4.9 for 5.0), a wall",
    "a spring of 5 N m/rad with 0.02 N m s/rad feels as the scene says",
    "within 1.2 %: 236 N m/rad at a lag of 0.5 ms, 365 at 0.1 ms",
    "With the factor 1.1 it takes 2 to 6 % at 0.5 to 5 rad/s",
    "the factor 1.1 acts like 1.47",
    "a lag of half a period, 0.5 ms at 1 kHz",
    "234 N m/rad with a damping of 0.01 N m s/rad (the spring's and the device's together), 258 with 0.02, 307 with 0.05",
    "5.0 N m/rad for each 0.01 N m s/rad of damping",
    "with a lag of 0.5 ms at 1 kHz, from 0.88 J/h on",
    "Motors without a lag would allow 6.7 N m/rad",
    "The swings have 0.2, 0.33, 0.55 and 1 rad/s",
    "beyond 0.2 rad/s in both directions within 0.2 s",
    "calm for 0.5 s",
    "found within 0.2 s, and none swings at more than 0.3 rad/s with the guard",
];

/// Returns the rows of the table of the lead. Each of their figures is one of the study `lead`.
fn lead() -> Vec<String> {
    let measured: Vec<&str> = LEAD.split_whitespace().filter(|word| word.parse::<f64>().is_ok()).collect();
    let section = PAGE.split("## With the lead").nth(1).and_then(|rest| rest.split("\n## ").next());
    let rows = section.expect("a section").lines().filter(|line| line.starts_with("| "));
    let rows: Vec<String> = rows.map(str::to_owned).collect();
    assert_eq!(rows.len(), 8, "a head and seven factors");
    for row in &rows[1..] {
        for figure in numbers(row) {
            assert!(
                measured.iter().any(|other| agree(figure, other)),
                "not in docs/lead/report.md: {figure} of {row}"
            );
        }
    }
    rows
}

#[test]
fn every_figure_of_the_page_is_the_reports() {
    let said = borders().into_iter().chain(stage()).chain(lead());
    let left = left_over("docs/stability.md", PAGE, said.chain(OTHERS.map(str::to_owned)));
    assert_eq!(numbers(&left), [""; 0], "docs/stability.md quotes what this test does not look up");
}

#[test]
fn the_hard_case_of_a_day_quotes_the_report() {
    let [unit, grown] = day();
    assert!(
        HARD_CASES.contains(&format!("| {unit}; {grown} |")),
        "docs/internals/hard-cases.md, 11: {unit}; {grown}"
    );
    assert!(agree(&unit, "2.2e-16"), "the rounding of a real in f64");
}
