//! docs/design-study.md against docs/design/report.md.

use super::{agree, cell, check, filled, left_over, number, numbers, rounded, rows, whole_cell};

const PAGE: &str = include_str!("../../../../../docs/design-study.md");
const REPORT: &str = include_str!("../../../../../docs/design/report.md");

fn best(design: &str, column: &str) -> String {
    cell(REPORT, "The best designs", &[design], column)
}

fn wheels(count: &str, column: &str) -> String {
    whole_cell(REPORT, "Two, three and four of the prototype's wheels", &[count], column)
}

/// Converts a figure in docs/design-study.md to the unit of the report. Only the units of inertias
/// differ: g m² on the page and kg m² in the report.
fn in_report_unit(column: &str, figure: &str) -> String {
    if column == "inertia, g m²" { format!("{figure}e-3") } else { figure.to_owned() }
}

/// Checks that a table in docs/design-study.md agrees with the report. The table has a column named
/// `mark`, and `count` rows. `look_up` returns the report's figure for a row and a column.
fn compare(mark: &str, count: usize, look_up: impl Fn(&str, &str) -> String) {
    let rows: Vec<_> = rows(PAGE).into_iter().filter(|(head, _)| head.contains(&mark)).collect();
    assert_eq!(rows.len(), count, "rows of the table with {mark:?}");
    for (head, cells) in rows {
        for (column, ours) in head.iter().zip(&cells).skip(1) {
            let theirs = look_up(cells[0], column);
            let same = *ours == theirs || agree(&in_report_unit(column, ours), &theirs);
            assert!(same, "docs/design-study.md, {}, {column}: {ours} for {theirs}", cells[0]);
        }
    }
}

#[test]
fn the_table_of_designs_is_the_reports() {
    compare("cone, deg", 4, |design, column| {
        let name = design.replace(" wheels, ", "w_");
        best(&name, if column == "inertia, g m²" { "inertia, kg m²" } else { column })
    });
}

#[test]
fn the_table_of_more_wheels_is_the_reports() {
    compare("slip components seen", 3, |count, column| match column {
        "GCI" => wheels(count, "mean spectral index"),
        "one wheel's motors dead, N m" => wheels(count, "one wheel dead, N m"),
        "the same, normal force shared" => wheels(count, "normal force shared, N m"),
        "of one wheel's slip seen, worst" => {
            let both = wheels(count, "of one wheel's: mean, least");
            both.split(", ").nth(1).expect("mean and least").to_owned()
        }
        "inertia, g m²" => wheels(count, "inertia, kg m²"),
        column => wheels(count, column),
    });
}

#[test]
fn every_other_figure_of_the_page_is_the_reports() {
    let inertia = |count: &str| number(&wheels(count, "inertia, kg m²"));
    let more = ["3", "4"].map(|count| format!("{:.0}", 100.0 * (inertia(count) / inertia("2") - 1.0)));
    let apart = check(REPORT, "what two seeds find beats the same share of the box within 0.05, relatively");
    let said = [
        filled("beat the same share of the space of figures within {} %", &[rounded(&apart, 100.0, 1)]),
        filled("the margin before slip ends it near {} deg", &[best("2w_steering", "cone, deg")]),
        filled(
            "three and four wheels go on to {} deg",
            &[rounded(&best("3w_steering", "cone, deg"), 1.0, 0)],
        ),
        filled("The price is {} % and {} % more apparent inertia", &more),
        filled(
            "the design \"3 wheels, compromise\" needs a traction limit of {} N at each contact",
            &[rounded(&best("3w_compromise", "contact force at peak torque, N"), 1.0, 0)],
        ),
    ];
    let prose: String = PAGE.lines().filter(|line| !line.starts_with('|')).collect::<Vec<_>>().join("\n");
    let left = left_over("docs/design-study.md", &prose, said);
    assert_eq!(numbers(&left), [""; 0], "docs/design-study.md quotes what this test does not look up");
}
