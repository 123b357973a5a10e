//! docs/internals/velocity.md against the joint rates of docs/accuracy/report.md. Its column of
//! times is not compared: it is the machine's.

use super::accuracy::REPORT;
use super::{agree, cell, rows};

const PAGE: &str = include_str!("../../../../../docs/internals/velocity.md");

/// For each table in docs/internals/velocity.md, the words that introduce it, and the name of its
/// encoders in the report.
const TABLES: [(&str, &str); 2] = [
    ("4096 x 4 counts a turn on all joints, before", "16384"),
    ("512 x 4 on all joints:", "2048"),
];

/// Converts the name of a method that estimates joint rates from the form in
/// docs/internals/velocity.md to that in the report. For example, `low_pass` with 100 Hz becomes
/// `low_pass_100hz`.
fn method(page: &str) -> String {
    let (name, choice) = page.split_once(',').unwrap_or((page, ""));
    let name = name.trim_matches('`');
    let size = choice.split_whitespace().next().unwrap_or_default();
    match name {
        "controller" | "difference" => name.to_owned(),
        "low_pass" => format!("low_pass_{size}hz"),
        _ => format!("{name}_{size}"),
    }
}

#[test]
fn every_figure_of_the_tables_but_times_is_the_reports() {
    let mut seen = 0;
    for (begin, counts) in TABLES {
        let table = PAGE.split(begin).nth(1).expect("a table for these encoders");
        let table = table.split("\n\n").nth(1).expect("a table below its heading");
        for (head, cells) in rows(table) {
            for column in ["noise, held", "noise, slow", "noise, brisk", "lag, ms", "false slip, mm/s"] {
                let at = head.iter().position(|name| *name == column).expect("a column");
                let (ours, method) = (cells[at], method(cells[0]));
                let theirs = cell(REPORT, "Joint rates", &[counts, &method], column);
                assert!(
                    agree(ours, &theirs),
                    "docs/internals/velocity.md, {begin} {method}, {column}: {ours} for {theirs}"
                );
                seen += 1;
            }
        }
    }
    assert_eq!(seen, 2 * 9 * 5);
}

/// In docs/internals/velocity.md, the noise of the raw difference about one axis is that of the
/// table divided by the square root of 3.
#[test]
fn the_noise_about_one_axis_is_that_of_the_table() {
    assert!(PAGE.contains("| 0.0307 |"), "stands in a table");
    assert!(agree(&format!("{:.4}", 0.0307 / 3.0_f64.sqrt()), "0.018"));
    assert!(PAGE.contains("0.018 rad/s with 4096 x 4 counts (0.0307 over sqrt 3)"));
}
